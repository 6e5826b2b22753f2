// The LSS slave alone: frames in, frames out. Expected bytes are written by hand from CiA 305 (docs/protocols/cia305.md
// §Frames).
#include <gtest/gtest.h>
#include <rapidcheck/gtest.h>
#include <chrono>
#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "berth/lss/slave.hpp"

#include "berth/base/random.hpp"

namespace berth::lss::slave_tests {
namespace {

using std::chrono::milliseconds;

constexpr LssAddress address{0x0100'0001, 0x0000'0001, 0x0002'0003, 0xDEAD'BEEF};

struct Owner final : SlaveOwner {
  std::optional<StoreResult> store(const Settings& settings) noexcept override {
    stored = settings;
    ++stores;
    return result;
  }
  void wants_reset_communication() noexcept override { ++resets; }
  void switch_bit_rate(BitRateIndex index) noexcept override { switched.push_back(index); }
  void silence_over() noexcept override { ++silence_ends; }
  std::optional<StoreResult> result = StoreResult{};
  Settings stored{};
  unsigned stores = 0;
  unsigned resets = 0;
  unsigned silence_ends = 0;
  std::vector<BitRateIndex> switched;
};

struct LssSlave : ::testing::Test {
  explicit LssSlave(Settings persistent = {}) : slave(executor, owner, options(), persistent) {
    slave.reset_communication();
  }
  static SlaveOptions options() { return {.address = address}; }
  /// Sends a request written as candump text; the answer as text, "" for none.
  std::string ask(const std::string& frame) {
    const auto answer = slave.handle(*can::parse_frame("7E5#" + frame));
    return answer ? can::to_string(*answer) : "";
  }
  void select() { ASSERT_EQ(ask("0401000000000000"), ""); }
  rt::Executor executor;
  Owner owner;
  Slave slave;
};

struct LssSlaveConfigured : LssSlave {
  LssSlaveConfigured() : LssSlave(Settings{NodeId(5), BitRateIndex::kbit_250}) {}
};

TEST_F(LssSlave, StartsWaitingUnconfiguredAndInitialising) {
  EXPECT_EQ(slave.state(), State::waiting);
  EXPECT_TRUE(slave.unconfigured());
  EXPECT_TRUE(slave.initialising());
}

TEST_F(LssSlave, SelectiveInOrderAnswers44AndEntersConfiguration) {
  EXPECT_EQ(ask("4001000001000000"), "");
  EXPECT_EQ(ask("4101000000000000"), "");
  EXPECT_EQ(ask("4203000200000000"), "");
  EXPECT_EQ(slave.state(), State::waiting);
  EXPECT_EQ(ask("43EFBEADDE000000"), "7E4#4400000000000000");
  EXPECT_EQ(slave.state(), State::configuration);
}

// HC3.4: 40h-43h sequence interrupted; wrong order; serial in the last frame.
TEST_F(LssSlave, SelectiveWrongOrderOrInterruptedIsNoSelection) {
  const std::string v = "4001000001000000", p = "4101000000000000", r = "4203000200000000", s = "43EFBEADDE000000";
  const std::vector<std::vector<std::string>> bad{
      {p, r, s},                         // vendor missing
      {v, r, s},                         // product missing
      {v, r, p, s},                      // swapped
      {v, p, p, r, s},                   // one twice
      {v, p, "4C00000000000000", r, s},  // another service between
      {v, p, "0400000000000000", r, s},
      {v, "4102000000000000", p, r, s},  // a mismatch resets, also when the right one follows
      {v, p, r, "43EFBEADDF000000"},     // another serial number
      {v, p, r, "43EFBEADDF000000", s},
  };
  for (const auto& sequence : bad) {
    for (const auto& frame : sequence) {
      const auto answer = ask(frame);
      EXPECT_NE(answer.substr(0, 6), "7E4#44") << frame;
    }
    EXPECT_EQ(slave.state(), State::waiting);
  }
  // A new vendor frame starts anew at any time.
  for (const auto& frame : {v, p, v, p, r}) EXPECT_EQ(ask(frame), "");
  EXPECT_EQ(ask(s), "7E4#4400000000000000");
}

TEST_F(LssSlave, SelectingAnotherLeavesThisOneInConfiguration) {
  select();
  for (const auto* frame : {"4001000001000000", "4101000000000000", "4203000200000000", "4300000000000000"}) ask(frame);
  EXPECT_EQ(slave.state(), State::configuration);
}

// docs/protocols/cia305.md §Frames: receivers accept DLC 8 only; remote, extended and other identifiers are not
// LSS.
TEST_F(LssSlave, AnswersOnlyBaseDataFramesOfEightBytes) {
  for (const auto* text :
       {"7E5#4C", "7E5#4C000000000000", "7E5#R8", "7E4#4C00000000000000", "000007E5#4C00000000000000"}) {
    EXPECT_FALSE(slave.handle(*can::parse_frame(text)).has_value()) << text;
  }
  EXPECT_EQ(ask("4C00000000000000"), "7E4#5000000000000000");
}

TEST_F(LssSlave, ConfigurationServicesAreDeafInWaiting) {
  for (const auto* frame :
       {"1105000000000000", "1300020000000000", "15E8030000000000", "1700000000000000", "5A00000000000000",
        "5B00000000000000", "5C00000000000000", "5D00000000000000", "5E00000000000000"}) {
    EXPECT_EQ(ask(frame), "") << frame;
  }
  EXPECT_EQ(owner.stores, 0U);
  EXPECT_TRUE(slave.unconfigured());
}

// HC3.7: configure node-ID 255 legal, result codes.
TEST_F(LssSlave, ConfigureNodeIdTakes1To127And255Only) {
  select();
  for (unsigned id = 0; id < 256; ++id) {
    char frame[20];
    std::snprintf(frame, sizeof frame, "11%02X000000000000", id);
    const bool good = (id >= 1 && id <= 127) || id == 255;
    const auto before = slave.pending().node_id;
    EXPECT_EQ(ask(frame), good ? "7E4#1100000000000000" : "7E4#1101000000000000") << id;
    EXPECT_EQ(slave.pending().node_id.value(), good ? id : before.value());
    EXPECT_FALSE(slave.active().node_id.configured());
  }
}

// HC3.8: bit timing table 0, index 5 is reserved.
TEST_F(LssSlave, BitTimingTakesTheTableWithoutTheReservedIndex) {
  select();
  for (unsigned index = 0; index < 256; ++index) {
    char frame[20];
    std::snprintf(frame, sizeof frame, "1300%02X0000000000", index);
    const bool good = index <= 8 && index != 5;
    EXPECT_EQ(ask(frame), good ? "7E4#1300000000000000" : "7E4#1301000000000000") << index;
  }
  EXPECT_EQ(ask("1380020000000000"), "7E4#1301000000000000");  // a manufacturer's table
  EXPECT_EQ(slave.pending().bit_rate, BitRateIndex::kbit_10);
  EXPECT_EQ(slave.active().bit_rate, BitRateIndex::kbit_125);
}

// HC3.7: store not supported is 1.
TEST(LssSlaveOptions, SupportedBitRatesAreAMask) {
  rt::Executor executor;
  Owner owner;
  Slave slave(executor, owner, {.address = address, .bit_rates = 0x0234, .can_store = false}, {});
  slave.reset_communication();
  const auto ask = [&](const char* text) { return can::to_string(*slave.handle(*can::parse_frame(text))); };
  EXPECT_FALSE(slave.handle(*can::parse_frame("7E5#0401000000000000")).has_value());
  EXPECT_EQ(ask("7E5#1300020000000000"), "7E4#1300000000000000");
  EXPECT_EQ(ask("7E5#1300090000000000"), "7E4#1300000000000000");  // automatic, in the mask
  EXPECT_EQ(ask("7E5#1300000000000000"), "7E4#1301000000000000");
  EXPECT_EQ(ask("7E5#1300050000000000"), "7E4#1301000000000000");  // reserved though the mask has its bit
  EXPECT_EQ(ask("7E5#1700000000000000"), "7E4#1701000000000000");  // store not supported
  EXPECT_EQ(owner.stores, 0U);
}

TEST_F(LssSlave, InquiresAnswerTheIdentityLittleEndian) {
  select();
  EXPECT_EQ(ask("5A00000000000000"), "7E4#5A01000001000000");
  EXPECT_EQ(ask("5B00000000000000"), "7E4#5B01000000000000");
  EXPECT_EQ(ask("5C00000000000000"), "7E4#5C03000200000000");
  EXPECT_EQ(ask("5D00000000000000"), "7E4#5DEFBEADDE000000");
  EXPECT_EQ(ask("5E00000000000000"), "7E4#5EFF000000000000");
  ask("1107000000000000");
  EXPECT_EQ(ask("5E00000000000000"), "7E4#5E07000000000000");  // initialising: the pending one
}

TEST_F(LssSlaveConfigured, InquireNodeIdAnswersTheActiveOne) {
  select();
  EXPECT_EQ(ask("1107000000000000"), "7E4#1100000000000000");
  EXPECT_EQ(ask("5E00000000000000"), "7E4#5E05000000000000");
}

// HC3.7: store code 1 = not supported; docs/protocols/cia305.md §Frames: 2 = medium, 255 = specific.
TEST_F(LssSlave, StoreAnswersWhatTheOwnerSays) {
  select();
  ask("1107000000000000");
  EXPECT_EQ(ask("1700000000000000"), "7E4#1700000000000000");
  EXPECT_EQ(owner.stored.node_id, NodeId(7));
  EXPECT_EQ(slave.persistent().node_id, NodeId(7));
  ask("1108000000000000");
  owner.result = StoreResult{.code = error::storage, .specific = 9};
  EXPECT_EQ(ask("1700000000000000"), "7E4#1702000000000000");
  owner.result = StoreResult{.code = error::specific, .specific = 0x42};
  EXPECT_EQ(ask("1700000000000000"), "7E4#17FF420000000000");
  EXPECT_EQ(slave.persistent().node_id, NodeId(7)) << "a failed store changes nothing";
}

TEST_F(LssSlave, StoreMayTakeTimeAndIsAnsweredOnce) {
  select();
  ask("1107000000000000");
  owner.result = std::nullopt;
  EXPECT_EQ(ask("1700000000000000"), "");
  EXPECT_TRUE(slave.storing());
  EXPECT_EQ(ask("1700000000000000"), "");
  EXPECT_EQ(owner.stores, 1U);
  ask("1109000000000000");  // changed while the write runs: what was written counts
  EXPECT_EQ(can::to_string(*slave.stored({})), "7E4#1700000000000000");
  EXPECT_EQ(slave.persistent().node_id, NodeId(7));
  EXPECT_EQ(slave.pending().node_id, NodeId(9));
  EXPECT_FALSE(slave.stored({}).has_value());
}

TEST_F(LssSlave, StoreThatEndsInWaitingIsNotAnswered) {
  select();
  ask("1107000000000000");
  owner.result = std::nullopt;
  ask("1700000000000000");
  ask("0400000000000000");
  EXPECT_FALSE(slave.stored({}).has_value());
  EXPECT_EQ(slave.persistent().node_id, NodeId(7));
}

// HC3.9: 04 00 after 11h: a node that was unconfigured starts with the new id without a store (HU.5).
TEST_F(LssSlave, LeavesInitialisingWithThePendingId) {
  select();
  ask("0400000000000000");
  EXPECT_EQ(owner.resets, 0U) << "nothing pending: stays";
  select();
  ask("1107000000000000");
  EXPECT_TRUE(slave.initialising());
  EXPECT_EQ(ask("0400000000000000"), "");
  EXPECT_EQ(owner.resets, 1U);
  slave.reset_communication();
  EXPECT_EQ(slave.active().node_id, NodeId(7));
  EXPECT_FALSE(slave.persistent().node_id.configured());
  ask("0400000000000000");
  EXPECT_EQ(owner.resets, 1U) << "once";
}

// HC3.10, HU.4: pending, active and stored are three things.
TEST_F(LssSlaveConfigured, PendingBecomesActiveWithResetCommunicationOnly) {
  select();
  ask("1107000000000000");
  ask("0400000000000000");
  EXPECT_EQ(owner.resets, 0U);
  EXPECT_EQ(slave.active().node_id, NodeId(5));
  slave.reset_communication();
  EXPECT_EQ(slave.active().node_id, NodeId(7));
  EXPECT_EQ(slave.persistent().node_id, NodeId(5));
  slave.power_on(slave.persistent());  // reset node: what was not stored is gone
  EXPECT_EQ(slave.active().node_id, NodeId(5));
  EXPECT_EQ(slave.pending().node_id, NodeId(5));
}

TEST_F(LssSlaveConfigured, Pending255MakesItUnconfiguredAtResetCommunication) {
  select();
  EXPECT_EQ(ask("11FF000000000000"), "7E4#1100000000000000");
  EXPECT_EQ(ask("4C00000000000000"), "") << "active is still 5";
  ask("0400000000000000");
  EXPECT_EQ(owner.resets, 0U);
  slave.reset_communication();
  EXPECT_TRUE(slave.unconfigured());
  EXPECT_EQ(ask("4C00000000000000"), "7E4#5000000000000000");
}

// HC3.9: a configured device that restarts communication at 04 00 already, stored or not.
TEST(LssSlaveOptions, SomeConfiguredDevicesChangeAtWaiting) {
  rt::Executor executor;
  Owner owner;
  Slave slave(executor, owner, {.address = address, .change_at_waiting = true}, {NodeId(5), BitRateIndex::kbit_125});
  slave.reset_communication();
  for (const auto* text : {"7E5#0401000000000000", "7E5#0400000000000000"}) slave.handle(*can::parse_frame(text));
  EXPECT_EQ(owner.resets, 0U) << "nothing changed";
  for (const auto* text : {"7E5#0401000000000000", "7E5#1107000000000000", "7E5#0400000000000000"}) {
    slave.handle(*can::parse_frame(text));
  }
  EXPECT_EQ(owner.resets, 1U);
}

// HC3.5, HU.3: 46h-4Bh, each edge of the ranges, each interruption.
TEST_F(LssSlave, IdentifyRemoteNeedsAllSixInOrderAndWithinRanges) {
  const std::vector<std::string> exact{"4601000001000000", "4701000000000000", "4803000200000000",
                                       "4903000200000000", "4AEFBEADDE000000", "4BEFBEADDE000000"};
  const auto send = [&](const std::vector<std::string>& frames) {
    std::string last;
    for (const auto& frame : frames) last = ask(frame);
    return last;
  };
  EXPECT_EQ(send(exact), "7E4#4F00000000000000");
  auto wide = exact;
  wide[2] = "4800000000000000", wide[3] = "49FFFFFFFF000000", wide[4] = "4A00000000000000",
  wide[5] = "4BFFFFFFFF000000";
  EXPECT_EQ(send(wide), "7E4#4F00000000000000");
  // Each bound one off.
  const std::vector<std::pair<int, std::string>> off{{0, "4602000001000000"}, {1, "4702000000000000"},
                                                     {2, "4804000200000000"}, {3, "4902000200000000"},
                                                     {4, "4AF0BEADDE000000"}, {5, "4BEEBEADDE000000"}};
  for (const auto& [i, frame] : off) {
    auto wrong = exact;
    wrong[i] = frame;
    EXPECT_EQ(send(wrong), "") << frame;
  }
  for (unsigned i = 0; i < 6; ++i) {
    auto missing = exact;
    missing.erase(missing.begin() + i);
    EXPECT_EQ(send(missing), "") << i;
    auto broken = exact;
    broken.insert(broken.begin() + i, "0400000000000000");
    EXPECT_EQ(send(broken), i == 0 ? "7E4#4F00000000000000" : "") << i;
  }
  select();
  EXPECT_EQ(send(exact), "7E4#4F00000000000000") << "also in configuration";
}

// HC3.6: 4Ch answers from non-configured only: active AND pending 255.
TEST_F(LssSlave, NonConfiguredAnswersOnlyWithBothIdsFree) {
  EXPECT_EQ(ask("4C00000000000000"), "7E4#5000000000000000");
  select();
  EXPECT_EQ(ask("4C00000000000000"), "7E4#5000000000000000");
  ask("1107000000000000");
  EXPECT_EQ(ask("4C00000000000000"), "");
}

// HC3.8: activation 15h: delay, then as long again in silence.
TEST_F(LssSlaveConfigured, ActivateBitTimingSwitchesAfterTheDelayAndIsSilentForAnother) {
  select();
  ask("1300060000000000");
  EXPECT_EQ(ask("15E8030000000000"), "");  // 1000 ms
  executor.advance(rt::Time(milliseconds(999)));
  EXPECT_TRUE(owner.switched.empty());
  EXPECT_FALSE(slave.silent());
  EXPECT_EQ(slave.active().bit_rate, BitRateIndex::kbit_250);
  executor.advance(rt::Time(milliseconds(1000)));
  EXPECT_EQ(owner.switched, std::vector{BitRateIndex::kbit_50});
  EXPECT_EQ(slave.active().bit_rate, BitRateIndex::kbit_50);
  EXPECT_TRUE(slave.silent());
  EXPECT_EQ(ask("5E00000000000000"), "") << "silent";
  executor.advance(rt::Time(milliseconds(1999)));
  EXPECT_EQ(owner.silence_ends, 0U);
  executor.advance(rt::Time(milliseconds(2000)));
  EXPECT_EQ(owner.silence_ends, 1U);
  EXPECT_EQ(ask("5E00000000000000"), "7E4#5E05000000000000");
  EXPECT_EQ(slave.persistent().bit_rate, BitRateIndex::kbit_250) << "not stored";
}

TEST_F(LssSlaveConfigured, ResetDuringTheSwitchDelayForgetsIt) {
  select();
  ask("1300060000000000");
  ask("15E8030000000000");
  slave.power_on(slave.persistent());
  executor.advance(rt::Time(milliseconds(5000)));
  EXPECT_TRUE(owner.switched.empty());
  EXPECT_EQ(slave.active().bit_rate, BitRateIndex::kbit_250);
  EXPECT_EQ(slave.state(), State::waiting);
}

// Everything that CiA 305 does not name: silence, and no change.
RC_GTEST_PROP(LssSlaveProperty, AnyBytesKeepTheInvariants, ()) {
  rt::Executor executor;
  Owner owner;
  const auto stored = *rc::gen::inRange(1, 128);
  const Settings persistent{*rc::gen::arbitrary<bool>() ? NodeId(static_cast<std::uint8_t>(stored)) : NodeId(),
                            BitRateIndex::kbit_125};
  Slave slave(executor, owner, {.address = address}, persistent);
  slave.reset_communication();
  Random random(*rc::gen::arbitrary<std::uint64_t>());
  static constexpr std::uint8_t likely[] = {0x04, 0x11, 0x13, 0x15, 0x17, 0x40, 0x41, 0x42,
                                            0x43, 0x46, 0x4B, 0x4C, 0x51, 0x5A, 0x5E};
  for (int i = 0; i < 200; ++i) {
    can::Frame frame = can::Frame::base(master_cob_id, {0, 0, 0, 0, 0, 0, 0, 0});
    for (auto& byte : std::span(frame.data).first(8)) byte = static_cast<std::uint8_t>(random.below(3));
    frame.data[0] =
        random.chance(900'000) ? likely[random.below(std::size(likely))] : static_cast<std::uint8_t>(random.next());
    const auto state = slave.state();
    const auto answer = slave.handle(frame);
    if (answer) {
      RC_ASSERT(is_lss(*answer, slave_cob_id));
      const auto cs = frame.data[0];
      const auto expected = cs == 0x43 ? 0x44 : cs == 0x4B || cs == 0x51 ? 0x4F : cs == 0x4C ? 0x50 : cs;
      RC_ASSERT(answer->data[0] == expected);
      if (cs == 0x51) RC_ASSERT(state == State::waiting && slave.unconfigured());
      if (cs != 0x43 && cs != 0x4B && cs != 0x4C && cs != 0x51) RC_ASSERT(state == State::configuration);
    }
    RC_ASSERT(NodeId::make(slave.pending().node_id.value()).has_value());
    RC_ASSERT(slave.pending().bit_rate != BitRateIndex::reserved);
    RC_ASSERT(slave.active().node_id == persistent.node_id);  // no reset communication happened
    if (frame.data[0] == 0x51) RC_ASSERT(answer || slave.state() == state);
  }
}

}  // namespace
}  // namespace berth::lss::slave_tests
