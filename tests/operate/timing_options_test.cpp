// Every service of a bus is as patient as the machine file says.
#include <gtest/gtest.h>
#include <chrono>

#include "berth/operate/timing_options.hpp"

#include "tests/pch.hpp"

using namespace berth;
using namespace std::chrono_literals;

namespace {

design::Timing odd() {
  design::Timing t;
  t.lss_timeout = 11ms;
  t.store_timeout = 12ms;
  t.save_timeout = 13s;
  t.sdo_timeout = 14ms;
  t.guard_timeout = 15ms;
  t.rand_response = 16ms;
  t.boot_timeout = 17ms;
  t.tries = 7;
  return t;
}

}  // namespace

// HU.19: time-outs are options.
TEST(TimingOptions, HU_19_EachServiceGetsAllOfTheMachinesTiming) {
  const auto t = odd();
  const auto binder = operate::binder_options(t);
  EXPECT_EQ(binder.tries, 7U);
  EXPECT_EQ(binder.boot_timeout, rt::Duration(17ms));
  EXPECT_EQ(binder.guard_timeout, rt::Duration(15ms));
  EXPECT_EQ(binder.slow_inhibit, rt::Duration(16ms));
  const auto lss = operate::lss_options(t);
  EXPECT_EQ(lss.service.timeout, rt::Duration(11ms));
  EXPECT_EQ(lss.identify.timeout, rt::Duration(11ms));
  EXPECT_EQ(lss.store.timeout, rt::Duration(12ms));
  const auto sdo = operate::sdo_options(t);
  EXPECT_EQ(sdo.timeout, rt::Duration(14ms));
  EXPECT_EQ(sdo.retries, 6U);
  const auto saving = operate::saving_options(t);
  EXPECT_EQ(saving.timeout, rt::Duration(13s));
  EXPECT_EQ(saving.retries, 0U) << "a saving is not repeated blindly";
  EXPECT_FALSE(saving.abort_on_timeout);
  const auto configurator = operate::configurator_options(t);
  EXPECT_EQ(configurator.tries, 7U);
  EXPECT_EQ(configurator.ask_pause * configurator.asks, rt::Duration(13s));
}

TEST(TimingOptions, HU_19_TheDefaultsAreLongEnough) {
  const design::Timing t;
  EXPECT_GE(t.save_timeout, rt::Duration(10s));
  EXPECT_GE(t.boot_timeout, rt::Duration(10s));
  EXPECT_GE(t.sdo_timeout, rt::Duration(500ms)) << "20 ms are what users complain about";
}
