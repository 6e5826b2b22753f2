// The slave's side of Fastscan and feedback alone. Expected frames are written by hand from CiA 305 (the rules of the
// slave in its header) and from paper 4's Table 2.
#include <gtest/gtest.h>
#include <rapidcheck/gtest.h>
#include <chrono>
#include <cstdint>
#include <optional>
#include <string>

#include "berth/lss/slave.hpp"

namespace berth::lss {
namespace {

using std::chrono::milliseconds;

constexpr LssAddress paper4{0x0135'5341, 0x0447'0003, 0x0002'0006, 0xFEED'F00D};

struct Owner final : SlaveOwner {
  std::optional<StoreResult> store(const Settings&) noexcept override { return StoreResult{}; }
  void wants_reset_communication() noexcept override {}
  void switch_bit_rate(BitRateIndex) noexcept override {}
  void silence_over() noexcept override {}
};

struct Lone {
  explicit Lone(const SlaveOptions& options = {.address = paper4}, Settings stored = {})
      : slave(executor, owner, options, stored) {
    slave.reset_communication();
  }
  Answers ask(const FastscanRequest& request) { return slave.handle(request_fastscan(request)); }
  bool answers(const FastscanRequest& request) {
    const auto a = ask(request);
    if (a) {
      EXPECT_EQ(can::to_string(*a), "7E4#4F00000000000000");
    }
    return a.has_value();
  }
  /// What it says before 4Fh, as candump text; "" nothing, "-" no answer at all.
  std::string feedback(const FastscanRequest& request) {
    const auto a = ask(request);
    if (!a) return "-";
    return a.feedback() ? can::to_string(*a.feedback()) : "";
  }
  /// Through the parts before `sub`.
  void go_to(std::uint8_t sub) {
    ASSERT_TRUE(answers({}));
    for (std::uint8_t i = 0; i < sub; ++i) {
      ASSERT_TRUE(answers({slave.address().part(i), 0, i, static_cast<std::uint8_t>(i + 1)}));
    }
  }
  rt::Executor executor;
  Owner owner;
  Slave slave;
};

// S4.8: the bytes of the request: 51h and not the 81h of the paper's text.
TEST(FastscanFrames, S4_8_TheBytes) {
  EXPECT_EQ(can::to_string(request_fastscan({})), "7E5#5100000000800000");
  EXPECT_EQ(can::to_string(request_fastscan({0x0135'5341, 0, 0, 1})), "7E5#5141533501000001");
  EXPECT_EQ(can::to_string(request_fastscan({0xFEED'F000, 9, 3, 3})), "7E5#5100F0EDFE090303");
  EXPECT_FALSE(decode_fastscan(*can::parse_frame("7E5#8100000000800000")));
  EXPECT_EQ(decode_fastscan(*can::parse_frame("7E5#5141533501000001")), (FastscanRequest{0x0135'5341, 0, 0, 1}));
  for (const auto* bad :
       {"7E5#5100000000200000", "7E5#51000000007F0000", "7E5#5100000000810000", "7E5#51000000001F0400",
        "7E4#5100000000800000", "7E5#51000000008000", "7E5#R8", "000007E5#5100000000800000"}) {
    EXPECT_FALSE(decode_fastscan(*can::parse_frame(bad))) << bad;
  }
}

// S4.10, S4.11, S4.17: identifiers of Table 2; no data, no remote frame, bit 17 is 0.
TEST(FastscanFrames, S4_10_S4_11_FeedbackIdentifiers) {
  EXPECT_EQ(can::to_string(feedback_frame({Feedback::extended, false, 0x0135})), "1F900135#");
  EXPECT_EQ(can::to_string(feedback_frame({Feedback::extended, true, 0xF00D})), "1F91F00D#");
  EXPECT_EQ(can::to_string(feedback_frame({Feedback::base, false, 0xF})), "6DF#");
  EXPECT_EQ(can::to_string(feedback_frame({Feedback::base, false, 2}, 0x680)), "682#");
  EXPECT_EQ(decode_feedback(*can::parse_frame("1F91FFFF#")), (FeedbackValue{Feedback::extended, true, 0xFFFF}));
  EXPECT_EQ(decode_feedback(*can::parse_frame("6D3#"), 0x6D0), (FeedbackValue{Feedback::base, false, 3}));
  EXPECT_FALSE(decode_feedback(*can::parse_frame("6D3#"))) << "off unless configured";
  for (const auto* bad : {"1F8FFFFF#", "1F920000#", "1F900135#00", "1F900135#R", "6CF#", "6E0#", "6D3#00", "6D3#R"}) {
    EXPECT_FALSE(decode_feedback(*can::parse_frame(bad), 0x6D0)) << bad;
  }
  EXPECT_TRUE(usable_feedback_base(default_feedback_base));
  for (const unsigned bad : {0U, 0x57FU, 0x67FU, 0x6D1U, 0x6E0U, 0x7E0U})
    EXPECT_FALSE(usable_feedback_base(bad)) << bad;
}

// S4.6: it answers while the bits are its own, whatever the bits below.
TEST(FastscanSlave, S4_6_ABitThatDiffersIsSilence) {
  Lone d;
  d.go_to(0);
  EXPECT_TRUE(d.answers({0, 31, 0, 0}));
  EXPECT_FALSE(d.answers({0x8000'0000, 31, 0, 0}));
  EXPECT_TRUE(d.answers({0x00FF'FFFF, 25, 0, 0}));  // bits 31..25 of 0135 5341 are 0
  EXPECT_FALSE(d.answers({0, 24, 0, 0}));
  EXPECT_TRUE(d.answers({0x0100'0000, 24, 0, 0}));
  EXPECT_TRUE(d.answers({0x0135'5341, 0, 0, 0}));
  EXPECT_FALSE(d.answers({0x0135'5340, 0, 0, 0}));
}

// S4.9: known bits in one message: four requests select it.
TEST(FastscanSlave, S4_9_FourMessagesAreEnoughWhenAllIsKnown) {
  Lone d;
  d.go_to(3);
  EXPECT_TRUE(d.answers({paper4.serial, 0, 3, 0}));
  EXPECT_EQ(d.slave.state(), State::configuration);
}

// The part that is asked next: only LSSNext of a request that matched moves it; 80h moves it to the first.
TEST(FastscanSlave, PartsAreAskedInTheOrderOfLssNext) {
  Lone d;
  d.go_to(1);
  EXPECT_FALSE(d.answers({paper4.vendor, 0, 0, 1})) << "the part before";
  EXPECT_FALSE(d.answers({paper4.revision, 0, 2, 3})) << "the part after";
  EXPECT_FALSE(d.answers({~paper4.product, 0, 1, 2})) << "no match: nothing changes";
  EXPECT_TRUE(d.answers({paper4.product, 0, 1, 2}));
  EXPECT_TRUE(d.answers({}));
  EXPECT_FALSE(d.answers({paper4.revision, 0, 2, 3})) << "80h began anew";
  EXPECT_TRUE(d.answers({paper4.vendor, 31, 0, 2})) << "LSSNext counts with any bit";
  EXPECT_TRUE(d.answers({paper4.revision, 0, 2, 0})) << "back to the first part is no end";
  EXPECT_EQ(d.slave.state(), State::waiting);
  EXPECT_TRUE(d.answers({paper4.vendor, 0, 0, 1}));
}

// HC3.1, HU.2: it enters configuration after the whole serial number and nowhere else; LSSNext < LSSSub is not enough.
TEST(FastscanSlave, HC3_1_HU_2_CompleteOnlyAtBit0OfTheSerialNumber) {
  for (std::uint8_t sub = 0; sub < 4; ++sub) {
    for (unsigned bit = 0; bit < 32; ++bit) {
      for (unsigned next = 0; next < 8; ++next) {
        Lone d;
        d.go_to(sub);
        const FastscanRequest request{paper4.part(sub), static_cast<std::uint8_t>(bit), sub,
                                      static_cast<std::uint8_t>(next)};
        EXPECT_TRUE(d.answers(request));
        const bool complete = sub == 3 && bit == 0 && (next == 0 || next > 3);
        EXPECT_EQ(d.slave.state() == State::configuration, complete) << sub << ' ' << bit << ' ' << next;
      }
    }
  }
}

// S4.15: LSSNext 04h of the paper's trace is taken for the end, as 0 is; it selects nobody before.
TEST(FastscanSlave, S4_15_LssNext4IsTheEndToo) {
  Lone d;
  d.go_to(3);
  EXPECT_TRUE(d.answers({paper4.serial, 0, 3, FastscanRequest::after_last}));
  EXPECT_EQ(d.slave.state(), State::configuration);
  Lone other;
  other.go_to(1);
  EXPECT_TRUE(other.answers({paper4.product, 0, 1, 4}));
  EXPECT_TRUE(other.answers({paper4.vendor, 0, 0, 1})) << "with bit 0, 4 is as 0";
}

// HC3.2: waiting, and active and pending node-ID 255.
TEST(FastscanSlave, HC3_2_HU_6_OnlyUnconfiguredAndWaiting) {
  Lone configured({.address = paper4}, Settings{NodeId(5), BitRateIndex::kbit_125});
  EXPECT_FALSE(configured.answers({}));

  Lone pending;
  pending.slave.handle(*can::parse_frame("7E5#0401000000000000"));
  EXPECT_FALSE(pending.answers({})) << "in configuration";
  pending.slave.handle(*can::parse_frame("7E5#1107000000000000"));
  pending.slave.handle(*can::parse_frame("7E5#0400000000000000"));
  EXPECT_EQ(pending.slave.state(), State::waiting);
  EXPECT_FALSE(pending.answers({})) << "pending 7, active 255";
  pending.slave.reset_communication();
  EXPECT_FALSE(pending.answers({})) << "active";

  Lone going({.address = paper4}, Settings{NodeId(5), BitRateIndex::kbit_125});
  going.slave.handle(*can::parse_frame("7E5#0401000000000000"));
  going.slave.handle(*can::parse_frame("7E5#11FF000000000000"));
  going.slave.handle(*can::parse_frame("7E5#0400000000000000"));
  EXPECT_FALSE(going.answers({})) << "pending 255, active 5";
  going.slave.reset_communication();
  EXPECT_TRUE(going.answers({}));

  Lone without({.address = paper4, .fastscan = false});
  EXPECT_FALSE(without.answers({}));
}

// After it was selected it is in configuration and is not found again until it is told to wait.
TEST(FastscanSlave, SelectedItStaysOutOfFurtherScans) {
  Lone d;
  d.go_to(3);
  EXPECT_TRUE(d.answers({paper4.serial, 0, 3, 0}));
  EXPECT_FALSE(d.answers({}));
  EXPECT_FALSE(d.answers({paper4.vendor, 0, 0, 1}));
  d.slave.handle(*can::parse_frame("7E5#0400000000000000"));
  EXPECT_TRUE(d.answers({}));
}

// S4.10, S4.17: what Table 2's device says at each step, and the same with bits that lie between.
TEST(FastscanSlave, S4_10_FeedbackIn29Bits) {
  Lone d({.address = paper4, .feedback = Feedback::extended});
  EXPECT_EQ(d.feedback({}), "1F900135#");
  EXPECT_EQ(d.feedback({0x0135'0000, 17, 0, 0}), "") << "no half ends here";
  EXPECT_EQ(d.feedback({0x0135'0000, 16, 0, 0}), "1F915341#");
  EXPECT_EQ(d.feedback({0x0136'0000, 16, 0, 0}), "-");
  EXPECT_EQ(d.feedback({0x0135'5340, 8, 0, 0}), "");
  EXPECT_EQ(d.feedback({0x0135'5341, 0, 0, 1}), "1F900447#");
  EXPECT_EQ(d.feedback({0x0447'0000, 16, 1, 1}), "1F910003#");
  EXPECT_EQ(d.feedback({0x0447'0003, 0, 1, 2}), "1F900002#");
  // The upper half need not be asked: the toggle bit is that of the half that is told.
  EXPECT_EQ(d.feedback({0x0002'0006, 0, 2, 3}), "1F90FEED#");
  EXPECT_EQ(d.feedback({0xFEED'0000, 16, 3, 3}), "1F91F00D#");
  EXPECT_EQ(d.feedback({}), "1F900135#") << "80h: from the beginning";
  for (std::uint8_t i = 0; i < 3; ++i) d.ask({paper4.part(i), 0, i, static_cast<std::uint8_t>(i + 1)});
  EXPECT_EQ(d.feedback({paper4.serial, 0, 3, 4}), "") << "after the last none";
  EXPECT_EQ(d.slave.state(), State::configuration);
}

// S4.11: 33 requests: 80h and eight for each part, each answered with the next four bits.
TEST(FastscanSlave, S4_11_FeedbackInSixteenIdentifiers) {
  Lone d({.address = paper4, .feedback = Feedback::base, .feedback_base = 0x6B0});
  const std::string digits =
      "01355341"
      "04470003"
      "00020006"
      "FEEDF00D";
  const auto id = [&](std::size_t i) { return "6B" + std::string(1, digits[i]) + "#"; };
  unsigned requests = 1;
  EXPECT_EQ(d.feedback({}), id(0));
  for (std::uint8_t sub = 0; sub < 4; ++sub) {
    for (unsigned nibble = 0; nibble < 8; ++nibble) {
      const auto bit = static_cast<std::uint8_t>(28 - 4 * nibble);
      const std::uint8_t next = bit == 0 ? static_cast<std::uint8_t>((sub + 1) % 4) : sub;
      const std::size_t told = 8U * sub + nibble + 1;
      EXPECT_EQ(d.feedback({paper4.part(sub), bit, sub, next}), told < 32 ? id(told) : "") << told;
      ++requests;
    }
  }
  EXPECT_EQ(requests, 33U);
  EXPECT_EQ(d.slave.state(), State::configuration);
}

// Any requests: silence changes nothing, an answer means that the bits are equal, feedback is the truth.
RC_GTEST_PROP(FastscanSlaveProperty, WhatItSaysIsTrue, ()) {
  const auto kind = *rc::gen::element(Feedback::none, Feedback::extended, Feedback::base);
  const LssAddress own{*rc::gen::inRange<std::uint32_t>(0, 4), *rc::gen::arbitrary<std::uint32_t>(), 0xFFFF'FFFF, 1};
  Lone d({.address = own, .feedback = kind});
  unsigned part = 0;  // what the standard's rule says, kept here apart
  for (unsigned i = 0; i < 60 && d.slave.state() == State::waiting; ++i) {
    const auto sub = static_cast<std::uint8_t>(*rc::gen::inRange<unsigned>(0, 5));
    const auto bit = *rc::gen::weightedOneOf<std::uint8_t>(
        {{6, rc::gen::inRange<std::uint8_t>(0, 33)}, {1, rc::gen::just<std::uint8_t>(0x80)}});
    const auto next = static_cast<std::uint8_t>(*rc::gen::inRange<unsigned>(0, 6));
    const std::uint32_t truth = own.part(part);
    const auto id = *rc::gen::weightedOneOf<std::uint32_t>(
        {{3, rc::gen::just(truth)}, {1, rc::gen::arbitrary<std::uint32_t>()}, {1, rc::gen::just(truth ^ 1U)}});
    const bool matches = bit == 0x80 || (bit < 32 && sub <= 3 && sub == part && id >> bit == truth >> bit);
    const auto answers = d.ask({id, bit, sub, next});
    RC_ASSERT(answers.has_value() == matches);
    if (!matches) continue;
    if (bit == 0x80) {
      part = 0;
    } else {
      part = bit == 0 && next > 3 ? 0 : next;
    }
    const bool complete = bit == 0 && sub == 3 && (next == 0 || next > 3);
    RC_ASSERT((d.slave.state() == State::configuration) == complete);
    if (!answers.feedback()) continue;
    const auto told = decode_feedback(*answers.feedback(), default_feedback_base);
    RC_ASSERT(told && told->kind == kind && !complete);
    const bool first = bit == 0x80 || bit == 0;
    const unsigned width = kind == Feedback::extended ? 16 : 4;
    const unsigned top = first ? 32U : bit;
    const std::uint64_t from = own.part(first ? part : sub);
    RC_ASSERT(told->value == (from % (std::uint64_t{1} << top)) >> (top - width));
  }
}

}  // namespace
}  // namespace berth::lss
