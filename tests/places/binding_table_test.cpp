// The binding's table row by row, as the manual in binding.hpp has it. S1.29, S1.33, S1.53.
#include <gtest/gtest.h>
#include <optional>
#include <string>
#include <vector>

#include "../pch.hpp"
#include "berth/places/binder.hpp"
#include "berth/places/binding.hpp"

namespace berth::places {
namespace {

constexpr Assignment seat{{1, 2, 3, 4}, NodeId(5)};

// The steps that are walked when every one ends well, for a device that had the node-ID `had`.
std::vector<Step> walked(Binding::Kind kind, NodeId had) {
  Binding binding(kind, kind == Binding::Kind::bind ? seat : Assignment{seat.device, NodeId()});
  std::vector<Step> steps{binding.step()};
  while (!binding.ended() && steps.size() < 20) {
    if (binding.step() == Step::inquire) binding.inquired(had);
    binding.advance(Outcome::ok);
    steps.push_back(binding.step());
  }
  return steps;
}

// Written as done only when it was heard under its node-ID, and asked who it is.
TEST(BindingTable, S1_53_ABlankDeviceStepByStep) {
  const std::vector<Step> expected{Step::check_vacant, Step::select,        Step::inquire, Step::write_ask,
                                   Step::configure,    Step::store,         Step::release, Step::await_boot_up,
                                   Step::identify,     Step::write_confirm, Step::done};
  EXPECT_EQ(walked(Binding::Kind::bind, NodeId()), expected);
}

TEST(BindingTable, S1_33_ADeviceWithAnotherNodeIdIsReset) {
  const std::vector<Step> expected{Step::check_vacant,  Step::select,   Step::inquire,       Step::write_ask,
                                   Step::configure,     Step::store,    Step::release,       Step::reset,
                                   Step::await_boot_up, Step::identify, Step::write_confirm, Step::done};
  EXPECT_EQ(walked(Binding::Kind::bind, NodeId(77)), expected);
}

TEST(BindingTable, S1_53_ADeviceThatHasItsNodeIdIsAskedAllTheSame) {
  const std::vector<Step> expected{Step::check_vacant,  Step::select, Step::inquire, Step::write_ask,
                                   Step::configure,     Step::store,  Step::release, Step::identify,
                                   Step::write_confirm, Step::done};
  EXPECT_EQ(walked(Binding::Kind::bind, seat.id), expected);
}

TEST(BindingTable, S1_53_ANodeIdIsTakenAwayByTheSameTable) {
  const std::vector<Step> expected{Step::write_ask, Step::select, Step::inquire,  Step::configure,     Step::store,
                                   Step::release,   Step::reset,  Step::identify, Step::write_confirm, Step::done};
  EXPECT_EQ(walked(Binding::Kind::blank, NodeId(77)), expected);
}

// A device that a search put together of two is not there: nothing is kept for it.
TEST(BindingTable, S1_53_NothingIsWrittenOfADeviceThatWasNotMet) {
  Binding binding(Binding::Kind::bind, seat, 2);
  while (!binding.ended()) {
    EXPECT_NE(binding.step(), Step::write_ask);
    binding.advance(binding.step() == Step::select ? Outcome::silent : Outcome::ok);
  }
  EXPECT_EQ(binding.why(), Why::not_there);
}

// The device is in LSS configuration then.
TEST(BindingTable, S1_53_AnIntentionThatCannotBeWrittenLeavesTheDeviceInWaiting) {
  Binding binding(Binding::Kind::bind, seat);
  while (binding.step() != Step::write_ask) binding.advance(Outcome::ok);
  binding.advance(Outcome::error);
  EXPECT_EQ(binding.step(), Step::release);
  binding.advance(Outcome::ok);
  EXPECT_EQ(binding.step(), Step::failed);
  EXPECT_EQ(binding.why(), Why::store_failed);
}

// The store has the device in another slot of this bus: that is no failure to write, and is not called one.
TEST(BindingTable, ARefusedIntentionLeavesTheDeviceInWaitingToo) {
  Binding binding(Binding::Kind::bind, seat);
  while (binding.step() != Step::write_ask) binding.advance(Outcome::ok);
  binding.advance(Outcome::refused);
  EXPECT_EQ(binding.step(), Step::release);
  binding.advance(Outcome::ok);
  EXPECT_EQ(binding.step(), Step::failed);
  EXPECT_EQ(binding.why(), Why::seated_twice);
  EXPECT_TRUE(binding.untouched());
}

// What the store said is told once, in its own words; what it has nothing to do with is told as ever.
TEST(BindingTable, AFailureOfTheStoreIsToldInItsWords) {
  std::optional<Error> said;
  EXPECT_EQ(outcome_of(Result<void>(), said), Outcome::ok);
  EXPECT_FALSE(said);
  const Error full{.code = Errc::io, .detail = 13, .text = "/m.db: writing an intention: the disk is full"};
  EXPECT_EQ(outcome_of(Result<void>(fail(full)), said), Outcome::error);
  EXPECT_EQ(words_of(Why::store_failed, said),
            "the slot table cannot be written: io (0000000Dh): /m.db: writing an intention: the disk is full");
  EXPECT_EQ(words_of(Why::occupied, said), name(Why::occupied));
  EXPECT_EQ(outcome_of(Result<void>(fail(sits_in({"m", "b", "s2"}))), said), Outcome::refused);
  const std::string refused = words_of(Why::seated_twice, said);
  EXPECT_NE(refused.find("slot s2 of bus b"), std::string::npos) << refused;
  EXPECT_EQ(refused.find("written:"), std::string::npos) << refused;
}

// As far as `step`, all well. False: it is not on the way.
bool walk_to(Binding& binding, Step step) {
  for (int i = 0; i < 20 && binding.step() != step; ++i) binding.advance(Outcome::ok);
  return binding.step() == step;
}

// It boots under its old node-ID: it has obeyed the reset, and is not told to store again. Reset node is tried; then it
// waits for its power cycle, when LSS tells that it is this device which stays there.
TEST(BindingTable, ADeviceThatStaysWaitsForItsPowerCycle) {
  for (const bool another : {false, true}) {
    Binding binding(Binding::Kind::bind, seat);
    binding.inquired(NodeId(77));
    ASSERT_TRUE(walk_to(binding, Step::reset));
    EXPECT_FALSE(binding.staying().once);
    binding.advance(Outcome::ok);
    ASSERT_EQ(binding.step(), Step::await_boot_up);
    binding.advance(Outcome::mismatch);
    ASSERT_EQ(binding.step(), Step::reset);
    EXPECT_TRUE(binding.staying().once);
    binding.advance(Outcome::ok);
    binding.advance(Outcome::mismatch);
    ASSERT_EQ(binding.step(), Step::select);
    binding.advance(Outcome::ok);
    ASSERT_EQ(binding.step(), Step::inquire);
    binding.inquired(another ? seat.id : NodeId(77));
    binding.advance(Outcome::ok);
    ASSERT_EQ(binding.step(), Step::release);
    binding.advance(Outcome::ok);
    EXPECT_EQ(binding.step(), another ? Step::identify : Step::power_cycle) << "another booted under 77";
  }
}

// A blank one that does not boot soon is asked by LSS: twice as it was, it waits for its power cycle; silent, it boots.
TEST(BindingTable, ABlankDeviceThatDoesNotBootIsAskedWhetherItStays) {
  for (const bool answers : {false, true}) {
    Binding binding(Binding::Kind::bind, seat);
    ASSERT_TRUE(walk_to(binding, Step::await_boot_up));
    EXPECT_FALSE(binding.staying().boots);
    binding.advance(Outcome::mismatch);
    ASSERT_EQ(binding.step(), Step::select);
    if (!answers) {
      binding.advance(Outcome::silent);
      ASSERT_EQ(binding.step(), Step::await_boot_up);
      EXPECT_TRUE(binding.staying().boots);
      continue;
    }
    binding.advance(Outcome::ok);
    binding.advance(Outcome::ok);
    ASSERT_EQ(binding.step(), Step::release);
    binding.advance(Outcome::ok);
    ASSERT_EQ(binding.step(), Step::await_boot_up) << "this `04 00` may be the first that it hears";
    const auto as_it_was = [&] {
      binding.advance(Outcome::mismatch);
      binding.advance(Outcome::ok);
      binding.advance(Outcome::ok);
      binding.advance(Outcome::ok);
    };
    as_it_was();
    ASSERT_EQ(binding.step(), Step::select) << "it is told anew";
    ASSERT_TRUE(walk_to(binding, Step::await_boot_up));
    as_it_was();
    ASSERT_EQ(binding.step(), Step::await_boot_up);
    as_it_was();
    EXPECT_EQ(binding.step(), Step::power_cycle);
  }
}

// Some tell the pending node-ID by 5Eh. One that LSS hears and that is silent under it does not use it.
TEST(BindingTable, ABlankDeviceThatTellsItsPendingNodeIdWaitsForItsPowerCycleToo) {
  Binding binding(Binding::Kind::bind, seat);
  ASSERT_TRUE(walk_to(binding, Step::await_boot_up));
  binding.advance(Outcome::mismatch);
  binding.advance(Outcome::ok);
  binding.inquired(seat.id);
  binding.advance(Outcome::ok);
  binding.advance(Outcome::ok);
  ASSERT_EQ(binding.step(), Step::identify);
  binding.advance(Outcome::silent);
  EXPECT_EQ(binding.step(), Step::power_cycle);
}

// It answers no more: it may have booted under its new node-ID after all.
TEST(BindingTable, ADeviceThatSeemedToStayIsAskedUnderItsNewNodeId) {
  Binding binding(Binding::Kind::bind, seat);
  binding.inquired(NodeId(77));
  ASSERT_TRUE(walk_to(binding, Step::await_boot_up));
  binding.advance(Outcome::mismatch);
  binding.advance(Outcome::ok);
  binding.advance(Outcome::mismatch);
  ASSERT_EQ(binding.step(), Step::select);
  binding.advance(Outcome::silent);
  EXPECT_EQ(binding.step(), Step::identify);
}

// Without a memory there is nothing that a power cycle could bring into use.
TEST(BindingTable, ADeviceWithoutMemoryThatStaysIsAskedUnderItsNewNodeId) {
  Binding binding(Binding::Kind::bind, seat);
  binding.inquired(NodeId(77));
  ASSERT_TRUE(walk_to(binding, Step::store));
  binding.advance(Outcome::unsupported);
  ASSERT_TRUE(walk_to(binding, Step::await_boot_up));
  binding.advance(Outcome::mismatch);
  EXPECT_EQ(binding.step(), Step::identify);
}

// Another device answers under the new node-ID: this one may have missed `04 00` and would take it at the next.
TEST(BindingTable, S1_53_WhatAnotherAnswersUnderIsTakenBack) {
  Binding binding(Binding::Kind::bind, seat);
  ASSERT_TRUE(walk_to(binding, Step::identify));
  binding.advance(Outcome::mismatch);
  EXPECT_EQ(binding.step(), Step::revert);
  binding.advance(Outcome::silent);
  binding.advance(Outcome::ok);
  EXPECT_EQ(binding.step(), Step::failed);
  EXPECT_EQ(binding.why(), Why::other_device);
}

// Two devices took the `11h`, or the `17h`: both lose the node-ID, and the one does not get the other's old one.
TEST(BindingTable, S1_53_WhatTwoWereToldIsTakenBackFromBoth) {
  for (const auto step : {Step::configure, Step::store}) {
    Binding binding(Binding::Kind::bind, seat);
    ASSERT_TRUE(walk_to(binding, Step::configure));
    binding.inquired(NodeId(77));
    EXPECT_EQ(binding.revert_to(), NodeId(77));
    ASSERT_TRUE(walk_to(binding, step));
    binding.advance(Outcome::several);
    EXPECT_EQ(binding.step(), Step::revert);
    EXPECT_TRUE(binding.shared());
    EXPECT_FALSE(binding.revert_to().configured());
    ASSERT_TRUE(walk_to(binding, Step::store));
    EXPECT_FALSE(binding.shared()) << "the next `11h` was taken by one";
  }
}

// It may have been in configuration when another's binding took back what two had been told: it is told anew.
TEST(BindingTable, S1_53_WhoMayHaveLostItsNodeIdWithAnotherIsToldAnew) {
  Binding binding(Binding::Kind::bind, seat);
  ASSERT_TRUE(walk_to(binding, Step::identify));
  binding.advance(Outcome::taken_back);
  EXPECT_EQ(binding.step(), Step::select);
  ASSERT_TRUE(walk_to(binding, Step::store));
  ASSERT_TRUE(walk_to(binding, Step::done));
}

// No way but `identify` leads to `write_confirm`, whatever the boot-up's wait ended with.
TEST(BindingTable, S1_53_NothingIsConfirmedUnheard) {
  for (const auto outcome : {Outcome::ok, Outcome::silent, Outcome::mismatch}) {
    Binding binding(Binding::Kind::bind, seat);
    ASSERT_TRUE(walk_to(binding, Step::await_boot_up));
    binding.advance(outcome);
    EXPECT_EQ(binding.step(), outcome == Outcome::mismatch ? Step::select : Step::identify);
  }
  for (const auto outcome : {Outcome::silent, Outcome::mismatch, Outcome::several, Outcome::taken_back}) {
    Binding binding(Binding::Kind::bind, seat);
    ASSERT_TRUE(walk_to(binding, Step::identify));
    binding.advance(outcome);
    EXPECT_NE(binding.step(), Step::write_confirm);
  }
}

}  // namespace
}  // namespace berth::places
