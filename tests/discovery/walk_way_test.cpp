// Where a walk stands and may go on: without a bus.
#include "berth/discovery/walk_way.hpp"

#include <gtest/gtest.h>

#include <vector>

namespace berth::discovery::walk {
namespace {

constexpr LssAddress pump{1, 0x30, 7, 100};

Way at(std::vector<std::uint32_t> parts) {
  Way way;
  for (const auto part : parts) way.part[way.sub++] = part;
  return way;
}

TEST(WalkWay, APartIsVariedWhenSeveralOfItsValuesWereAsked) {
  Way way;
  way.note_asked(1);
  way.note_asked(1);
  EXPECT_FALSE(way.varied(0));
  way.sub = 1;
  way.note_asked(2);
  EXPECT_FALSE(way.varied(0)) << "another part";
  way.sub = 0;
  way.note_asked(2);
  EXPECT_TRUE(way.varied(0));
  EXPECT_FALSE(way.varied(1));
  way.sub = 3;
  way.note_asked(1);
  way.note_asked(2);  // a serial number is no part that a device could be led astray by
  EXPECT_FALSE(way.varied(2));
}

TEST(WalkWay, TheLastPlaceOpenedComesFirstAndFeedbackOpensAPlaceOnce) {
  Frontier frontier;
  const Prefix zero = Prefix{}.zero();
  const Prefix one = Prefix{}.one();
  frontier.open(zero, Open::Why::heard);
  frontier.open(one, Open::Why::maybe);
  frontier.open(zero, Open::Why::heard);
  EXPECT_EQ(frontier.take().at, one);
  EXPECT_EQ(frontier.take().at, zero);
  EXPECT_TRUE(frontier.empty()) << "heard twice, open once";
  frontier.open(zero, Open::Why::heard);
  EXPECT_TRUE(frontier.empty()) << "it was dealt with";
  frontier.forget_heard();
  frontier.open(zero, Open::Why::heard);
  EXPECT_FALSE(frontier.remove(one));
  EXPECT_TRUE(frontier.remove(zero));
  EXPECT_TRUE(frontier.empty());
}

TEST(WalkWay, KnownPathsGoOnFromThePartsThatAreConfirmed) {
  Known known;
  known.expected = {pump};
  known.kinds = {{.type = {1, 0x40}, .revision = std::nullopt}};
  KnownPaths paths(known);
  const std::vector<Found> none;
  ASSERT_NE(paths.choose({}, {}, none), nullptr);
  EXPECT_EQ(paths.choose({}, {}, none)->part[0], 1U);
  EXPECT_EQ(paths.choose(at({2}), {}, none), nullptr) << "no device of that vendor is known";
  ASSERT_NE(paths.choose(at({1}), {}, none), nullptr);
  EXPECT_EQ(paths.choose(at({1}), {}, none)->part[1], 0x30U);

  paths.note_absent({.part = {1, 0x30}, .parts = 2});
  ASSERT_NE(paths.choose(at({1}), {}, none), nullptr);
  EXPECT_EQ(paths.choose(at({1}), {}, none)->part[1], 0x40U);
  EXPECT_EQ(paths.absent(), 1U);
  EXPECT_EQ(paths.choose(at({1, 0x40}), {}, none), nullptr) << "its revision is not known";

  paths.put_first({1, 0x50, 9, 3});
  ASSERT_NE(paths.choose(at({1}), {}, none), nullptr);
  EXPECT_EQ(paths.choose(at({1}), {}, none)->part[1], 0x50U) << "what was found comes first";
}

TEST(WalkWay, WithFeedbackOnlyWhatWasHeardIsTriedAndADeviceThatWasFoundIsNot) {
  Known known;
  known.expected = {pump};
  const KnownPaths paths(known);
  const std::vector<Found> none;
  const std::vector<Prefix> elsewhere{Prefix{0x8000'0000, 28}};
  const std::vector<Prefix> here{Prefix{0, 28}};
  EXPECT_EQ(paths.choose(at({1}), elsewhere, none), nullptr);
  EXPECT_NE(paths.choose(at({1}), here, none), nullptr);
  EXPECT_NE(paths.choose(at({1, 0x30, 7}), {}, none), nullptr);
  std::vector<Found> found(1);
  found[0].address = pump;
  EXPECT_EQ(paths.choose(at({1, 0x30, 7}), {}, found), nullptr);
}

}  // namespace
}  // namespace berth::discovery::walk
