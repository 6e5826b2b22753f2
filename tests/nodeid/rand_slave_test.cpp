// RAND frames and slave alone. Expected bytes are written by hand from paper 1 §II and docs/rand.md.
#include <gtest/gtest.h>
#include <rapidcheck/gtest.h>
#include <chrono>
#include <cstdint>
#include <string>
#include <vector>

#include "berth/can/length.hpp"
#include "berth/nodeid/paper1_times.hpp"
#include "tests/harness/rand_world.hpp"

namespace berth::nodeid {
namespace {

using std::chrono::milliseconds;
using I = Identification;

constexpr LssAddress s2{0x0000'0001, 0x0000'0001, 0, 5};
constexpr LssAddress odd{0x0102'0304, 0x0506'0708, 0x090A'0B0C, 0x0D0E'0F10};

std::string ask(RandSlave& slave, const std::string& text, bool configuration = false) {
  const auto answer = slave.handle(*can::parse_frame("1F940000#" + text), configuration);
  return answer ? can::to_string(*answer) : "";
}

TEST(RandFrames, S1_11_EightChunksBigEndian) {
  for (unsigned i = 0; i < 8; ++i) EXPECT_EQ(odd.chunk(i), 0x0102 + 0x0202 * i);
}

TEST(RandFrames, S1_12_S1_13_IursIsExtended2021WithFourBytes) {
  EXPECT_EQ(can::to_string(iurs(0, 0x1234)), "1F940000#80000000");  // phase 0: the mask is null
  EXPECT_EQ(can::to_string(iurs(1, 0x0000)), "1F940000#80010000");  // the text's 80 01 00 00
  EXPECT_EQ(can::to_string(iurs(7, 0xABCD)), "1F940000#8007ABCD");
  EXPECT_EQ(0x7E5U << 18, 0x1F94'0000U);
}

TEST(RandFrames, S1_14_IusCarriesTheChunkInItsIdentifier) {
  EXPECT_EQ(can::to_string(ius(2)), "1F500008#");  // the paper's example, its bit string without the two extra zeros
  EXPECT_EQ(can::to_string(ius(0xFFFF)), "1F53FFFC#");
}

TEST(RandFrames, S1_15_S1_16_DirsAndDis) {
  EXPECT_EQ(can::to_string(dirs(5)), "1F940000#80080005");
  EXPECT_EQ(can::to_string(dis(5)), "1F900014#");
}

TEST(RandFrames, S1_23_SwitchIdentificationStateIsOurOwn) {
  EXPECT_EQ(can::to_string(switch_identification_global(I::unknown)), "1F940000#81000000");
  EXPECT_EQ(can::to_string(switch_identification_global(I::identified)), "1F940000#81010000");
  EXPECT_EQ(can::to_string(switch_identification_selective(odd, 0)), "1F940000#8200000001020304");
  EXPECT_EQ(can::to_string(switch_identification_selective(odd, 1)), "1F940000#8300000005060708");
  EXPECT_EQ(can::to_string(switch_identification_selective(odd, 2)), "1F940000#84000000090A0B0C");
  EXPECT_EQ(can::to_string(switch_identification_selective(odd, 3)), "1F940000#850000000D0E0F10");
  EXPECT_EQ(can::to_string(switch_identification_selective(odd, 3, I::unknown)), "1F940000#850100000D0E0F10");
}

TEST(RandFrames, S1_13_EightBytesWithReservedZerosAreAcceptedAndNothingElse) {
  const auto read = [](const char* text) { return decode_rand_request(*can::parse_frame(text)); };
  ASSERT_TRUE(read("1F940000#8004000100000000"));
  EXPECT_EQ(read("1F940000#8004000100000000")->phase, 4);
  EXPECT_EQ(read("1F940000#8004000100000000")->mask, 1);
  EXPECT_TRUE(read("1F940000#8100000000000000"));
  for (const auto* text :
       {"1F940000#80040001000000", "1F940000#8004000100000001", "1F940000#8009000000000000", "1F940000#80090000",
        "1F940000#800000", "1F940000#", "1F940000#R4", "1F940004#80000000", "7E5#80000000", "1F940000#81020000",
        "1F940000#81000001", "1F940000#82000000", "1F940000#8202000001020304", "1F940000#8200010001020304",
        "1F940000#8600000001020304", "1F940000#51000000"}) {
    EXPECT_FALSE(read(text)) << text;
  }
}

// S1.24: DIS and the feedback of Fastscan share identifiers; what is neither IUS nor DIS by its bits is no answer.
TEST(RandFrames, S1_24_OnlyTheTwoRangesAreAnswers) {
  const auto read = [](std::uint32_t id) { return decode_rand_answer(can::Frame::ext(id, {})); };
  for (const auto id : {0x1F4F'FFFCU, 0x1F54'0000U, 0x1F8F'FFFCU, 0x1F94'0000U, 0x1F50'0001U, 0x1F90'0135U}) {
    EXPECT_FALSE(read(id)) << id;
  }
  EXPECT_FALSE(decode_rand_answer(can::Frame::base(0x7D4, {})));
  ASSERT_TRUE(decode_rand_answer(can::Frame::ext(0x1F90'0014, {1, 2, 3, 4}))) << "S1.16: the paper's four bytes";
}

RC_GTEST_PROP(RandFrames, EveryRequestReadsBack, (std::uint16_t mask, std::uint32_t value)) {
  const auto phase = *rc::gen::inRange(1U, 8U);
  const auto i = decode_rand_request(iurs(phase, mask));
  RC_ASSERT(i && i->kind == RandRequest::Kind::identify && i->phase == phase && i->mask == mask);
  const auto d = decode_rand_request(dirs(mask));
  RC_ASSERT(d && d->kind == RandRequest::Kind::direct && d->mask == mask);
  const auto part = *rc::gen::inRange(0U, 4U);
  const auto s = decode_rand_request(switch_identification_selective({value, value, value, value}, part));
  RC_ASSERT(s && s->kind == RandRequest::Kind::switch_selective && s->part == part && s->value == value);
  const auto a = decode_rand_answer(ius(mask));
  RC_ASSERT(a && !a->direct && a->chunk == mask);
  const auto b = decode_rand_answer(dis(mask));
  RC_ASSERT(b && b->direct && b->chunk == mask);
}

/// Brings a slave with address `odd` to selected, waiting for `phase`.
void select_up_to(RandSlave& slave, unsigned phase) {
  slave.power_on();
  for (unsigned p = 0; p < phase; ++p) {
    ASSERT_TRUE(slave.handle(p == 0 ? iurs(0, 0) : iurs(p, odd.chunk(p - 1)), false).has_value());
  }
}

TEST(RandSlave, S1_17_WholeProcedureAnswersEachPhaseWithItsChunk) {
  RandSlave slave({.address = odd});
  EXPECT_EQ(slave.state(), I::unknown);
  EXPECT_EQ(ask(slave, "80000000"), "1F500408#");  // chunk(0) = 0102h, shifted by two
  EXPECT_EQ(slave.state(), I::selected);
  EXPECT_EQ(ask(slave, "80010102"), "1F500C10#");  // 0304h
  EXPECT_EQ(ask(slave, "80020304"), "1F501418#");
  EXPECT_EQ(ask(slave, "80030506"), "1F501C20#");
  EXPECT_EQ(ask(slave, "80040708"), "1F502428#");
  EXPECT_EQ(ask(slave, "8005090A"), "1F502C30#");
  EXPECT_EQ(ask(slave, "80060B0C"), "1F503438#");
  EXPECT_EQ(ask(slave, "80070D0E"), "1F503C40#");  // 0F10h
  EXPECT_EQ(slave.state(), I::selected);
  EXPECT_EQ(ask(slave, "80080F10"), "1F903C40#");
  EXPECT_EQ(slave.state(), I::identified);
}

// S1.17: every state against every request.
TEST(RandSlave, S1_17_StateTable) {
  for (unsigned reached = 1; reached <= 8; ++reached) {
    for (unsigned asked = 0; asked <= 8; ++asked) {
      for (const bool match : {true, false}) {
        RandSlave slave({.address = odd});
        select_up_to(slave, reached);
        ASSERT_EQ(slave.next_phase(), reached);
        const auto mask =
            asked == 0 ? std::uint16_t{0} : static_cast<std::uint16_t>(odd.chunk(asked - 1) ^ (match ? 0 : 1));
        const auto answer = slave.handle(asked == 8 ? dirs(mask) : iurs(asked, mask), false);
        if (asked == 0) {  // the master began anew
          EXPECT_TRUE(answer && *answer == ius(odd.chunk(0)));
          EXPECT_EQ(slave.next_phase(), 1U);
        } else if (asked == reached && match) {
          EXPECT_TRUE(answer && *answer == (asked == 8 ? dis(odd.chunk(7)) : ius(odd.chunk(asked))));
          EXPECT_EQ(slave.state(), asked == 8 ? I::identified : I::selected);
        } else {  // mismatch, or not the next phase
          EXPECT_FALSE(answer) << reached << " " << asked;
          EXPECT_EQ(slave.state(), I::unknown);
        }
      }
    }
  }
}

TEST(RandSlave, S1_17_UnknownIgnoresLaterPhasesAndDirs) {
  RandSlave slave({.address = odd});
  for (unsigned p = 1; p <= 8; ++p) {
    EXPECT_FALSE(slave.handle(p == 8 ? dirs(odd.chunk(7)) : iurs(p, odd.chunk(p - 1)), false));
    EXPECT_EQ(slave.state(), I::unknown);
  }
}

TEST(RandSlave, S1_17_IdentifiedIgnoresEverythingButSwitches) {
  RandSlave slave({.address = odd});
  ask(slave, "81010000");
  ASSERT_EQ(slave.state(), I::identified);
  for (unsigned p = 0; p <= 8; ++p) {
    EXPECT_FALSE(
        slave.handle(p == 8 ? dirs(odd.chunk(7)) : iurs(p, p == 0 ? std::uint16_t{0} : odd.chunk(p - 1)), false));
    EXPECT_EQ(slave.state(), I::identified);
  }
  ask(slave, "81000000");
  EXPECT_EQ(slave.state(), I::unknown);
  EXPECT_NE(ask(slave, "80000000"), "");
}

TEST(RandSlave, S1_23_SelectiveSwitchesOnlyTheOneWithAllFourParts) {
  RandSlave slave({.address = odd});
  const std::vector<std::string> parts{"8200000001020304", "8300000005060708", "84000000090A0B0C", "850000000D0E0F10"};
  const auto send = [&](const std::vector<std::string>& frames) {
    slave.power_on();
    for (const auto& frame : frames) EXPECT_EQ(ask(slave, frame), "");
    return slave.state();
  };
  EXPECT_EQ(send(parts), I::identified);
  for (unsigned i = 0; i < 4; ++i) {
    auto missing = parts;
    missing.erase(missing.begin() + i);
    EXPECT_EQ(send(missing), I::unknown) << i;
    auto wrong = parts;
    wrong[i].back() = wrong[i].back() == '0' ? '1' : '0';
    EXPECT_EQ(send(wrong), I::unknown) << i;
    auto broken = parts;
    broken.insert(broken.begin() + i, "80010000");
    EXPECT_EQ(send(broken), i == 0 ? I::identified : I::unknown) << i;
    auto mixed = parts;
    mixed[i].replace(2, 2, "01");  // another target within the four
    EXPECT_EQ(send(mixed), I::unknown) << i;
  }
  ask(slave, "81010000");
  for (const auto* frame : {"8201000001020304", "8301000005060708", "84010000090A0B0C", "850100000D0E0F10"})
    ask(slave, frame);
  EXPECT_EQ(slave.state(), I::unknown) << "our own: look for this one again";
}

// ---- the extension: resume requests (docs/rand.md) -----------------------------------------------------------------

// CRC-32 by hand: of no bytes 0; "123456789" gives CBF43926h (zlib), which no address starts with, so the first two
// bytes of `odd`, 01 02, are computed bit by bit here.
std::uint32_t crc32_slow(const std::vector<std::uint8_t>& bytes) {
  std::uint32_t crc = 0xFFFF'FFFF;
  for (const auto b : bytes) {
    crc ^= b;
    for (int i = 0; i < 8; ++i) crc = (crc >> 1) ^ ((crc & 1U) != 0 ? 0xEDB8'8320U : 0U);
  }
  return ~crc;
}

TEST(RandFrames, ResumeRequestsCarryTheLastChunkAndTheCheckOfTheRest) {
  EXPECT_EQ(can::to_string(resume_request(0, odd)), "1F940000#8600000000000000");
  EXPECT_EQ(can::to_string(resume_request(1, odd)), "1F940000#8601010200000000");
  EXPECT_EQ(crc32_slow({'1', '2', '3', '4', '5', '6', '7', '8', '9'}), 0xCBF4'3926U);
  EXPECT_EQ(prefix_check(odd, 1), crc32_slow({1, 2}));
  EXPECT_EQ(prefix_check(odd, 7), crc32_slow({1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12, 13, 14}));
  const auto direct = decode_rand_request(resume_request(8, odd));
  ASSERT_TRUE(direct);
  EXPECT_EQ(direct->kind, RandRequest::Kind::resume);
  EXPECT_EQ(direct->phase, 8);
  EXPECT_EQ(direct->mask, 0x0F10);
  EXPECT_EQ(direct->value, crc32_slow({1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12, 13, 14}));
  for (const auto* text : {"1F940000#86000000", "1F940000#8600000100000000", "1F940000#8600000000000001",
                           "1F940000#8609000000000000", "1F940000#R8"}) {
    EXPECT_FALSE(decode_rand_request(*can::parse_frame(text))) << text;
  }
}

TEST(RandSlave, ResumeAnswersAtAnyDepthForItsOwnPrefixOnly) {
  RandSlave slave({.address = odd, .resume = true});
  for (const unsigned phase : {7U, 3U, 0U, 5U, 7U, 1U, 2U, 6U, 4U}) {
    const auto answer = slave.handle(resume_request(phase, odd), false);
    ASSERT_TRUE(answer) << phase;
    EXPECT_EQ(*answer, ius(odd.chunk(phase)));
    EXPECT_EQ(slave.state(), I::unknown) << "nothing changes";
    for (unsigned wrong = 0; wrong < phase; ++wrong) {
      auto other = odd;
      auto* const part = wrong < 2   ? &other.vendor
                         : wrong < 4 ? &other.product
                         : wrong < 6 ? &other.revision
                                     : &other.serial;
      *part ^= wrong % 2 == 0 ? 0x8000'0000U : 0x0000'0001U;
      EXPECT_FALSE(slave.handle(resume_request(phase, other), false)) << phase << wrong;
    }
  }
  EXPECT_EQ(*slave.handle(resume_request(8, odd), false), dis(odd.chunk(7)));
  EXPECT_EQ(slave.state(), I::identified);
  for (unsigned phase = 0; phase <= 8; ++phase) EXPECT_FALSE(slave.handle(resume_request(phase, odd), false));
}

TEST(RandSlave, ResumeRequestsDoNotDisturbAPublishedProcedure) {
  constexpr LssAddress of_another_branch{0xAABB'CCDD, 0xEEFF'0011, 0x2233'4455, 0x6677'8899};
  for (const bool resume : {false, true}) {
    RandSlave slave({.address = odd, .resume = resume});
    for (unsigned p = 0; p <= 8; ++p) {
      EXPECT_EQ(slave.handle(resume_request(7, odd), false).has_value(), resume);
      EXPECT_FALSE(slave.handle(resume_request(7, of_another_branch), false));
      EXPECT_FALSE(slave.handle(resume_request(1, of_another_branch), false));
      const auto mask = p == 0 ? std::uint16_t{0} : odd.chunk(p - 1);
      EXPECT_TRUE(slave.handle(p == 8 ? dirs(mask) : iurs(p, mask), false)) << p;
    }
    EXPECT_EQ(slave.state(), I::identified);
  }
}

TEST(RandSlave, ResumeObeysTheLetterOfLssConfigurationToo) {
  RandSlave literal({.address = odd, .literal = true, .resume = true});
  EXPECT_FALSE(literal.handle(resume_request(0, odd), false));
  EXPECT_TRUE(literal.handle(resume_request(0, odd), true));
}

// S1.31: the letter says configuration state only; a running machine needs it in waiting too.
TEST(RandSlave, S1_31_LiteralAnswersOnlyInLssConfiguration) {
  RandSlave literal({.address = s2, .literal = true});
  EXPECT_EQ(ask(literal, "80000000", false), "");
  EXPECT_EQ(ask(literal, "81010000", false), "");
  EXPECT_EQ(literal.state(), I::unknown);
  EXPECT_EQ(ask(literal, "80000000", true), "1F500000#");
  RandSlave ours({.address = s2});
  EXPECT_EQ(ask(ours, "80000000", false), "1F500000#");
  EXPECT_EQ(ask(ours, "80000000", true), "1F500000#");
}

// A model that keeps nothing but the requests since the last phase 0, against the state machine.
RC_GTEST_PROP(RandSlaveProperty, S1_17_AnswersExactlyTheUnbrokenMatchingSequence, ()) {
  Random random(*rc::gen::arbitrary<std::uint64_t>());
  const LssAddress address{static_cast<std::uint32_t>(random.below(2)), static_cast<std::uint32_t>(random.below(2)),
                           static_cast<std::uint32_t>(random.below(2)) << 16,
                           static_cast<std::uint32_t>(random.below(2))};
  RandSlave slave({.address = address});
  unsigned run = 0;  // phases matched without a break, 0 = unknown, 9 = identified
  for (int i = 0; i < 400; ++i) {
    const unsigned phase = random.chance(700'000) ? run % 9 : static_cast<unsigned>(random.below(9));
    const auto mask =
        random.chance(850'000) && phase > 0 ? address.chunk(phase - 1) : static_cast<std::uint16_t>(random.below(2));
    const auto answer = slave.handle(phase == 8 ? dirs(mask) : iurs(phase, mask), false);
    if (random.chance(5'000)) {
      slave.power_on();
      run = 0;
      continue;
    }
    if (run == 9) {
      RC_ASSERT(!answer);
    } else if (phase == 0) {
      RC_ASSERT(answer.has_value());
      run = 1;
    } else if (run == phase && address.chunk(phase - 1) == mask) {
      RC_ASSERT(answer.has_value());
      ++run;
    } else {
      RC_ASSERT(!answer);
      run = 0;
    }
    RC_ASSERT(slave.state() == (run == 0 ? I::unknown : run == 9 ? I::identified : I::selected));
  }
}

// ---- the formulas of §IV ---------------------------------------------------------------------------------------

double in_ms(rt::Duration d) { return static_cast<double>(d.count()) / 1e6; }
constexpr paper1::Conditions conditions{};

TEST(Paper1Times, S1_39_S1_40_Preparation190ms) {
  EXPECT_DOUBLE_EQ(in_ms(paper1::t_detect(paper1::published, conditions)), 10.2);
  EXPECT_EQ(paper1::t_detect_all(paper1::published, conditions), milliseconds(190));
  EXPECT_EQ(paper1::t_detect_all(paper1::bound, conditions), milliseconds(76));
}

TEST(Paper1Times, S1_41_CollectAtLeast30Point1ms) {
  EXPECT_DOUBLE_EQ(in_ms(paper1::t_collect_least(paper1::published, conditions)), 30.1);
  EXPECT_EQ(paper1::t_collect_least(paper1::published, conditions), paper1::Printed::collect_least);
  EXPECT_DOUBLE_EQ(in_ms(paper1::t_collect_least(paper1::published, conditions, 30)), 4 + 31 * 2.9);
}

// S1.42: the paper counts 145 bits and 10 for each data byte; a stuffed frame has 80 and 10 at most. The frames of the
// demonstration have 110 (phase 0) and 74 exactly, and fewer in other phases: counted apart from Berth, bit by bit.
TEST(Paper1Times, S1_42_FrameLengths) {
  const auto as_paper = [](unsigned bytes) { return 145 + 10 * bytes; };
  EXPECT_EQ(paper1::published.iurs, as_paper(4));
  EXPECT_EQ(paper1::published.ius, as_paper(0));
  EXPECT_EQ(paper1::published.dirs, as_paper(4));
  EXPECT_EQ(paper1::published.dis, as_paper(4)) << "four bytes in its arithmetic, none on the bus (S1.16)";
  EXPECT_EQ(paper1::published.switch_global, as_paper(2));
  EXPECT_EQ(paper1::published.select, as_paper(5));
  EXPECT_EQ(paper1::published.select_answer, as_paper(2));
  EXPECT_EQ(paper1::published.configure, as_paper(2));
  EXPECT_EQ(paper1::published.configure_answer, as_paper(3));
  EXPECT_DOUBLE_EQ(in_ms(paper1::time_of(paper1::published.iurs, conditions)), 3.7);
  EXPECT_DOUBLE_EQ(in_ms(paper1::time_of(paper1::published.ius, conditions)), 2.9);
  const auto bound = [](bool extended, unsigned bytes) { return (extended ? 80 : 55) + 10 * bytes; };
  EXPECT_EQ(paper1::bound.iurs, bound(true, 4));
  EXPECT_EQ(paper1::bound.ius, bound(true, 0));
  EXPECT_EQ(paper1::bound.dis, bound(true, 0));
  EXPECT_EQ(paper1::bound.select, bound(false, 8));
  EXPECT_EQ(paper1::bound.guard, bound(false, 0));
  EXPECT_EQ(paper1::bound.guard_answer, bound(false, 1));
  EXPECT_EQ(can::exact_bits(iurs(0, 0)), 110U);
  EXPECT_EQ(can::exact_bits(iurs(1, 0)), 109U);
  EXPECT_EQ(can::exact_bits(iurs(4, 1)), 109U);
  EXPECT_EQ(can::exact_bits(dirs(5)), 109U);
  EXPECT_EQ(can::exact_bits(ius(0)), 74U);
  EXPECT_EQ(can::exact_bits(ius(1)), 74U);
  EXPECT_EQ(can::exact_bits(ius(5)), 71U);
  EXPECT_EQ(can::exact_bits(dis(5)), 72U);
}

TEST(Paper1Times, S1_43_Network11Point14s) {
  EXPECT_DOUBLE_EQ(in_ms(paper1::t_id_phase(paper1::published, conditions)), 44.7);
  EXPECT_DOUBLE_EQ(in_ms(paper1::t_direct_id(paper1::published, conditions)), 12.4);
  EXPECT_DOUBLE_EQ(in_ms(paper1::t_node_id(paper1::published, conditions)), 370.0);
  EXPECT_DOUBLE_EQ(in_ms(paper1::t_network_id(paper1::published, conditions)), 11'144.7);
  EXPECT_LE(paper1::t_network_id(paper1::published, conditions), paper1::Printed::network);
  EXPECT_NEAR(in_ms(paper1::t_network_id_printed(paper1::published, conditions)), 1386, 0.5);
  paper1::FrameBits empty_dis = paper1::published;
  empty_dis.dis = 145;
  EXPECT_DOUBLE_EQ(in_ms(paper1::t_direct_id(empty_dis, conditions)), 11.6);
  EXPECT_DOUBLE_EQ(in_ms(paper1::t_node_id(empty_dis, conditions)), 369.2);
  paper1::Conditions least = conditions;
  least.t_collect = paper1::t_collect_least(empty_dis, conditions);
  EXPECT_NEAR(in_ms(paper1::t_network_id(empty_dis, least)), 8730, 5);
  least.t_collect = paper1::t_collect_least(paper1::bound, conditions);
  EXPECT_NEAR(in_ms(paper1::t_network_id(paper1::bound, least)), 5520, 5);
}

TEST(Paper1Times, S1_44_S1_45_And16Point088s) {
  paper1::Conditions and_conditions = conditions;
  and_conditions.phases = paper1::and_phases;
  EXPECT_DOUBLE_EQ(in_ms(paper1::t_id_phase(paper1::and_published, and_conditions)), 43.7);
  EXPECT_DOUBLE_EQ(in_ms(paper1::t_direct_id(paper1::and_published, and_conditions)), 10.4);
  EXPECT_NEAR(in_ms(paper1::t_network_id(paper1::and_published, and_conditions)), 16'088, 0.5);
  EXPECT_LT(paper1::t_network_id(paper1::published, conditions),
            paper1::t_network_id(paper1::and_published, and_conditions));
}

TEST(Paper1Times, S1_46_S1_47_Binding1Point14s) {
  EXPECT_DOUBLE_EQ(in_ms(paper1::t_a_bind(paper1::published, conditions)), 38.0);
  EXPECT_EQ(paper1::t_all_bind(paper1::published, conditions), milliseconds(1140));
  paper1::FrameBits longer = paper1::published;
  longer.select_answer = 175;  // 3 bytes: what comes nearest to the printed 1.15
  EXPECT_DOUBLE_EQ(in_ms(paper1::t_all_bind(longer, conditions)), 1146);
  EXPECT_DOUBLE_EQ(in_ms(paper1::t_all_bind(paper1::bound, conditions)), 918);
}

}  // namespace
}  // namespace berth::nodeid
