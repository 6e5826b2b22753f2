// C++ types against CANopen types.
#include <gtest/gtest.h>
#include <rapidcheck/gtest.h>
#include <cmath>
#include <cstdint>
#include <limits>
#include <string>

#include "../pch.hpp"
#include "berth/client/value.hpp"

namespace berth::client::test {
namespace {

using od::DataType;

Complaint encode(Input value, DataType type) {
  Bytes bytes;
  return value.encode(type, bytes);
}
Bytes bytes_of(Input value, DataType type) {
  Bytes bytes;
  EXPECT_EQ(value.encode(type, bytes).what, nullptr);
  return bytes;
}

// What is read must hold every value of the type: by its least and greatest value, for all pairs.
template <class T>
void check_integers() {
  for (const auto type : od::all_data_types()) {
    if (!od::is_integer(type)) continue;
    const unsigned bits = od::bit_length(type);
    const bool is_signed = od::is_signed(type);
    const auto least = is_signed ? -std::ldexp(1.0, static_cast<int>(bits) - 1) : 0.0;
    const auto greatest = std::ldexp(1.0, static_cast<int>(is_signed ? bits - 1 : bits)) - 1;
    const bool fits = least >= static_cast<double>(std::numeric_limits<T>::min()) &&
                      greatest <= static_cast<double>(std::numeric_limits<T>::max());
    const bool u64_in_i64 = bits == 64 && !is_signed && std::is_signed_v<T>;  // equal as doubles
    EXPECT_EQ(readable_as(type, cpp_type<T>()), fits && !u64_in_i64) << od::name(type) << " " << cpp_type<T>().name;
  }
}

TEST(ClientValue, IntegersThatHoldTheType) {
  check_integers<std::int8_t>();
  check_integers<std::uint8_t>();
  check_integers<std::int16_t>();
  check_integers<std::uint16_t>();
  check_integers<std::int32_t>();
  check_integers<std::uint32_t>();
  check_integers<std::int64_t>();
  check_integers<std::uint64_t>();
}

TEST(ClientValue, TheBestTypeIsReadable) {
  EXPECT_STREQ(best_cpp_type(DataType::boolean), "bool");
  EXPECT_STREQ(best_cpp_type(DataType::integer24), "std::int32_t");
  EXPECT_STREQ(best_cpp_type(DataType::unsigned40), "std::uint64_t");
  EXPECT_STREQ(best_cpp_type(DataType::unsigned8), "std::uint8_t");
  EXPECT_STREQ(best_cpp_type(DataType::real32), "float");
  EXPECT_STREQ(best_cpp_type(DataType::visible_string), "std::string");
  EXPECT_STREQ(best_cpp_type(DataType::time_of_day), "co::TimeOfDay");
  EXPECT_STREQ(best_cpp_type(DataType::domain), "Bytes");
  EXPECT_STREQ(best_cpp_type(static_cast<DataType>(0x40)), "Bytes");
}

TEST(ClientValue, RangesAtTheirEdges) {
  for (const auto type : od::all_data_types()) {
    if (!od::is_signed(type)) continue;
    const unsigned bits = od::bit_length(type);
    const auto most = static_cast<std::int64_t>((std::uint64_t{1} << (bits - 1)) - 1);
    EXPECT_EQ(encode(most, type).what, nullptr) << od::name(type);
    EXPECT_EQ(encode(-most - 1, type).what, nullptr) << od::name(type);
    EXPECT_EQ(encode(static_cast<std::uint64_t>(most) + 1, type).code, od::AbortCode::value_too_high) << od::name(type);
    if (bits < 64) {
      EXPECT_EQ(encode(-most - 2, type).code, od::AbortCode::value_too_low) << od::name(type);
    }
  }
  for (const auto type : od::all_data_types()) {
    if (!od::is_unsigned(type)) continue;
    const unsigned bits = od::bit_length(type);
    const auto most = bits == 64 ? ~std::uint64_t{0} : (std::uint64_t{1} << bits) - 1;
    EXPECT_EQ(encode(most, type).what, nullptr) << od::name(type);
    EXPECT_EQ(encode(-1, type).code, od::AbortCode::value_too_low) << od::name(type);
    if (bits < 64) {
      EXPECT_EQ(encode(most + 1, type).code, od::AbortCode::value_too_high) << od::name(type);
    }
  }
  EXPECT_EQ(encode(std::numeric_limits<std::int64_t>::min(), DataType::unsigned64).code, od::AbortCode::value_too_low);
}

TEST(ClientValue, Reals) {
  EXPECT_EQ(bytes_of(1.5, DataType::real32), (Bytes{0, 0, 0xC0, 0x3F}));
  EXPECT_EQ(bytes_of(1.5F, DataType::real64), (Bytes{0, 0, 0, 0, 0, 0, 0xF8, 0x3F}));
  EXPECT_EQ(encode(1e39, DataType::real32).code, od::AbortCode::value_too_high);
  EXPECT_EQ(encode(-1e39, DataType::real32).code, od::AbortCode::value_too_low);
  EXPECT_EQ(bytes_of(std::numeric_limits<double>::infinity(), DataType::real32), (Bytes{0, 0, 0x80, 0x7F}));
  float value = 0;
  EXPECT_EQ(from_bytes(DataType::real32, Bytes{0, 0, 0xC0, 0x7F}, value).what, nullptr);
  EXPECT_TRUE(std::isnan(value));
  EXPECT_FALSE(readable_as(DataType::real64, cpp_type<float>()));
  EXPECT_TRUE(readable_as(DataType::real32, cpp_type<double>()));
}

TEST(ClientValue, KindsDoNotMix) {
  const auto wrong = [](const Complaint& c) { return c.what != nullptr && c.code == od::AbortCode::none; };
  EXPECT_TRUE(wrong(encode(1, DataType::real32)));
  EXPECT_TRUE(wrong(encode(1.0, DataType::integer32)));
  EXPECT_TRUE(wrong(encode("1", DataType::integer32)));
  EXPECT_TRUE(wrong(encode("1", DataType::octet_string)));
  EXPECT_TRUE(wrong(encode(1, DataType::visible_string)));
  EXPECT_TRUE(wrong(encode(true, DataType::unsigned8)));
  EXPECT_TRUE(wrong(encode(co::TimeOfDay{}, DataType::unsigned48)));
  EXPECT_TRUE(wrong(encode(1, DataType::time_of_day)));
  EXPECT_TRUE(wrong(encode(1, DataType::domain)));
  const Value other{DataType::unsigned16, {1, 2}};
  EXPECT_TRUE(wrong(encode(other, DataType::integer16))) << "a Value goes back only to its own type";
  EXPECT_EQ(bytes_of(true, DataType::boolean), Bytes{1});
  EXPECT_EQ(bytes_of(0, DataType::boolean), Bytes{0});
  EXPECT_EQ(encode(2, DataType::boolean).code, od::AbortCode::value_too_high);
  EXPECT_EQ(encode(Bytes{1}, DataType::unsigned16).code, od::AbortCode::length_too_low);
  EXPECT_EQ(encode(Bytes{1, 2, 3}, DataType::unsigned16).code, od::AbortCode::length_too_high);
  EXPECT_EQ(bytes_of(Bytes{}, DataType::domain), Bytes{});
}

TEST(ClientValue, AnswersOfAnotherLength) {
  std::uint64_t raw = 0;
  EXPECT_FALSE(decode(DataType::unsigned16, Bytes{}, raw));
  EXPECT_FALSE(decode(DataType::unsigned16, Bytes{1}, raw));
  EXPECT_FALSE(decode(DataType::unsigned16, Bytes{1, 0, 0}, raw));
  EXPECT_FALSE(decode(DataType::unsigned16, Bytes{1, 0, 1, 0}, raw)) << "65537 is no UNSIGNED16";
  EXPECT_FALSE(decode(DataType::unsigned32, Bytes{1, 0, 0, 0, 0, 0, 0, 0}, raw));
  EXPECT_TRUE(decode(DataType::unsigned16, Bytes{1, 2, 0, 0}, raw));
  EXPECT_EQ(raw, 0x201U);
  EXPECT_TRUE(decode(DataType::integer16, Bytes{0xFE, 0xFF, 0xFF, 0xFF}, raw));
  EXPECT_EQ(static_cast<std::int64_t>(raw), -2);
  EXPECT_TRUE(decode(DataType::integer16, Bytes{0xFE, 0xFF, 0, 0}, raw));
  EXPECT_EQ(static_cast<std::int64_t>(raw), -2);
}

TEST(ClientValue, Texts) {
  EXPECT_EQ(decode_text(DataType::visible_string, Bytes{'a', 'b', 0, 'c'}), "ab");
  EXPECT_EQ(decode_text(DataType::visible_string, Bytes{}), "");
  // U+00E9, U+20AC, U+1F600 by the Unicode standard's tables.
  const std::string utf8 = "\xC3\xA9\xE2\x82\xAC\xF0\x9F\x98\x80";
  const Bytes utf16 = {0xE9, 0x00, 0xAC, 0x20, 0x3D, 0xD8, 0x00, 0xDE};
  EXPECT_EQ(bytes_of(utf8, DataType::unicode_string), utf16);
  EXPECT_EQ(decode_text(DataType::unicode_string, utf16), utf8);
  EXPECT_EQ(decode_text(DataType::unicode_string, Bytes{0x3D, 0xD8, 'a', 0, 0x00, 0xDE, 'b'}),
            "\xEF\xBF\xBD"
            "a\xEF\xBF\xBD")
      << "lone surrogates, and half a unit at the end";
  for (const char* bad :
       {"\x80", "\xC3", "\xC0\x80", "\xE0\x80\x80", "\xED\xA0\x80", "\xF4\x90\x80\x80", "\xFF", "a\xC3z"}) {
    EXPECT_EQ(encode(bad, DataType::unicode_string).code, od::AbortCode::invalid_value);
  }
}

RC_GTEST_PROP(ClientValueProperty, EveryScalarSurvives, (std::uint64_t seed)) {
  for (const auto type : od::all_data_types()) {
    if (!od::is_integer(type)) continue;
    const auto raw = od::wrap(type, seed);
    if (od::is_signed(type)) {
      const auto value = static_cast<std::int64_t>(raw);
      std::int64_t back = 0;
      RC_ASSERT(from_bytes(type, bytes_of(value, type), back).what == nullptr);
      RC_ASSERT(back == value);
    } else {
      std::uint64_t back = 0;
      RC_ASSERT(from_bytes(type, bytes_of(raw, type), back).what == nullptr);
      RC_ASSERT(back == raw);
    }
  }
}

}  // namespace
}  // namespace berth::client::test
