#include "berth/od/data_type.hpp"

#include <gtest/gtest.h>
#include <rapidcheck/gtest.h>
#include <cmath>
#include <cstdint>
#include <cstring>
#include <limits>
#include <map>
#include <optional>
#include <string>
#include <vector>

#include "berth/od/abort_code.hpp"

namespace {

using namespace berth::od;

std::vector<std::uint8_t> encode(DataType type, std::uint64_t raw) {
  std::vector<std::uint8_t> bytes(byte_size(type));
  store(type, raw, bytes.data());
  return bytes;
}

/// What a text means for a type, as bytes; the expected bytes in the tests below are written by hand.
std::vector<std::uint8_t> bytes_of(DataType type, std::string_view text) {
  const auto parsed = parse(type, text);
  if (!parsed) throw std::runtime_error(std::string(text) + ": " + parsed.error().what);
  return parsed->value.kind == Literal::Kind::bytes ? parsed->value.bytes : encode(type, parsed->value.raw);
}

using Bytes = std::vector<std::uint8_t>;

TEST(DataTypes, EveryTypeOfCia301WithItsIndexAndLength) {
  // docs/protocols/cia301.md §Data types: index -> bits (0 = variable).
  const std::map<int, unsigned> table{
      {0x01, 1},  {0x02, 8},  {0x03, 16}, {0x04, 32}, {0x05, 8},  {0x06, 16}, {0x07, 32}, {0x08, 32}, {0x09, 0},
      {0x0A, 0},  {0x0B, 0},  {0x0C, 48}, {0x0D, 48}, {0x0F, 0},  {0x10, 24}, {0x11, 64}, {0x12, 40}, {0x13, 48},
      {0x14, 56}, {0x15, 64}, {0x16, 24}, {0x18, 40}, {0x19, 48}, {0x1A, 56}, {0x1B, 64}};
  EXPECT_EQ(all_data_types().size(), table.size());
  for (int index = 0; index < 0x100; ++index) {
    const auto type = static_cast<DataType>(index);
    ASSERT_EQ(known(type), table.contains(index)) << index;
    if (!known(type)) continue;
    EXPECT_EQ(bit_length(type), table.at(index)) << index;
    EXPECT_EQ(data_type(name(type)), type);
  }
  EXPECT_FALSE(data_type("UNSIGNED33"));
  EXPECT_EQ(data_type("u32"), DataType::unsigned32);
}

TEST(DataTypes, BytesOnTheWireAreLittleEndian) {
  EXPECT_EQ(encode(DataType::unsigned24, 0x123456), (Bytes{0x56, 0x34, 0x12}));
  EXPECT_EQ(encode(DataType::integer40, static_cast<std::uint64_t>(-2)), (Bytes{0xFE, 0xFF, 0xFF, 0xFF, 0xFF}));
  EXPECT_EQ(bytes_of(DataType::real32, "1.0"), (Bytes{0x00, 0x00, 0x80, 0x3F}));
  EXPECT_EQ(bytes_of(DataType::real64, "-2"), (Bytes{0, 0, 0, 0, 0, 0, 0, 0xC0}));
  EXPECT_EQ(bytes_of(DataType::time_of_day, "2 65536"), (Bytes{0, 0, 1, 0, 2, 0}));
  EXPECT_EQ(bytes_of(DataType::unicode_string, "00412713"), (Bytes{0x41, 0x00, 0x13, 0x27}));
  EXPECT_EQ(bytes_of(DataType::unicode_string, "ab\xE2\x9C\x93"), (Bytes{'a', 0, 'b', 0, 0x13, 0x27}));
  EXPECT_EQ(bytes_of(DataType::unicode_string, "\xF0\x9F\x98\x80!"), (Bytes{0x3D, 0xD8, 0x00, 0xDE, '!', 0}));
  EXPECT_EQ(bytes_of(DataType::octet_string, "C8 3dBB"), (Bytes{0xC8, 0x3D, 0xBB}));
  EXPECT_EQ(bytes_of(DataType::domain, "@ABCD"), (Bytes{'@', 'A', 'B', 'C', 'D'}));
  EXPECT_EQ(bytes_of(DataType::visible_string, "a b"), (Bytes{'a', ' ', 'b'}));
}

TEST(DataTypes, NumbersByWidth) {
  struct Case {
    DataType type;
    std::string_view text;
    std::optional<std::uint64_t> raw;
  };
  const auto minus = [](std::int64_t value) { return static_cast<std::uint64_t>(value); };
  const std::vector<Case> cases{
      {DataType::unsigned8, "255", 255},
      {DataType::unsigned8, "256", std::nullopt},
      {DataType::unsigned8, "-1", 255},
      {DataType::unsigned8, "-128", 128},
      {DataType::unsigned8, "-129", std::nullopt},
      {DataType::integer8, "127", 127},
      {DataType::integer8, "0x80", minus(-128)},
      {DataType::integer8, "255", minus(-1)},
      {DataType::integer8, "256", std::nullopt},
      {DataType::integer8, "-128", minus(-128)},
      {DataType::integer8, "-129", std::nullopt},
      {DataType::integer32, "0x80000000", minus(-2147483648LL)},
      {DataType::unsigned32, "0x1FFFFFFFF", std::nullopt},
      {DataType::unsigned24, "0xFFFFFF", 0xFFFFFF},
      {DataType::unsigned24, "0x1000000", std::nullopt},
      {DataType::integer56, "-0x80000000000000", minus(-36028797018963968LL)},
      {DataType::unsigned64, "18446744073709551615", ~0ULL},
      {DataType::unsigned64, "18446744073709551616", std::nullopt},
      {DataType::integer64, "-9223372036854775808", 1ULL << 63U},
      {DataType::integer64, "-9223372036854775809", std::nullopt},
      {DataType::unsigned16, "010", 8},
      {DataType::unsigned16, "0X10", 16},
      {DataType::unsigned16, "08", std::nullopt},
      {DataType::unsigned16, "12zz", std::nullopt},
      {DataType::unsigned16, "0xGG", std::nullopt},
      {DataType::unsigned16, "0x", std::nullopt},
      {DataType::unsigned16, "+5", 5},
      {DataType::unsigned16, "--5", std::nullopt},
      {DataType::unsigned16, "5 6", std::nullopt},
      {DataType::unsigned16, "1.5", std::nullopt},
      {DataType::boolean, "1", 1},
      {DataType::boolean, "2", std::nullopt},
      {DataType::boolean, "-1", std::nullopt},
  };
  for (const auto& each : cases) {
    const auto parsed = parse(each.type, each.text);
    ASSERT_EQ(parsed.has_value(), each.raw.has_value()) << each.text;
    if (!each.raw) continue;
    EXPECT_EQ(parsed->value.raw, *each.raw) << each.text;
  }
}

TEST(DataTypes, ErrorsSayWhere) {
  EXPECT_EQ(parse(DataType::unsigned32, "12zz").error().at, 2U);
  EXPECT_EQ(parse(DataType::unsigned32, "0xGG").error().at, 2U);
  EXPECT_EQ(parse(DataType::unsigned32, "$NODEIX").error().at, 0U);
  EXPECT_EQ(parse(DataType::unsigned32, "$NODEID*2").error().at, 7U);
  EXPECT_EQ(parse(DataType::real32, "1,5").error().at, 1U);
}

TEST(DataTypes, NodeIdExpressions) {
  for (const std::string_view text : {"$NODEID+0x180", "$nodeid + 0x180", "0x180+$NODEID", "384 + $NodeId"}) {
    const auto parsed = parse(DataType::unsigned32, text);
    ASSERT_TRUE(parsed) << text;
    EXPECT_EQ(parsed->value, Literal::node_id_plus(0x180)) << text;
    EXPECT_EQ(parsed->notes.has(Note::node_id_last), text[0] != '$') << text;
    EXPECT_EQ(parsed->value.resolve(DataType::unsigned32, 5), 0x185U);
    EXPECT_EQ(parsed->value.resolve(DataType::unsigned32, 255), 0x180U) << "an unconfigured node-ID counts as 0";
  }
  EXPECT_EQ(parse(DataType::unsigned32, "$NODEID")->value, Literal::node_id_plus(0));
  EXPECT_EQ(parse(DataType::unsigned32, "$NODEID-1")->value.resolve(DataType::unsigned32, 5), 4U);
  EXPECT_FALSE(parse(DataType::unsigned32, "$NODEID+"));
  EXPECT_FALSE(parse(DataType::unsigned32, "$NODEID+$NODEID"));
  EXPECT_FALSE(parse(DataType::unsigned32, "5+5"));
  EXPECT_FALSE(parse(DataType::real32, "$NODEID"));
}

RC_GTEST_PROP(DataTypes, AnyScalarSurvivesBytesAndText, ()) {
  const auto all = all_data_types();
  const auto type = *rc::gen::elementOf(std::vector<DataType>(all.begin(), all.end()));
  RC_PRE(byte_size(type) != 0);
  const auto word = *rc::gen::weightedOneOf<std::uint64_t>(
      {{3, rc::gen::arbitrary<std::uint64_t>()}, {1, rc::gen::map(rc::gen::inRange(0U, 64U), [](unsigned bit) {
                                                    return (std::uint64_t{1} << bit) - (bit % 2);
                                                  })}});
  const std::uint64_t raw = wrap(type, type == DataType::boolean ? word & 1U : word);
  const Bytes bytes = encode(type, raw);
  RC_ASSERT(load(type, bytes.data()) == raw);
  RC_ASSERT(bytes_of(type, print(type, bytes)) == bytes);
}

RC_GTEST_PROP(DataTypes, AnyDoubleAndFloatSurviveTheirText, (double value)) {
  RC_ASSERT(real_of(DataType::real64, raw_of(DataType::real64, value)) == value);
  for (const auto type : {DataType::real32, DataType::real64}) {
    const Bytes bytes = encode(type, raw_of(type, value));
    RC_ASSERT(bytes_of(type, print(type, bytes)) == bytes);
  }
}

RC_GTEST_PROP(DataTypes, AnyBytesSurviveAsStringsAndDomain, (Bytes bytes)) {
  for (const auto type : {DataType::octet_string, DataType::domain}) {
    const auto text = print(type, bytes);
    RC_ASSERT(text.size() == 2 * bytes.size());
    if (!bytes.empty()) RC_ASSERT(bytes_of(type, text) == bytes);
  }
  bytes.resize(bytes.size() / 2 * 2);
  if (!bytes.empty()) RC_ASSERT(bytes_of(DataType::unicode_string, print(DataType::unicode_string, bytes)) == bytes);
}

RC_GTEST_PROP(DataTypes, AnyTextIsReadOrRefusedAndNeverCrashes, (std::string text)) {
  for (const auto type : all_data_types()) {
    const auto parsed = parse(type, text);
    if (!parsed) RC_ASSERT(parsed.error().at <= text.size());
  }
}

RC_GTEST_PROP(DataTypes, NumbersInEveryBase, (std::int64_t value)) {
  const auto text = std::to_string(value);
  RC_ASSERT(parse(DataType::integer64, text)->value.raw == static_cast<std::uint64_t>(value));
  std::array<char, 40> buffer{};
  std::snprintf(buffer.data(), buffer.size(), "0x%llx", static_cast<unsigned long long>(value));
  RC_ASSERT(parse(DataType::unsigned64, buffer.data())->value.raw == static_cast<std::uint64_t>(value));
  std::snprintf(buffer.data(), buffer.size(), "0%llo", static_cast<unsigned long long>(value));
  RC_ASSERT(parse(DataType::unsigned64, buffer.data())->value.raw == static_cast<std::uint64_t>(value));
}

TEST(DataTypes, CompareByMeaning) {
  const auto i = [](int value) { return static_cast<std::uint64_t>(static_cast<std::int64_t>(value)); };
  EXPECT_EQ(compare(DataType::integer16, i(-1), i(1)), -1);
  EXPECT_EQ(compare(DataType::unsigned64, ~0ULL, 1), 1);
  EXPECT_EQ(compare(DataType::real32, raw_of(DataType::real32, -1), raw_of(DataType::real32, 1)), -1);
  EXPECT_EQ(compare(DataType::real64, raw_of(DataType::real64, std::nan("")), 0), 2);
  EXPECT_EQ(compare(DataType::time_of_day, (1ULL << 32U), 5), 1) << "a day outweighs milliseconds";
}

TEST(AbortCodes, EveryCodeOfThePageHasItsText) {
  // docs/protocols/cia301.md §Abort codes.
  const std::vector<std::uint32_t> page{
      0x05030000, 0x05040000, 0x05040001, 0x05040002, 0x05040003, 0x05040004, 0x05040005, 0x06010000,
      0x06010001, 0x06010002, 0x06020000, 0x06040041, 0x06040042, 0x06040043, 0x06040047, 0x06060000,
      0x06070010, 0x06070012, 0x06070013, 0x06090011, 0x06090030, 0x06090031, 0x06090032, 0x06090036,
      0x060A0023, 0x08000000, 0x08000020, 0x08000021, 0x08000022, 0x08000023, 0x08000024};
  std::vector<std::uint32_t> ours;
  for (const auto code : all_abort_codes()) {
    ours.push_back(static_cast<std::uint32_t>(code));
    EXPECT_STRNE(text(code), "unknown abort code");
  }
  EXPECT_EQ(ours, page);
  EXPECT_STREQ(text(static_cast<AbortCode>(0x12345678)), "unknown abort code");
  EXPECT_FALSE(known(AbortCode::none));
  const auto error = to_error(AbortCode::no_object, {0x1018, 2}, 5);
  EXPECT_EQ(berth::describe(error).find("06020000") != std::string::npos, true) << berth::describe(error);
}

}  // namespace
