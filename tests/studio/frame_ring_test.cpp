// The ring of frames, with one thread that fills and one that takes.
#include "berth/studio/frame_ring.hpp"

#include <gtest/gtest.h>

#include <atomic>
#include <string>
#include <thread>

#include "../pch.hpp"
#include "berth/can/bus_error.hpp"

namespace berth::studio {
namespace {

using namespace std::chrono_literals;

// Each of its words tells the number, so that a torn record shows.
can::Frame numbered(std::uint64_t number) {
  can::Frame frame = can::Frame::ext(static_cast<std::uint32_t>(number), {1, 2, 3, 4, 5, 6, 7, 8});
  std::memcpy(frame.data.data(), &number, sizeof number);
  return frame;
}

}  // namespace

TEST(StudioRing, WhatWasPutIsReadAndWhatWasOverwrittenIsNot) {
  FrameRing ring(4);
  RingFrame read;
  EXPECT_FALSE(ring.read(0, read));
  can::Frame remote = can::Frame::request(0x701, 3);
  ring.put(2, remote, rt::Time(5ms), true);
  ASSERT_TRUE(ring.read(0, read));
  EXPECT_EQ(read.frame, remote);
  EXPECT_EQ(read.bus, 2);
  EXPECT_TRUE(read.own);
  EXPECT_EQ(read.at, rt::Time(5ms));
  const can::Frame ext = can::Frame::ext(0x1FFFFFFF, {1, 2, 3});
  ring.put(0, ext, rt::Time(6ms), false);
  ASSERT_TRUE(ring.read(1, read));
  EXPECT_EQ(read.frame, ext);
  EXPECT_FALSE(read.own || read.cut);
  for (int i = 0; i < 3; ++i) ring.put(0, ext, rt::Time(7ms), false);
  EXPECT_FALSE(ring.read(0, read));
  EXPECT_EQ(ring.first(), 1U);
  EXPECT_EQ(ring.next(), 5U);
  EXPECT_FALSE(ring.read(5, read));
}

TEST(StudioRing, AnFdFrameIsCutAndSaysSo) {
  FrameRing ring(4);
  can::Frame frame = can::Frame::base(0x181, {1, 2, 3, 4, 5, 6, 7, 8});
  frame.fd = true;
  frame.size = 64;
  ring.put(0, frame, rt::Time(), false);
  RingFrame read;
  ASSERT_TRUE(ring.read(0, read));
  EXPECT_TRUE(read.cut);
  EXPECT_EQ(read.frame, can::Frame::base(0x181, {1, 2, 3, 4, 5, 6, 7, 8}));
}

// Of 64 bytes and of 12: bytes behind the first 8 are kept beside the records.
TEST(StudioRing, AnFdFrameIsWholeUntilAnotherTakesItsPlace) {
  FrameRing ring(32);
  can::Frame frame = can::Frame::ext(0x12345678, {});
  frame.fd = frame.brs = true;
  frame.size = 64;
  for (unsigned i = 0; i < 64; ++i) frame.data[i] = static_cast<std::uint8_t>(i + 1);
  ring.put(0, frame, rt::Time(), false);
  can::Frame read;
  ASSERT_TRUE(ring.whole(0, read));
  EXPECT_EQ(read, frame);
  EXPECT_TRUE(read.brs);
  ring.put(0, can::Frame::base(0x701, {5}), rt::Time(), false);
  ASSERT_TRUE(ring.whole(1, read));
  EXPECT_EQ(read, can::Frame::base(0x701, {5}));
  frame.size = 12;
  ring.put(0, frame, rt::Time(), false);  // two places for 32 frames: this one is that of the first
  EXPECT_FALSE(ring.whole(0, read));
  RingFrame cut;
  ASSERT_TRUE(ring.read(0, cut));
  EXPECT_TRUE(cut.cut && cut.fd);
  ASSERT_TRUE(ring.whole(2, read));
  EXPECT_EQ(read, frame);
  frame.size = 8;
  ring.put(0, frame, rt::Time(), false);
  ASSERT_TRUE(ring.read(3, cut));
  EXPECT_TRUE(cut.fd && !cut.cut);
  ASSERT_TRUE(ring.whole(3, read));
  EXPECT_EQ(read, frame);
  EXPECT_FALSE(ring.whole(4, read));
}

TEST(StudioRing, AReportOfAnErrorIsNumberedAmongTheFramesWithItsWords) {
  FrameRing ring(8);
  const auto report = can::error_report(can::ErrorKind::stuff, can::ErrorPlace::data, false, true, 16, 0);
  ring.put(0, can::Frame::base(0x701, {5}), rt::Time(), false);
  ring.put_error(3, report, rt::Time(7ms), "left sent 185h");
  ring.put_error(3, report, rt::Time(8ms), "");
  ring.put_error(3, report, rt::Time(9ms), "left sent 185h");
  RingFrame read;
  ASSERT_TRUE(ring.read(0, read));
  EXPECT_FALSE(read.error);
  ASSERT_TRUE(ring.read(1, read));
  EXPECT_TRUE(read.error);
  EXPECT_FALSE(read.own || read.cut);
  EXPECT_EQ(read.bus, 3);
  EXPECT_EQ(read.frame, report);
  EXPECT_EQ(read.about, "left sent 185h");
  const char* const words = read.about.data();
  ASSERT_TRUE(ring.read(2, read));
  EXPECT_EQ(read.about, "");
  ASSERT_TRUE(ring.read(3, read));
  EXPECT_EQ(read.about.data(), words) << "said once";
  // What more is said has no words: they are bounded.
  for (std::size_t i = 0; i < FrameRing::most_words + 5; ++i) ring.put_error(0, report, rt::Time(), std::to_string(i));
  ASSERT_TRUE(ring.read(ring.next() - 1, read));
  EXPECT_TRUE(read.error);
  EXPECT_EQ(read.about, "");
}

TEST(StudioRing, AMillionFramesTake32MiB) {
  FrameRing ring;
  EXPECT_EQ(ring.most(), 1U << 20U);
}

TEST(StudioRing, NoReaderSeesATornRecord) {
  FrameRing ring(2);  // each reading meets the writer
  constexpr std::uint64_t frames = 2'000'000;
  const std::jthread producer([&] {
    for (std::uint64_t n = 0; n < frames; ++n)
      ring.put(static_cast<std::uint8_t>(n), numbered(n), rt::Time(rt::Duration(static_cast<std::int64_t>(n))), false);
  });
  std::uint64_t seen = 0;
  RingFrame read;
  while (ring.next() < frames) {
    const auto next = ring.next();
    for (auto n = ring.first(); n < next; ++n) {
      if (!ring.read(n, read)) continue;
      ++seen;
      std::uint64_t data = 0;
      std::memcpy(&data, read.frame.data.data(), sizeof data);
      ASSERT_EQ(data, n);
      ASSERT_EQ(read.frame.id, n);
      ASSERT_EQ(read.at.time_since_epoch().count(), static_cast<std::int64_t>(n));
      ASSERT_EQ(read.bus, static_cast<std::uint8_t>(n));
    }
  }
  RecordProperty("read", std::to_string(seen));
}

}  // namespace berth::studio
