#include "berth/base/crc.hpp"
#include "berth/base/ids.hpp"
#include "berth/base/result.hpp"

#include <gtest/gtest.h>
#include <cstdint>
#include <string>
#include <string_view>
#include <vector>

using namespace berth;

TEST(Crc, CheckValues) {
  constexpr std::string_view text = "123456789";
  const std::vector<std::uint8_t> bytes(text.begin(), text.end());
  EXPECT_EQ(crc16(bytes), 0x31C3);  // CiA 301 §7.2.4.3.16
  EXPECT_EQ(crc32(bytes), 0xCBF43926U);
}

TEST(LssAddress, S1_11_ChunksAreBigEndianOverTheWholeAddress) {
  const LssAddress s1{0x01000001, 0x00000001, 0, 0x0A};
  EXPECT_EQ(s1.chunk(0), 0x0100);
  EXPECT_EQ(s1.chunk(1), 0x0001);
  EXPECT_EQ(s1.chunk(3), 0x0001);
  EXPECT_EQ(s1.chunk(7), 0x000A);
}

TEST(Result, DescribesTheObjectWithItsSubIndexZeroToo) {
  EXPECT_EQ(
      describe(Error{.code = Errc::aborted, .node = 5, .sub = 0, .index = 0x1018}).find("node 5, object 1018h:00: "),
      0U);
  EXPECT_EQ(
      describe(Error{.code = Errc::aborted, .node = 5, .sub = 4, .index = 0x1018}).find("node 5, object 1018h:04: "),
      0U);
  EXPECT_EQ(describe(Error{.code = Errc::bus}).find("object"), std::string::npos);
}

TEST(LssAddress, TextForm) {
  const LssAddress a{0x01355341, 0x04470003, 0x00020006, 0xFEEDF00D};
  EXPECT_EQ(to_string(a), "01355341-04470003-00020006-FEEDF00D");
  EXPECT_EQ(parse_lss_address(to_string(a)), a);
  EXPECT_EQ(parse_lss_address("0x1-0x2-3-4"), (LssAddress{1, 2, 3, 4}));
  for (const auto* bad : {"", "1-2-3", "1-2-3-4-5", "1-2-3-", "1-2-3-g", "1-2-3-123456789"}) {
    EXPECT_FALSE(parse_lss_address(bad)) << bad;
  }
}

TEST(Identity, WhatIsUnknownIsNotNought) {
  Identity less(1, 0, 0, 0);
  less.unknown = 0b1110;
  const Identity whole(1, 2, 3, 4);
  EXPECT_TRUE(less.agrees(whole));
  EXPECT_TRUE(whole.agrees(less));
  EXPECT_NE(less, whole);
  EXPECT_FALSE(less.agrees(Identity(9, 2, 3, 4)));
  EXPECT_FALSE(Identity(1, 0, 3, 4).agrees(whole)) << "0 is what it says";
  EXPECT_FALSE(less.has_serial());
  EXPECT_TRUE(whole.has_serial());
}

TEST(Identity, OneWithoutASerialNumberIsKnownByItsNodeId) {
  const Identity one = Identity(1, 2, 3, 0).with(NodeId(5));
  EXPECT_NE(one, one.with(NodeId(6)));
  EXPECT_TRUE(one.agrees(one.with(NodeId(6))));
  EXPECT_EQ(one.with(NodeId()), Identity(1, 2, 3, 0));
  EXPECT_EQ(Identity(1, 2, 3, 4).with(NodeId(5)), Identity(1, 2, 3, 4)) << "a serial number is enough";
}

TEST(Identity, IsReadAsItIsWritten) {
  Identity less = Identity(1, 2, 0, 0);
  less.unknown = 0b1100;
  for (const Identity& each : {Identity(1, 2, 3, 4), Identity(1, 2, 3, 0), Identity(1, 2, 3, 0).with(NodeId(127)), less,
                               less.with(NodeId(5))}) {
    EXPECT_EQ(parse_identity(to_string(each)), each) << to_string(each);
  }
  EXPECT_EQ(to_string(less.with(NodeId(5))), "00000001-00000002-xxxxxxxx-xxxxxxxx@5");
  EXPECT_EQ(parse_identity("1-2-3-0@5"), Identity(1, 2, 3, 0).with(NodeId(5)));
  for (const char* bad : {"", "1-2-3", "1-2-3-4@5", "1-2-3-0@0", "1-2-3-0@128", "1-2-3-0@", "1-2-3-0@5x", "1-2-3-0@@5",
                          "xxxxxxxxxxxxxxxx-2-3-0", "1-2-3-xxxxxxx", "1-2-3-4-xxxxxxxx", "1-xxxxxxxx7-3-4"}) {
    EXPECT_FALSE(parse_identity(bad)) << bad;
  }
}
