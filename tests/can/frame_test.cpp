#include <gtest/gtest.h>
#include <cstdint>
#include <optional>
#include <string>

#include "berth/can/frame.hpp"

#include "berth/base/random.hpp"

using namespace berth;
using can::Frame;
using can::parse_frame;
using can::to_string;

namespace {

// candump's log format, as its manual gives it.
TEST(FrameText, KnownForms) {
  EXPECT_EQ(to_string(Frame::base(0x7E5, {4, 1, 0, 0, 0, 0, 0, 0})), "7E5#0401000000000000");
  EXPECT_EQ(to_string(Frame::base(0, {0x80, 0})), "000#8000");
  EXPECT_EQ(to_string(Frame::ext(0x1F940000, {0x80, 0, 0, 0})), "1F940000#80000000");
  EXPECT_EQ(to_string(Frame::ext(0x123, {})), "00000123#");
  EXPECT_EQ(to_string(Frame::request(0x701, 1)), "701#R1");
  EXPECT_EQ(to_string(Frame::request(0x701, 0)), "701#R");
  Frame fd = Frame::base(0x123, {0xAA, 0xBB});
  fd.fd = fd.brs = true;
  EXPECT_EQ(to_string(fd), "123##1AABB");
}

TEST(FrameText, AnIdentifierOfMoreThanThreeDigitsIsExtended) {
  EXPECT_FALSE(parse_frame("7FF#")->extended);
  EXPECT_TRUE(parse_frame("00000001#")->extended);
  EXPECT_EQ(parse_frame("1f940000#80"), parse_frame("1F940000#80"));
  EXPECT_EQ(parse_frame("1F940000#")->key(), 0x9F940000U);
}

TEST(FrameText, BadTextIsRefused) {
  for (const auto* bad : {"",          "#",
                          "123",       "#00",
                          "800#",      "7FFFFFFFF#",
                          "20000000#", "123#0",
                          "123#GG",    "123#000102030405060708",
                          "123#R9",    "123#R10",
                          "123#Rx",    "123#r",
                          "12 #00",    "-12#00",
                          "123# 00",   "123#00 ",
                          "0x1#00",    "123##",
                          "123##G00",  "123##0000102030405060708090A",
                          "123#-1",    "+12#00",
                          "123##1AAB"}) {
    EXPECT_EQ(parse_frame(bad), std::nullopt) << bad;
  }
}

TEST(FrameText, RoundTripOfRandomFrames) {
  Random random(5);
  constexpr std::uint8_t sizes[] = {0, 1, 2, 3, 4, 5, 6, 7, 8, 12, 16, 20, 24, 32, 48, 64};
  for (int i = 0; i < 20'000; ++i) {
    Frame f;
    f.extended = random.below(2) == 0;
    f.id = static_cast<std::uint32_t>(random.next()) & (f.extended ? can::extended_mask : can::base_mask);
    f.fd = random.below(3) == 0;
    f.remote = !f.fd && random.below(4) == 0;
    f.brs = f.fd && random.below(2) == 0;
    f.esi = f.fd && random.below(2) == 0;
    f.size = sizes[random.below(f.fd ? std::size(sizes) : 9)];
    for (unsigned k = 0; k < f.size; ++k) f.data[k] = static_cast<std::uint8_t>(random.next());
    const auto back = parse_frame(to_string(f));
    ASSERT_TRUE(back) << to_string(f);
    ASSERT_EQ(*back, f) << to_string(f);
    ASSERT_EQ(back->esi, f.esi);
    ASSERT_EQ(to_string(*back), to_string(f));
  }
}

// Whatever is not refused must be a frame that can exist.
TEST(FrameText, GarbageNeverGivesAnImpossibleFrame) {
  Random random(6);
  constexpr std::string_view letters = "0123456789ABCDEFabcdefR#x ";
  for (int i = 0; i < 200'000; ++i) {
    std::string text;
    for (auto n = random.below(24); n > 0; --n) text += letters[random.below(letters.size())];
    if (random.below(2) == 0) text.insert(std::min<std::size_t>(3, text.size()), "#");
    const auto f = parse_frame(text);
    if (!f) continue;
    ASSERT_LE(f->id, f->extended ? can::extended_mask : can::base_mask) << text;
    ASSERT_LE(f->size, f->fd ? 64 : 8) << text;
    ASSERT_FALSE(f->fd && f->remote) << text;
    ASSERT_EQ(parse_frame(to_string(*f)), f) << text;
  }
}

TEST(Frame, EqualityLooksAtWhatIsOnTheWire) {
  auto a = Frame::base(0x181, {1, 2});
  auto b = a;
  EXPECT_EQ(a, b);
  b.data[5] = 99;  // behind the data
  EXPECT_EQ(a, b);
  b.data[1] = 99;
  EXPECT_NE(a, b);
  EXPECT_NE(Frame::base(0x181, {1}), Frame::base(0x181, {1, 0}));
  EXPECT_NE(Frame::base(0x181, {1}), Frame::ext(0x181, {1}));
  EXPECT_NE(Frame::base(0x181, {}), Frame::request(0x181, 0));
  auto c = Frame::request(0x181, 2), d = Frame::request(0x181, 2);
  c.data[0] = 1;
  EXPECT_EQ(c, d) << "a remote frame carries no data";
  EXPECT_NE(c, Frame::request(0x181, 1));
  EXPECT_TRUE(c.bytes().empty());
}

TEST(Frame, CopyKeepsAllBytesOfAnFdFrame) {
  Frame f;
  f.fd = true;
  f.size = 64;
  for (unsigned i = 0; i < 64; ++i) f.data[i] = static_cast<std::uint8_t>(i * 3);
  const Frame copy = f;
  EXPECT_EQ(copy, f);
  EXPECT_EQ(copy.bytes()[63], 189);
  Frame self = f;
  const Frame& alias = self;
  self = alias;
  EXPECT_EQ(self, f);
}

TEST(Frame, IdentifiersAndLengthsAreMasked) {
  EXPECT_EQ(Frame::base(0xFFFFFFFF, {}).id, 0x7FFU);
  EXPECT_EQ(Frame::ext(0xFFFFFFFF, {}).id, 0x1FFFFFFFU);
  EXPECT_EQ(Frame::base(1, {1, 2, 3, 4, 5, 6, 7, 8, 9}).size, 8);
  EXPECT_EQ(Frame::request(1, 200).size, 8);
}

}  // namespace
