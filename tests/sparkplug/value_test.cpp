// Data types and values: ranges, arrays as the standard's examples have them, raw integers in any width.
#include "berth/sparkplug/value.hpp"

#include <gtest/gtest.h>

#include <limits>

#include "berth/sparkplug/payload.hpp"

namespace {

using namespace berth;
using namespace berth::sparkplug;

// SP.191, SP.192: the type is a number of the standard's table.
TEST(SparkplugValue, TypesHaveTheNumbersOfTheStandard) {
  EXPECT_EQ(static_cast<int>(DataType::int8), 1);
  EXPECT_EQ(static_cast<int>(DataType::uint8), 5);
  EXPECT_EQ(static_cast<int>(DataType::float32), 9);
  EXPECT_EQ(static_cast<int>(DataType::boolean), 11);
  EXPECT_EQ(static_cast<int>(DataType::date_time), 13);
  EXPECT_EQ(static_cast<int>(DataType::uuid), 15);
  EXPECT_EQ(static_cast<int>(DataType::template_type), 19);
  EXPECT_EQ(static_cast<int>(DataType::property_set_list), 21);
  EXPECT_EQ(static_cast<int>(DataType::int8_array), 22);
  EXPECT_EQ(static_cast<int>(DataType::date_time_array), 34);
  EXPECT_STREQ(name(DataType::uint64), "UInt64");
  EXPECT_STREQ(name(DataType::float32), "Float");
  EXPECT_EQ(data_type(34), DataType::date_time_array);
  EXPECT_EQ(data_type(35), DataType::unknown);
  EXPECT_EQ(data_type(0xFFFF'FFFF), DataType::unknown);
  EXPECT_FALSE(is_metric_type(DataType::property_set));
  EXPECT_FALSE(is_metric_type(DataType::unknown));
  EXPECT_TRUE(is_metric_type(DataType::string_array));
}

TEST(SparkplugValue, AValueFitsItsTypesRange) {
  EXPECT_TRUE(fits(DataType::int8, std::int64_t{-128}));
  EXPECT_FALSE(fits(DataType::int8, std::int64_t{128}));
  EXPECT_TRUE(fits(DataType::int64, std::numeric_limits<std::int64_t>::min()));
  EXPECT_TRUE(fits(DataType::uint16, std::uint64_t{65535}));
  EXPECT_FALSE(fits(DataType::uint16, std::uint64_t{65536}));
  EXPECT_FALSE(fits(DataType::uint16, std::int64_t{5}));
  EXPECT_TRUE(fits(DataType::boolean, true));
  EXPECT_FALSE(fits(DataType::boolean, std::uint64_t{1}));
  EXPECT_TRUE(fits(DataType::text, std::string("\xC3\xA4")));
  EXPECT_FALSE(fits(DataType::text, std::string("\xC3")));
  EXPECT_TRUE(fits(DataType::file, Bytes{1}));
  EXPECT_TRUE(fits(DataType::string, Null{}));
  EXPECT_FALSE(fits(DataType::string, Unsupported{}));
  EXPECT_FALSE(fits(DataType::uint8_array, Boxed<Array>(std::vector<std::uint64_t>{1, 256})));
  EXPECT_FALSE(fits(DataType::string_array, Boxed<Array>(std::vector<std::string>{std::string("a\0b", 3)})));
}

TEST(SparkplugValue, RawIntegersInAnyWidth) {
  for (const std::uint64_t raw : {0xFFULL, 0xFFFF'FFFFULL, 0xFFFF'FFFF'FFFF'FFFFULL}) {
    EXPECT_EQ(interpret(DataType::int8, raw), Value(std::int64_t{-1})) << raw;
  }
  EXPECT_EQ(interpret(DataType::int8, std::uint64_t{0x80}), Value(std::int64_t{-128}));
  EXPECT_EQ(interpret(DataType::int8, std::uint64_t{0x7F}), Value(std::int64_t{127}));
  EXPECT_TRUE(std::holds_alternative<Unsupported>(interpret(DataType::int8, std::uint64_t{0x100})));
  EXPECT_TRUE(std::holds_alternative<Unsupported>(interpret(DataType::int8, std::uint64_t{0xFFFF'FF00})));
  EXPECT_EQ(interpret(DataType::int32, std::uint64_t{0x8000'0000}), Value(std::int64_t{-2147483648LL}));
  EXPECT_EQ(interpret(DataType::int64, ~std::uint64_t{0}), Value(std::int64_t{-1}));
  EXPECT_EQ(interpret(DataType::uint32, std::uint64_t{0xFFFF'FFFF}), Value(std::uint64_t{0xFFFF'FFFF}));
  EXPECT_TRUE(std::holds_alternative<Unsupported>(interpret(DataType::uint32, std::uint64_t{0x1'0000'0000})));
  EXPECT_TRUE(std::holds_alternative<Unsupported>(interpret(DataType::uint8, std::string("5"))));
  EXPECT_TRUE(std::holds_alternative<Unsupported>(interpret(DataType::unknown, std::uint64_t{5})));
  EXPECT_EQ(interpret(DataType::uint8, std::int64_t{5}), Value(std::uint64_t{5}));
  EXPECT_TRUE(std::holds_alternative<Unsupported>(interpret(DataType::uint8, std::int64_t{-5})));
}

TEST(SparkplugValue, NotANumberEqualsItself) {
  const Value nan = std::numeric_limits<double>::quiet_NaN();
  EXPECT_TRUE(same(nan, nan));
  EXPECT_FALSE(same(0.0, -0.0));
  EXPECT_FALSE(same(Value(1.0F), Value(1.0)));
  const Value list = Boxed<Array>(std::vector<double>{std::numeric_limits<double>::quiet_NaN()});
  EXPECT_TRUE(same(list, Value(Boxed<Array>(std::vector<double>{std::numeric_limits<double>::quiet_NaN()}))));
}

struct Packed {
  DataType type;
  Array array;
  Bytes bytes;
};
// §6.4.16, the examples of its own text; FloatArray, DoubleArray and DateTimeArray as its rule has them.
const std::vector<Packed>& packed() {
  static const std::vector<Packed> all{
      {DataType::int8_array, std::vector<std::int64_t>{-23, 123}, {0xE9, 0x7B}},  // the text has EFh, which is -17
      {DataType::int16_array, std::vector<std::int64_t>{-30000, 30000}, {0xD0, 0x8A, 0x30, 0x75}},
      {DataType::int32_array,
       std::vector<std::int64_t>{-1, 315338746},
       {0xFF, 0xFF, 0xFF, 0xFF, 0xFA, 0xAF, 0xCB, 0x12}},
      {DataType::int64_array,
       std::vector<std::int64_t>{-4270929666821191986, -3601064768563266876},
       {0xCE, 0x06, 0x72, 0xAC, 0x18, 0x9C, 0xBA, 0xC4, 0xC4, 0xBA, 0x9C, 0x18, 0xAC, 0x72, 0x06, 0xCE}},
      {DataType::uint8_array, std::vector<std::uint64_t>{23, 250}, {0x17, 0xFA}},
      {DataType::uint16_array, std::vector<std::uint64_t>{30, 52360}, {0x1E, 0x00, 0x88, 0xCC}},
      {DataType::uint32_array, std::vector<std::uint64_t>{52, 3293969225}, {0x34, 0, 0, 0, 0x49, 0xFB, 0x55, 0xC4}},
      {DataType::uint64_array,
       std::vector<std::uint64_t>{52, 16444743074749521625ULL},
       {0x34, 0, 0, 0, 0, 0, 0, 0, 0xD9, 0x9E, 0x02, 0xD1, 0xB2, 0x76, 0x37, 0xE4}},
      {DataType::float_array, std::vector<float>{1.23F, 89.341F}, {0xA4, 0x70, 0x9D, 0x3F, 0x98, 0xAE, 0xB2, 0x42}},
      {DataType::double_array,
       std::vector<double>{12.354213, 1022.9123213},
       {0xD7, 0xA2, 0x05, 0x68, 0x5B, 0xB5, 0x28, 0x40, 0x8E, 0x17, 0x1C, 0x6F, 0x4C, 0xF7, 0x8F, 0x40}},
      {DataType::boolean_array,
       std::vector<bool>{false, false, true, true, false, true, false, false, true, true, false, true},
       {0x0C, 0, 0, 0, 0x34, 0xD0}},
      {DataType::string_array,
       std::vector<std::string>{"ABC", "hello"},
       {0x41, 0x42, 0x43, 0x00, 0x68, 0x65, 0x6C, 0x6C, 0x6F, 0x00}},
      {DataType::date_time_array,
       std::vector<std::uint64_t>{1256102875335, 1656107875000},
       {0xC7, 0xD0, 0x90, 0x75, 0x24, 0x01, 0, 0, 0xB8, 0xBA, 0xB8, 0x97, 0x81, 0x01, 0, 0}}};
  return all;
}

TEST(SparkplugValue, ArraysAsTheStandardsExamples) {
  for (const auto& each : packed()) {
    EXPECT_EQ(pack(each.type, each.array), each.bytes) << name(each.type);
    const auto back = unpack(each.type, each.bytes);
    ASSERT_TRUE(back) << name(each.type);
    EXPECT_EQ(*back, each.array) << name(each.type);
    EXPECT_TRUE(fits(each.type, Boxed<Array>(each.array))) << name(each.type);
  }
}

TEST(SparkplugValue, ArraysThatAreNotWhole) {
  EXPECT_FALSE(unpack(DataType::int32_array, {1, 2, 3}));
  EXPECT_FALSE(unpack(DataType::boolean_array, {9, 0, 0, 0, 0xFF}));
  EXPECT_FALSE(unpack(DataType::boolean_array, {1, 0, 0}));
  EXPECT_FALSE(unpack(DataType::boolean_array, {0xFF, 0xFF, 0xFF, 0xFF, 1}));
  EXPECT_FALSE(unpack(DataType::string_array, {'a'}));
  EXPECT_FALSE(unpack(DataType::string_array, {0xFF, 0}));
  EXPECT_FALSE(unpack(DataType::string, {'a'}));
  EXPECT_TRUE(std::holds_alternative<Unsupported>(interpret(DataType::int32_array, Bytes{1, 2, 3})));
}

TEST(SparkplugValue, Utf8) {
  for (const auto* good :
       {"", "a", "\xC2\x80", "\xE0\xA0\x80", "\xED\x9F\xBF", "\xF0\x90\x80\x80", "\xF4\x8F\xBF\xBF"}) {
    EXPECT_TRUE(is_utf8(good)) << good;
  }
  for (const auto* bad : {"\x80", "\xC1\xBF", "\xC2", "\xE0\x9F\xBF", "\xED\xA0\x80", "\xF0\x8F\xBF\xBF",
                          "\xF4\x90\x80\x80", "\xF5\x80\x80\x80", "\xE2\x82", "\xC2\x41"}) {
    EXPECT_FALSE(is_utf8(bad)) << bad;
  }
}

}  // namespace
