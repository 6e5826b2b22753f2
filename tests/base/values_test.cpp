// Errors, findings, names, bytes and random numbers.
#include <gtest/gtest.h>
#include <cstdint>
#include <set>
#include <string>
#include <vector>

#include "berth/base/bytes.hpp"
#include "berth/base/crc.hpp"
#include "berth/base/finding.hpp"
#include "berth/base/ids.hpp"
#include "berth/base/random.hpp"
#include "berth/base/result.hpp"

using namespace berth;

namespace {

TEST(Result, ErrorsSayWhatAndWhere) {
  EXPECT_EQ(
      describe({.code = Errc::aborted, .node = 5, .sub = 2, .index = 0x1018, .detail = 0x06020000, .text = "reading"}),
      "node 5, object 1018h:02: aborted (06020000h): reading");
  EXPECT_EQ(describe({.code = Errc::timeout, .text = "no answer"}), "timeout: no answer");
  EXPECT_EQ(describe({.code = Errc::bus, .node = 127}), "node 127: bus");
  EXPECT_EQ(describe({.code = Errc::io, .text = nullptr}), "io");
}

TEST(Result, EveryCodeHasANameOfItsOwn) {
  std::set<std::string> names;
  for (unsigned i = 0; i <= static_cast<unsigned>(Errc::unsupported); ++i) names.insert(name(static_cast<Errc>(i)));
  EXPECT_EQ(names.size(), static_cast<std::size_t>(Errc::unsupported) + 1);
  EXPECT_EQ(names.count("unknown"), 0U);
}

TEST(Result, FailFitsAnyType) {
  const auto f = []() -> Result<std::string> { return fail(Errc::not_found, "x"); };
  const auto g = [&]() -> Result<void> { return fail(f().error()); };
  EXPECT_EQ(g().error().code, Errc::not_found);
}

TEST(Finding, TextAndSeverity) {
  Finding f{.file = "machine.toml",
            .line = 12,
            .column = 3,
            .key = "slot[2].id",
            .message = "200 is not a node-ID",
            .fix = "use 1 to 127"};
  EXPECT_EQ(to_string(f), "machine.toml:12:3: error: slot[2].id: 200 is not a node-ID; use 1 to 127");
  f.severity = Finding::Severity::warning;
  f.column = 0;
  f.key = f.fix = "";
  EXPECT_EQ(to_string(f), "machine.toml:12: warning: 200 is not a node-ID");
  f.line = 0;
  EXPECT_EQ(to_string(f), "machine.toml: warning: 200 is not a node-ID");
  EXPECT_FALSE(has_errors({f}));
  EXPECT_FALSE(has_errors({}));
  Finding error;
  EXPECT_TRUE(has_errors({f, error}));
}

TEST(NodeId, OnlyOneTo127And255) {
  for (unsigned v = 0; v < 600; ++v) EXPECT_EQ(NodeId::make(v).has_value(), (v >= 1 && v <= 127) || v == 255) << v;
  EXPECT_FALSE(NodeId().configured());
  EXPECT_FALSE(NodeId::make(255)->configured());
  EXPECT_TRUE(NodeId(1).configured());
}

// S1.11, S1.27: the order of addresses is that of RAND's search, and R_SN's is revision before serial.
TEST(LssAddress, OrderIsBigEndianOverTheWholeAddress) {
  Random random(1);
  for (int i = 0; i < 2000; ++i) {
    const auto draw = [&] { return static_cast<std::uint32_t>(random.below(3) << (random.below(2) * 31)); };
    const LssAddress a{draw(), draw(), draw(), draw()}, b{draw(), draw(), draw(), draw()};
    std::array<std::uint16_t, 8> x{}, y{};
    for (unsigned k = 0; k < 8; ++k) {
      x[k] = a.chunk(k);
      y[k] = b.chunk(k);
    }
    EXPECT_EQ(a < b, x < y);
    EXPECT_EQ(a.r_sn() < b.r_sn(), a.r_sn().value() < b.r_sn().value());
  }
  EXPECT_EQ((R_SN{0x00020006, 0xFEEDF00D}.value()), 0x00020006FEEDF00DULL);
}

TEST(LssAddress, RandomTextRoundTripAndGarbage) {
  Random random(2);
  constexpr std::string_view letters = "0123456789abcdefABCDEFxX- ";
  for (int i = 0; i < 5000; ++i) {
    const auto draw = [&] { return static_cast<std::uint32_t>(random.next()); };
    const LssAddress a{draw(), draw(), draw(), draw()};
    ASSERT_EQ(parse_lss_address(to_string(a)), a);
    std::string text = to_string(a);
    text[random.below(text.size())] = letters[random.below(letters.size())];
    if (const auto read = parse_lss_address(text)) {
      ASSERT_EQ(parse_lss_address(to_string(*read)), read) << text;
    }
  }
}

TEST(NmtState, CodesOfTheStandard) {  // CiA 301 §7.2.8.3.2
  EXPECT_EQ(static_cast<int>(NmtState::stopped), 4);
  EXPECT_EQ(static_cast<int>(NmtState::operational), 5);
  EXPECT_EQ(static_cast<int>(NmtState::pre_operational), 127);
  EXPECT_STREQ(name(NmtState::pre_operational), "pre-operational");
  EXPECT_STREQ(name(static_cast<NmtState>(9)), "unknown");
}

TEST(Bytes, LittleEndian) {
  std::uint8_t bytes[9] = {};
  store_le<std::uint32_t>(bytes + 1, 0x12345678);
  EXPECT_EQ(bytes[1], 0x78);
  EXPECT_EQ(bytes[4], 0x12);
  EXPECT_EQ(load_le<std::uint32_t>(bytes + 1), 0x12345678U);
  EXPECT_EQ(load_le<std::uint16_t>(bytes + 3), 0x1234U);
  store_le<std::uint64_t>(bytes + 1, 0x8877665544332211ULL);
  EXPECT_EQ(load_le<std::uint64_t>(bytes + 1), 0x8877665544332211ULL);
  EXPECT_EQ(load_le<std::uint8_t>(bytes + 8), 0x88);
}

TEST(Crc, InPartsAsInOne) {
  Random random(3);
  std::vector<std::uint8_t> bytes(300);
  for (auto& b : bytes) b = static_cast<std::uint8_t>(random.next());
  const std::span<const std::uint8_t> all(bytes);
  for (std::size_t cut = 0; cut <= bytes.size(); ++cut) {
    EXPECT_EQ(crc16(all.subspan(cut), crc16(all.first(cut))), crc16(all));
    EXPECT_EQ(crc32(all.subspan(cut), crc32(all.first(cut))), crc32(all));
  }
  EXPECT_EQ(crc16({}), 0);
  EXPECT_EQ(crc32({}), 0U);
}

// xoshiro256** seeded by splitmix64 from 0: the numbers that other implementations of the two give.
TEST(Random, IsTheGeneratorItSaysItIs) {
  Random random(0);
  EXPECT_EQ(random.next(), 11091344671253066420ULL);
  EXPECT_EQ(random.next(), 13793997310169335082ULL);
  EXPECT_EQ(random.next(), 1900383378846508768ULL);
  EXPECT_EQ(random.next(), 7684712102626143532ULL);
}

TEST(Random, BoundsHold) {
  Random random(4);
  std::set<std::int64_t> seen;
  for (int i = 0; i < 2000; ++i) {
    const auto v = random.between(-3, 3);
    EXPECT_TRUE(v >= -3 && v <= 3);
    seen.insert(v);
    EXPECT_LT(random.below(7), 7U);
  }
  EXPECT_EQ(seen.size(), 7U);
  EXPECT_EQ(random.below(0), 0U);
  EXPECT_EQ(random.between(5, 5), 5);
  EXPECT_EQ(random.between(5, 4), 5);
  EXPECT_FALSE(random.chance(0));
  EXPECT_TRUE(random.chance(1'000'000));
}

TEST(Random, BetweenTheExtremes) {
  Random random(5);
  int negative = 0;
  for (int i = 0; i < 1000; ++i) {
    EXPECT_LE(random.between(INT64_MIN, INT64_MIN + 1), INT64_MIN + 1);
    EXPECT_GE(random.between(INT64_MAX - 1, INT64_MAX), INT64_MAX - 1);
    negative += random.between(INT64_MIN, INT64_MAX) < 0 ? 1 : 0;
  }
  EXPECT_GT(negative, 400);
  EXPECT_LT(negative, 600);
}

TEST(Random, AForkDoesNotDependOnWhatComesAfter) {
  Random a(9), b(9);
  Random fork_a = a.fork(), fork_b = b.fork();
  a.next();
  for (int i = 0; i < 10; ++i) EXPECT_EQ(fork_a.next(), fork_b.next());
}

}  // namespace
