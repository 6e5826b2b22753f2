// Paper 5 §2, Figure 4: an optional slave that does not answer is asked until it is found, or until the application
// stops polling (S5.16).
#include <gtest/gtest.h>

#include <map>
#include <string>

#include "tests/harness/rig.hpp"

using namespace berth;
using namespace berth::harness;
using places::SlotState;

namespace polling_tests {
namespace {

/// SDO requests and guarding requests to each node-ID.
struct Asked final : can::Tap {
  void frame(const can::Frame& frame, rt::Time, int) noexcept override {
    if (frame.extended) return;
    const bool sdo = frame.id > 0x600 && frame.id < 0x680;
    const bool guard = frame.remote && frame.id > 0x700 && frame.id < 0x780;
    if (sdo || guard) ++times[frame.id & 0x7FU];
  }
  std::map<unsigned, unsigned> times;
};

constexpr unsigned fixed = 9, by_lss = 8, mandatory = 7;

class Polling : public testing::Test {
 protected:
  Polling() {
    add_slot(machine_, 5, type_a);
    add_slot(machine_, mandatory, type_b);
    add_slot(machine_, by_lss, type_c);
    add_slot(machine_, fixed, type_b);
    for (const unsigned at : {2U, 3U}) machine_.slots[at].spec.optional = true;
    machine_.slots[3].spec.assign = places::Assign::fixed;
    add_device(plant_, "a", type_a, 1);
    add_device(plant_, "c", type_c, 2);
    auto& switches = add_device(plant_, "switches", type_b, 3);
    switches.plugged = false;
    switches.node_id = NodeId(fixed);
    switches.source = plant::NodeIdSource::switches;
    switches.speaks = {};
  }
  void begin() {
    rig_.emplace(machine_, plant_);
    rig_->world().bus("backbone")->add_tap(asked_);
    rig_->begin();
    ASSERT_TRUE(rig_->run_until([&] { return rig_->state(5) == SlotState::operational; }, 2min)) << rig_->log();
    ASSERT_TRUE(rig_->run_until([&] { return rig_->state(by_lss) == SlotState::operational; }, 2min)) << rig_->log();
    rig_->device("c").unplug();
    ASSERT_TRUE(rig_->run_until([&] { return rig_->state(by_lss) == SlotState::absent; }, 2min)) << rig_->log();
  }
  unsigned asked_within(unsigned id, rt::Duration time) {
    asked_.times.clear();
    rig_->run_for(time);
    return asked_.times[id];
  }
  Result<void> poll(unsigned id, bool on) { return operate::poll_slot(rig_->network(), "s" + std::to_string(id), on); }

  design::Machine machine_ = one_bus(125'000);
  plant::PlantFile plant_ = one_bus_plant(3);
  Asked asked_;
  std::optional<Rig> rig_;
};

}  // namespace

TEST_F(Polling, S5_16_AnOptionalSlotIsAskedUntilTheApplicationStopsIt) {
  begin();
  EXPECT_GT(asked_within(fixed, 20min), 0U);
  EXPECT_GT(asked_within(by_lss, 20min), 0U);
  ASSERT_TRUE(poll(fixed, false));
  ASSERT_TRUE(poll(by_lss, false));
  rig_->run_for(10s);  // what is under way ends
  asked_.times.clear();
  rig_->run_for(60min);
  EXPECT_EQ(asked_.times[fixed], 0U) << rig_->log();
  EXPECT_EQ(asked_.times[by_lss], 0U) << rig_->log();
  EXPECT_GT(asked_.times[mandatory], 0U) << "that is wanted";

  // A device that boots is found all the same, and then watched as ever.
  rig_->device("switches").plug();
  EXPECT_TRUE(rig_->run_until([&] { return rig_->state(fixed) == SlotState::operational; }, 1min)) << rig_->log();
  rig_->device("c").plug();
  EXPECT_TRUE(rig_->run_until([&] { return rig_->state(by_lss) == SlotState::operational; }, 1min)) << rig_->log();
  rig_->device("switches").unplug();
  ASSERT_TRUE(rig_->run_until([&] { return rig_->state(fixed) == SlotState::absent; }, 1min));
  EXPECT_GT(asked_within(fixed, 20min), 0U) << "polled again";
}

TEST_F(Polling, OnceMoreItIsAskedFor) {
  begin();
  ASSERT_TRUE(poll(fixed, false));
  rig_->run_for(10min);
  EXPECT_EQ(asked_within(fixed, 10min), 0U);
  ASSERT_TRUE(poll(fixed, true));
  EXPECT_GT(asked_within(fixed, 30s), 0U) << "at once";
}

TEST_F(Polling, WhatCannotBeStoppedIsRefused) {
  begin();
  const auto wanted = poll(mandatory, false);
  ASSERT_FALSE(wanted);
  EXPECT_EQ(wanted.error().code, Errc::invalid);
  const auto none = poll(77, false);
  ASSERT_FALSE(none);
  EXPECT_EQ(none.error().code, Errc::not_found);
  rig_->device("c").plug();
  ASSERT_TRUE(rig_->run_until([&] { return rig_->state(by_lss) == SlotState::operational; }, 1min));
  const auto there = poll(by_lss, false);
  ASSERT_FALSE(there);
  EXPECT_EQ(there.error().code, Errc::invalid);
}

}  // namespace polling_tests
