// What a tap hears of frames that an error ended: what, where in the frame, who sent it, who signalled it first. The
// expected places are counted by hand from the frame's bits (Bosch CAN 2.0 §3), the codes are those of
// linux/can/error.h.
#include <gtest/gtest.h>

#include <chrono>
#include <memory>
#include <vector>

#include "berth/can/bus_error.hpp"
#include "berth/sim/world.hpp"

namespace error_tap_tests {
namespace {

using namespace berth;
using namespace std::chrono_literals;
using can::ErrorKind;
using can::ErrorPlace;
using can::Frame;

struct Errors final : can::Tap {
  void frame(const Frame&, rt::Time, int) noexcept override { ++good; }
  void error(const can::BusError& error, rt::Time when) noexcept override {
    errors.push_back(error);
    at.push_back(when);
  }
  std::vector<can::BusError> errors;
  std::vector<rt::Time> at;
  unsigned good = 0;
};

struct Deaf final : can::Listener {
  void received(const Frame&, rt::Time) noexcept override {}
  void sent(std::uint32_t, rt::Time) noexcept override {}
  void changed(const can::Status&, rt::Time) noexcept override {}
};

/// At 1 Mbit/s: a bit is a microsecond. Three nodes; the first sends.
class ErrorTap : public ::testing::Test {
 protected:
  ErrorTap() { bus_.add_tap(tap_); }
  ~ErrorTap() override { bus_.remove_tap(tap_); }
  sim::World world_;
  sim::Bus& bus_ = world_.add_bus("bus", 1'000'000);
  std::unique_ptr<sim::Controller> a_ = bus_.attach({}), b_ = bus_.attach({}), c_ = bus_.attach({});
  Errors tap_;
};

// Without a stuff bit up to the CRC: start 0, identifier 1 to 11, RTR 12, IDE 13, r0 14, DLC 15 to 18, data from 19 on,
// which is dominant, recessive, and so on.
const Frame plain = Frame::base(0x555, {0x55, 0x55, 0x55, 0x55, 0x55, 0x55, 0x55, 0x55});

}  // namespace

TEST_F(ErrorTap, ASenderThatSeesAnotherBitSignalsInTheNext) {
  bus_.inject({.where = sim::from_start(20), .victims = {a_.get()}});
  a_->send(plain, 0);
  world_.run_for(5ms);
  ASSERT_EQ(tap_.errors.size(), 1U);
  const auto& error = tap_.errors.front();
  EXPECT_EQ(error.sender, a_->number());
  EXPECT_EQ(error.first, a_->number());
  EXPECT_EQ(error.frame, plain);
  EXPECT_TRUE(can::is_bus_error(error.report.id, error.report.data[2]));
  // It sent a recessive bit and saw a dominant one.
  EXPECT_EQ(error.report.data[2], 0x10U | can::error_while_sending);
  EXPECT_EQ(error.report.data[3], static_cast<unsigned>(ErrorPlace::data));
  EXPECT_EQ(error.report.data[6], 8U);  // rule 3
  EXPECT_EQ(error.report.data[7], 0U);
  EXPECT_EQ(tap_.at.front(), rt::Time(21us));
  EXPECT_EQ(tap_.good, 1U) << "it was repeated";
  EXPECT_EQ(bus_.statistics().error_frames, 1U);
}

// Bit 20 dominant: with DLC's last three and bit 19 five dominant bits, so that 21 should be a stuff bit, and is data.
TEST_F(ErrorTap, AReceiverThatSeesAStuffErrorIsTheFirst) {
  bus_.inject({.where = sim::from_start(20), .victims = {b_.get()}});
  a_->send(plain, 0);
  world_.run_for(5ms);
  ASSERT_EQ(tap_.errors.size(), 1U);
  const auto& error = tap_.errors.front();
  EXPECT_EQ(error.sender, a_->number());
  EXPECT_EQ(error.first, b_->number());
  EXPECT_EQ(error.beside_first, 0U);
  EXPECT_EQ(error.report.data[2], static_cast<unsigned>(ErrorKind::stuff));
  EXPECT_EQ(error.report.data[3], static_cast<unsigned>(ErrorPlace::data));
  EXPECT_EQ(error.report.data[7], 1U);  // rule 1
  EXPECT_EQ(tap_.at.front(), rt::Time(22us));
}

// Bit 28 dominant: with 27 and 29 three dominant bits, no stuff bit is missing, and only the CRC is wrong.
TEST_F(ErrorTap, AWrongCrcIsSignalledBehindTheAckDelimiter) {
  bus_.inject({.where = sim::from_start(28), .victims = {b_.get(), c_.get()}});
  a_->send(plain, 0);
  world_.run_for(5ms);
  ASSERT_EQ(tap_.errors.size(), 1U) << "unacknowledged, for both saw it wrong";
  EXPECT_EQ(tap_.errors.front().first, a_->number());
  EXPECT_NE(tap_.errors.front().report.id & can::error_acknowledge, 0U);
  EXPECT_EQ(tap_.errors.front().report.data[3], static_cast<unsigned>(ErrorPlace::acknowledge));
  tap_.errors.clear();
  bus_.inject({.where = sim::from_start(28), .victims = {b_.get()}});
  a_->send(plain, 0);
  world_.run_for(5ms);
  ASSERT_EQ(tap_.errors.size(), 1U);
  const auto& error = tap_.errors.front();
  EXPECT_EQ(error.first, b_->number());
  EXPECT_EQ(error.report.id & can::error_acknowledge, 0U) << "the third node acknowledged";
  EXPECT_EQ(error.report.data[2], 0U);
  EXPECT_EQ(error.report.data[3], static_cast<unsigned>(ErrorPlace::crc));
}

TEST_F(ErrorTap, EachFieldHasItsPlace) {
  const auto place_at = [this](const Frame& frame, sim::BitPosition where) {
    tap_.errors.clear();
    bus_.inject({.where = where, .victims = {a_.get()}});
    a_->send(frame, 0);
    world_.run_for(5ms);
    return tap_.errors.empty() ? 0U : static_cast<unsigned>(tap_.errors.front().report.data[3]);
  };
  // In arbitration a recessive bit that is seen dominant only loses: dominant ones are flipped there.
  EXPECT_EQ(place_at(plain, sim::from_start(2)), 0x02U);
  EXPECT_EQ(place_at(plain, sim::from_start(10)), 0x06U);
  EXPECT_EQ(place_at(plain, sim::from_start(12)), 0x04U);
  EXPECT_EQ(place_at(plain, sim::from_start(13)), 0x05U);
  EXPECT_EQ(place_at(plain, sim::from_start(14)), 0x09U);
  EXPECT_EQ(place_at(plain, sim::from_start(15)), 0x0BU);
  EXPECT_EQ(place_at(plain, sim::from_start(82)), 0x0AU);
  EXPECT_EQ(place_at(plain, sim::from_start(83)), 0x08U);
  EXPECT_EQ(place_at(plain, sim::from_end(9)), 0x18U);
  EXPECT_EQ(place_at(plain, sim::from_end(8)), 0x19U);
  EXPECT_EQ(place_at(plain, sim::from_end(7)), 0x1BU);
  EXPECT_EQ(place_at(plain, sim::from_end(3)), 0x1AU);
  // Extended: SRR 12, IDE 13, the other 18 bits 14 to 31, RTR 32, r1 33, r0 34, DLC 35 to 38.
  const Frame extended = Frame::ext(0x15555555, {0x55});
  EXPECT_EQ(place_at(extended, sim::from_start(16)), 0x07U);
  EXPECT_EQ(place_at(extended, sim::from_start(22)), 0x0FU);
  EXPECT_EQ(place_at(extended, sim::from_start(30)), 0x0EU);
  EXPECT_EQ(place_at(extended, sim::from_start(32)), 0x0CU);
  EXPECT_EQ(place_at(extended, sim::from_start(33)), 0x0DU);
}

TEST_F(ErrorTap, ANodeThatIsAloneTellsEachAttempt) {
  b_.reset();
  c_.reset();
  a_->send(plain, 0);
  world_.run_for(20ms);
  ASSERT_GT(tap_.errors.size(), 20U);
  EXPECT_EQ(tap_.errors.size(), bus_.statistics().error_frames);
  for (const auto& error : tap_.errors) {
    EXPECT_EQ(error.sender, a_->number());
    EXPECT_EQ(error.frame, plain);
    EXPECT_NE(error.report.id & can::error_acknowledge, 0U);
    EXPECT_EQ(error.report.data[3], static_cast<unsigned>(ErrorPlace::acknowledge));
  }
  EXPECT_EQ(tap_.errors.back().report.data[6], 128U) << "passive: rule 3, exception 1";
}

TEST(BusErrors, OnlyErrorsOnTheBusAreSome) {
  EXPECT_TRUE(can::is_bus_error(0x088, 0x04));
  EXPECT_TRUE(can::is_bus_error(0x020, 0));
  EXPECT_FALSE(can::is_bus_error(0x008, can::error_overload));
  EXPECT_FALSE(can::is_bus_error(0x004, 0)) << "a controller's state";
  EXPECT_FALSE(can::is_bus_error(0x040, 0)) << "bus-off";
}

}  // namespace error_tap_tests
