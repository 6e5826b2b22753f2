// Payloads on the wire: bytes by hand, every form there and back, what is refused and what is kept as unsupported.
#include "berth/sparkplug/codec.hpp"

#include <gtest/gtest.h>
#include <rapidcheck/gtest.h>

#include <string>

namespace {

using namespace berth;
using namespace berth::sparkplug;

Bytes bytes_of(const std::string& text) { return {text.begin(), text.end()}; }
std::string field(int number, const std::string& content) {
  return std::string(1, static_cast<char>(number << 3 | 2)) + static_cast<char>(content.size()) + content;
}
/// A payload with this one metric.
Bytes with(const std::string& metric) { return bytes_of(field(2, metric)); }
bool unsupported(const Result<Payload>& payload) {
  return payload && payload->metrics.size() == 1 && std::holds_alternative<Unsupported>(payload->metrics[0].value);
}

// SP.191: the type is field 4, a plain number.
TEST(SparkplugCodec, TheBytesOfAPayload) {
  Payload payload;
  payload.at = Utc{1};
  payload.seq = 5;
  Metric metric;
  metric.name = "a";
  metric.alias = 2;
  metric.at = Utc{300};
  metric.type = DataType::int8;
  metric.value = std::int64_t{-1};
  metric.historical = true;
  payload.metrics.push_back(metric);
  const Bytes expected{0x08, 0x01,                                      // timestamp 1
                       0x12, 0x12,                                      // metric
                       0x0A, 0x01, 'a',  0x10, 0x02, 0x18, 0xAC, 0x02,  // name, alias, timestamp 300
                       0x20, 0x01, 0x28, 0x01,                          // datatype 1, is_historical
                       0x50, 0xFF, 0xFF, 0xFF, 0xFF, 0x0F,              // int_value FFFFFFFFh
                       0x18, 0x05};                                     // seq 5
  EXPECT_EQ(encode(payload), expected);
  const auto back = decode(expected);
  ASSERT_TRUE(back);
  EXPECT_EQ(*back, payload);
}

// SP.157 and SP.161 on the wire: a null metric has is_null and no value.
TEST(SparkplugCodec, NullHasNoValue) {
  Payload payload;
  Metric metric;
  metric.alias = 1;
  metric.type = DataType::string;
  payload.metrics.push_back(metric);
  EXPECT_EQ(encode(payload), (Bytes{0x12, 0x06, 0x10, 0x01, 0x20, 0x0C, 0x38, 0x01}));
  EXPECT_EQ(*decode(encode(payload)), payload);
}

// SP.191, SP.192: a number that is no type of the standard is kept as unknown.
TEST(SparkplugCodec, UnknownTypesAreKeptAside) {
  const auto odd =
      decode(with("\x0A\x01"
                  "a\x20\x63\x50\x05"));
  ASSERT_TRUE(unsupported(odd));
  EXPECT_EQ(odd->metrics[0].type, DataType::unknown);
  EXPECT_EQ(odd->metrics[0].name, "a");
}

TEST(SparkplugCodec, WhatIsKeptAsUnsupported) {
  EXPECT_TRUE(unsupported(decode(with(std::string("\x0A\x01"
                                                  "a") +
                                      "\x9A\x01\x02\x08\x01"))))
      << "extension";
  EXPECT_TRUE(
      unsupported(decode(with("\x0A\x01"
                              "a"))))
      << "neither value nor null";
  EXPECT_TRUE(
      unsupported(decode(with("\x0A\x01"
                              "a\x20\x0C\x7A\x01\xFF"))))
      << "string, no UTF-8";
  EXPECT_TRUE(
      unsupported(decode(with("\x0A\x01"
                              "a\x20\x01\x50\xAC\x02"))))
      << "Int8 300";
  EXPECT_TRUE(
      unsupported(decode(with("\x0A\x01"
                              "a\x20\x0B\x50\x01"))))
      << "Boolean as int";
  EXPECT_TRUE(
      unsupported(decode(with("\x0A\x01"
                              "a\x20\x18\x82\x01\x01\x01"))))
      << "Int32Array of one byte";
  const std::string set =
      "\x08\x01\x12\x01"
      "c\x18\x05";
  EXPECT_FALSE(
      unsupported(decode(with("\x0A\x01"
                              "a\x20\x10\x8A\x01" +
                              std::string(1, char(set.size())) + set))));
  const std::string crooked =
      "\x08\x02\x12\x01"
      "c\x18\x05";
  EXPECT_TRUE(
      unsupported(decode(with("\x0A\x01"
                              "a\x20\x10\x8A\x01" +
                              std::string(1, char(crooked.size())) + crooked))));
  EXPECT_TRUE(unsupported(decode(with(std::string("\x0A\x01"
                                                  "a\x20\x13\x92\x01",
                                                  7) +
                                      '\0'))))
      << "template, neither";
}

// SP.195, SP.196: keys and values that differ in number are not guessed together.
TEST(SparkplugCodec, PropertiesThatDifferInNumber) {
  const auto payload =
      decode(with("\x0A\x01"
                  "a\x4A\x06\x0A\x01k\x0A\x01l\x58\x01"));
  ASSERT_TRUE(payload);
  ASSERT_TRUE(payload->metrics[0].properties);
  ASSERT_EQ(payload->metrics[0].properties->properties.size(), 1U);
  EXPECT_TRUE(std::holds_alternative<Unsupported>(payload->metrics[0].properties->properties[0].value));
}

TEST(SparkplugCodec, WhatIsRefusedSaysWhy) {
  const auto refused = [](const Bytes& bytes, Errc code, const DecodeLimits& limits = {}) {
    const auto payload = decode(bytes, limits);
    return !payload && payload.error().code == code && *payload.error().text != '\0';
  };
  EXPECT_TRUE(refused({0xFF}, Errc::invalid));
  EXPECT_TRUE(refused({0x12, 0x05, 0x00}, Errc::invalid)) << "cut off";
  EXPECT_TRUE(refused(with("\x0A\x01\xFF"), Errc::invalid)) << "name";
  EXPECT_TRUE(refused(Bytes(11, 0x08), Errc::exhausted, {.bytes = 10}));
  EXPECT_TRUE(refused({0x12, 0, 0x12, 0, 0x12, 0}, Errc::exhausted, {.items = 2}));
  EXPECT_TRUE(decode(Bytes{0x12, 0, 0x12, 0}, {.items = 2}));
  std::string nested = "\x28\x01";  // is_definition
  for (int i = 0; i < 20; ++i) nested = field(2, std::string("\x92\x01") + char(nested.size()) + nested);
  EXPECT_TRUE(refused(bytes_of(nested), Errc::invalid)) << "too deep";
  EXPECT_TRUE(decode(Bytes{}));
}

rc::Gen<std::string> text() { return rc::gen::container<std::string>(rc::gen::inRange('a', 'e')); }

rc::Gen<std::pair<DataType, Value>> typed() {
  using Pair = std::pair<DataType, Value>;
  const auto of = [](DataType type, auto gen) {
    return rc::gen::map(gen, [type](auto value) { return Pair(type, Value(std::move(value))); });
  };
  return rc::gen::oneOf(
      of(DataType::int8, rc::gen::map(rc::gen::arbitrary<std::int8_t>(), [](auto v) { return std::int64_t{v}; })),
      of(DataType::int16, rc::gen::map(rc::gen::arbitrary<std::int16_t>(), [](auto v) { return std::int64_t{v}; })),
      of(DataType::int32, rc::gen::map(rc::gen::arbitrary<std::int32_t>(), [](auto v) { return std::int64_t{v}; })),
      of(DataType::int64, rc::gen::arbitrary<std::int64_t>()),
      of(DataType::uint32, rc::gen::map(rc::gen::arbitrary<std::uint32_t>(), [](auto v) { return std::uint64_t{v}; })),
      of(DataType::uint64, rc::gen::arbitrary<std::uint64_t>()),
      of(DataType::date_time, rc::gen::arbitrary<std::uint64_t>()), of(DataType::boolean, rc::gen::arbitrary<bool>()),
      of(DataType::string, text()), of(DataType::uuid, text()), of(DataType::bytes, rc::gen::arbitrary<Bytes>()),
      of(DataType::float64, rc::gen::just(1.25)), of(DataType::float32, rc::gen::just(-0.5F)),
      of(DataType::text, rc::gen::just(Null{})));
}

RC_GTEST_PROP(SparkplugCodec, WhatIsEncodedIsDecoded, ()) {
  Payload payload;
  payload.at = Utc{*rc::gen::arbitrary<std::uint64_t>()};
  payload.seq = *rc::gen::inRange<std::uint64_t>(0, 256);
  const auto values = *rc::gen::container<std::vector<std::pair<DataType, Value>>>(typed());
  for (const auto& [type, value] : values) {
    Metric metric;
    metric.name = *text();
    metric.type = type;
    metric.value = value;
    metric.historical = *rc::gen::arbitrary<bool>();
    metric.transient = *rc::gen::arbitrary<bool>();
    if (*rc::gen::arbitrary<bool>()) metric.alias = *rc::gen::arbitrary<std::uint64_t>();
    if (*rc::gen::arbitrary<bool>()) set_quality(metric, Quality::stale);
    if (*rc::gen::arbitrary<bool>()) {
      metric.metadata.emplace();
      metric.metadata->description = *text();
    }
    payload.metrics.push_back(std::move(metric));
  }
  const auto back = decode(encode(payload));
  RC_ASSERT(back.has_value());
  RC_ASSERT(*back == payload);
}

// SP.194: without a type integers are raw; the birth's type makes them what they were.
RC_GTEST_PROP(SparkplugCodec, WithoutItsTypeAValueIsRaw, ()) {
  const auto [type, value] = *typed();
  Payload payload;
  Metric metric;
  metric.alias = 1;
  metric.type = type;
  metric.value = value;
  payload.metrics.push_back(metric);
  auto bytes = encode(payload);
  // datatype is field 4, and all of these types are below 128: take its two bytes out.
  const auto at = std::find(bytes.begin() + 2, bytes.end(), std::uint8_t{0x20});
  bytes.erase(at, at + 2);
  RC_PRE(bytes[1] < 0x80);
  bytes[1] = static_cast<std::uint8_t>(bytes[1] - 2);
  const auto back = decode(bytes);
  RC_ASSERT(back.has_value());
  RC_ASSERT(!back->metrics.at(0).type.has_value());
  RC_ASSERT(interpret(type, back->metrics.at(0).value) == value);
}

}  // namespace
