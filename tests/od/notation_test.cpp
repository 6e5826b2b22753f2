// Objects as people write them.
#include "berth/od/notation.hpp"
#include "berth/od/mapping_text.hpp"

#include <fmt/format.h>
#include <array>

#include "tests/pch.hpp"

namespace berth::od {
namespace {

using Kind = NoObject::Kind;

TEST(ObjectWord, AllNotationsOfCanopen) {
  for (const char* word : {"1018h:04", "1018h:4", "1018H:04", "0x1018:4", "0X1018:0x4", "0x1018:04h", "1018h/4",
                           "0x1018/04", "1018sub4", "1018Sub4", "1018SUB04", "1018hsub4", "0x1018sub4"}) {
    const auto object = read_object(word);
    ASSERT_TRUE(object) << word << ": " << object.error().why;
    EXPECT_EQ(*object, (ObjectWord{0x1018, 4})) << word;
    EXPECT_EQ(parse_object(word), (ObjectRef{0x1018, 4})) << word;
  }
  for (const char* word : {"1018h", "0x1018", "1018H", "0X1018"}) {
    ASSERT_TRUE(read_object(word)) << word;
    EXPECT_EQ(*read_object(word), (ObjectWord{0x1018, std::nullopt})) << word;
    EXPECT_EQ(parse_object(word), (ObjectRef{0x1018, 0})) << word;
  }
  EXPECT_EQ(parse_object("FFFFh:FF"), (ObjectRef{0xFFFF, 0xFF}));
  EXPECT_EQ(parse_object("1A00subA"), (ObjectRef{0x1A00, 0x0A})) << "CiA 306: [1A00subA]";
  EXPECT_EQ(parse_object("1a00h:10"), (ObjectRef{0x1A00, 0x10})) << "a sub-index is hexadecimal";
}

TEST(ObjectWord, BareDigitsAreRefusedWithBothReadings) {
  const auto bare = read_object("1018");
  ASSERT_FALSE(bare);
  EXPECT_EQ(bare.error().kind, Kind::bare);
  EXPECT_NE(bare.error().why.find("1018h"), std::string::npos) << bare.error().why;
  EXPECT_NE(bare.error().why.find("03FAh"), std::string::npos) << bare.error().why;
  const auto with_sub = read_object("1018:4");
  ASSERT_FALSE(with_sub);
  EXPECT_NE(with_sub.error().why.find("1018h:04"), std::string::npos) << with_sub.error().why;
  EXPECT_NE(with_sub.error().why.find("03FAh:04"), std::string::npos) << with_sub.error().why;
  const auto one_reading = read_object("60FF");
  ASSERT_FALSE(one_reading);
  EXPECT_EQ(one_reading.error().kind, Kind::unmarked);
  EXPECT_NE(one_reading.error().why.find("write 60FFh"), std::string::npos) << one_reading.error().why;
  EXPECT_EQ(read_object("70000").error().kind, Kind::bare) << "no index, and no name either";
}

TEST(ObjectWord, WhatIsNone) {
  for (const char* wrong : {"",
                            "h",
                            "0x",
                            "2000h:",
                            ":1",
                            "12345h",
                            "2000h:100",
                            "20 0h",
                            "-1h",
                            "2000h:0:1",
                            "2000h:-1",
                            "0x1018 4",
                            "1018h sub4",
                            "1018subs",
                            "sub4",
                            "0x2000:0x",
                            "2000h:h",
                            "2000h:1hh",
                            "0x0x10",
                            " 1018h",
                            "1018h ",
                            "\n1018h",
                            "+1018h",
                            "Producer heartbeat time",
                            "Identity/Serial number",
                            "subject",
                            "0x10000"}) {
    const auto object = read_object(wrong);
    ASSERT_FALSE(object) << wrong;
    EXPECT_EQ(object.error().kind, Kind::other) << wrong;
  }
}

TEST(ObjectWord, SubIndexByItself) {
  EXPECT_EQ(read_sub_index("4"), 4);
  EXPECT_EQ(read_sub_index("04"), 4);
  EXPECT_EQ(read_sub_index("0x1F"), 0x1F);
  EXPECT_EQ(read_sub_index("1Fh"), 0x1F);
  EXPECT_EQ(read_sub_index("10h"), 0x10);
  const auto two = read_sub_index("10");
  ASSERT_FALSE(two);
  EXPECT_NE(two.error().find("0Ah"), std::string::npos) << two.error();
  EXPECT_NE(two.error().find("10h"), std::string::npos) << two.error();
  for (const char* wrong : {"", "256", "0x100", "-1", "x", "1F", "four"}) EXPECT_FALSE(read_sub_index(wrong)) << wrong;
}

// CiA 301 §7.5.2.36: bits 16 to 31 index, 8 to 15 sub-index, 0 to 7 length in bits.
TEST(MappingText, AMappingEntryIsAnObjectAndItsBits) {
  const std::array<std::uint8_t, 4> entry{0x10, 0x00, 0x10, 0x60};
  EXPECT_EQ(mapping_text({0x1A00, 1}, entry), "6010h:00, 16 bit");
  EXPECT_EQ(mapping_text({0x1600, 64}, entry), "6010h:00, 16 bit");
  EXPECT_EQ(mapping_text({0x17FF, 8}, entry), "6010h:00, 16 bit");
  EXPECT_EQ(mapping_text({0x1BFF, 8}, std::array<std::uint8_t, 4>{1, 0x0A, 0, 0x20}), "2000h:0A, 1 bit");
}

TEST(MappingText, NothingElseIs) {
  const std::array<std::uint8_t, 4> entry{0x10, 0x00, 0x10, 0x60};
  for (const ObjectRef object : {ObjectRef{0x1A00, 0}, ObjectRef{0x1A00, 65}, ObjectRef{0x15FF, 1},
                                 ObjectRef{0x1800, 1}, ObjectRef{0x1C00, 1}, ObjectRef{0x6010, 1}}) {
    EXPECT_EQ(mapping_text(object, entry), "") << write_object(object);
  }
  EXPECT_EQ(mapping_text({0x1A00, 1}, std::span(entry).first(3)), "");
  EXPECT_EQ(mapping_text({0x1A00, 1}, std::array<std::uint8_t, 4>{}), "") << "nothing is mapped";
}

RC_GTEST_PROP(ObjectWord, WhatIsWrittenIsReadBack, (std::uint16_t index, std::uint8_t sub)) {
  const ObjectRef object{index, sub};
  RC_ASSERT(write_object(object) == fmt::format("{:04X}h:{:02X}", index, sub));
  for (const std::string& word : {write_object(object), fmt::format("0x{:04X}:{}", index, fmt::format("{:x}", sub)),
                                  fmt::format("{:x}sub{:X}", index, sub), fmt::format("{:X}h/{:x}h", index, sub)}) {
    RC_ASSERT(parse_object(word) == object);
  }
}

// Without a mark no word is an index, whatever its digits.
RC_GTEST_PROP(ObjectWord, DigitsAloneAreNever, (std::uint16_t index)) {
  RC_ASSERT(!read_object(fmt::format("{}", index)));
  RC_ASSERT(!read_object(fmt::format("{:X}", index)));
}

}  // namespace
}  // namespace berth::od
