#include "berth/io/socketcan_codec.hpp"
#include "berth/can/ranges.hpp"

#include <gtest/gtest.h>
#include <rapidcheck/gtest.h>
#include <chrono>
#include <cstdint>
#include <vector>

#include <algorithm>

#include "berth/base/random.hpp"

namespace berth::io {
namespace {

using namespace std::chrono_literals;
using Bytes = std::vector<std::uint8_t>;

Bytes encoded(const can::Frame& f) {
  KernelFrame bytes;
  bytes.fill(0xEE);
  const auto size = encode_frame(f, bytes);
  return {bytes.begin(), bytes.begin() + static_cast<std::ptrdiff_t>(size)};
}

// linux/can.h: can_id in host order (EFF 8000 0000h, RTR 4000 0000h), length, three bytes, data.
TEST(SocketCanFrame, BytesAsTheKernelHasThem) {
  EXPECT_EQ(encoded(can::Frame::base(0x7E5, {0x51, 2})), (Bytes{0xE5, 7, 0, 0, 2, 0, 0, 0, 0x51, 2, 0, 0, 0, 0, 0, 0}));
  EXPECT_EQ(encoded(can::Frame::ext(0x1ABCDEF5, {1})),
            (Bytes{0xF5, 0xDE, 0xBC, 0x9A, 1, 0, 0, 0, 1, 0, 0, 0, 0, 0, 0, 0}));
  EXPECT_EQ(encoded(can::Frame::request(0x701, 1)), (Bytes{1, 7, 0, 0x40, 1, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0}));
  can::Frame f;
  f.id = 0x123;
  f.fd = f.brs = true;
  f.size = 12;
  for (std::size_t i = 0; i < 12; ++i) f.data[i] = static_cast<std::uint8_t>(i + 1);
  auto bytes = encoded(f);
  ASSERT_EQ(bytes.size(), 72U);
  EXPECT_EQ(bytes[4], 12);
  EXPECT_EQ(bytes[5], 0x05);  // CANFD_FDF 4, CANFD_BRS 1
  EXPECT_EQ(bytes[8 + 11], 12);
  EXPECT_TRUE(std::all_of(bytes.begin() + 20, bytes.end(), [](auto b) { return b == 0; }));
  const auto back = decode_frame(bytes);
  ASSERT_TRUE(back);
  EXPECT_EQ(*back, f);
}

TEST(SocketCanFrame, WhatNoBusCarriesIsRefused) {
  can::Frame f = can::Frame::base(1, {});
  f.id = 0x800;
  EXPECT_TRUE(encoded(f).empty());
  f = can::Frame::ext(1, {});
  f.id = 0x2000'0000;
  EXPECT_TRUE(encoded(f).empty());
  f = can::Frame::base(1, {});
  f.size = 9;
  EXPECT_TRUE(encoded(f).empty());
  f.fd = true;
  EXPECT_TRUE(encoded(f).empty());
  f.size = 12;
  f.remote = true;
  EXPECT_TRUE(encoded(f).empty());
  EXPECT_FALSE(decode_frame(Bytes(15, 0)));
  EXPECT_FALSE(decode_frame(Bytes{1, 0, 0, 0, 9, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0}));
  EXPECT_FALSE(decode_frame(Bytes{4, 0, 0, 0x20, 8, 0, 0, 0, 0, 4, 0, 0, 0, 0, 0, 0}));  // an error frame
}

RC_GTEST_PROP(SocketCanFrame, EveryFrameComesBackEqual,
              (std::uint32_t id, bool extended, bool remote, std::uint8_t size)) {
  can::Frame f;
  f.extended = extended;
  f.id = id & (extended ? can::extended_mask : can::base_mask);
  f.remote = remote;
  f.size = size % 9;
  for (std::size_t i = 0; i < f.bytes().size(); ++i) f.data[i] = static_cast<std::uint8_t>(id >> i);
  const auto back = decode_frame(encoded(f));
  RC_ASSERT(back.has_value());
  RC_ASSERT(*back == f);
}

// ---- error frames: linux/can/error.h ----

Bytes error(std::uint32_t classes, const Bytes& data) {
  const Bytes head{static_cast<std::uint8_t>(classes), static_cast<std::uint8_t>(classes >> 8U), 0, 0x20, 8, 0, 0, 0};
  Bytes b(head.size() + data.size());
  std::ranges::copy(data, std::ranges::copy(head, b.begin()).out);
  return b;
}

TEST(SocketCanError, CountersAndStatesAsDriversTellThem) {
  EXPECT_FALSE(decode_error(encoded(can::Frame::base(4, {}))));
  // sja1000: CRTL|CNT, TX passive, TEC 128, REC 5
  auto r = decode_error(error(0x204, {0, 0x20, 0, 0, 0, 0, 128, 5}));
  ASSERT_TRUE(r);
  EXPECT_EQ(r->level, BusReport::Level::passive);
  EXPECT_TRUE(r->counts);
  EXPECT_EQ(r->tec, 128);
  EXPECT_EQ(r->rec, 5);
  EXPECT_FALSE(r->error || r->bus_off || r->restarted || r->overflow);
  // an older kernel: counters without CNT
  r = decode_error(error(0x004, {0, 0x04, 0, 0, 0, 0, 0, 97}));
  ASSERT_TRUE(r);
  EXPECT_EQ(r->level, BusReport::Level::warning);
  EXPECT_TRUE(r->counts);
  EXPECT_EQ(r->rec, 97);
  // a driver without counters: the least that the state means
  r = decode_error(error(0x004, {0, 0x10, 0, 0, 0, 0, 0, 0}));
  ASSERT_TRUE(r);
  EXPECT_FALSE(r->counts);
  EXPECT_EQ(r->level, BusReport::Level::passive);
  EXPECT_EQ(r->rec, 128);
  EXPECT_EQ(r->tec, 0);
  // passive, and the counters read a moment later are below: it is passive all the same
  r = decode_error(error(0x204, {0, 0x20, 0, 0, 0, 0, 127, 0}));
  ASSERT_TRUE(r);
  EXPECT_GE(r->tec, 128);
  r = decode_error(error(0x204, {0, 0x40, 0, 0, 0, 0, 10, 0}));
  ASSERT_TRUE(r);
  EXPECT_EQ(r->level, BusReport::Level::active);
  EXPECT_EQ(r->tec, 10);
}

TEST(SocketCanError, WhatHappened) {
  auto r = decode_error(error(0x040, {0, 0, 0, 0, 0, 0, 0, 0}));
  EXPECT_TRUE(r && r->bus_off && !r->error);
  r = decode_error(error(0x100, {0, 0, 0, 0, 0, 0, 0, 0}));
  EXPECT_TRUE(r && r->restarted);
  r = decode_error(error(0x004, {0, 0x01, 0, 0, 0, 0, 0, 0}));
  EXPECT_TRUE(r && r->overflow && !r->level && !r->counts);
  r = decode_error(error(0x088, {0, 0, 0x04, 0x0A, 0, 0, 0, 0}));  // bus error, stuff error in the data
  EXPECT_TRUE(r && r->error && !r->counts);
  r = decode_error(error(0x020, {0, 0, 0, 0, 0, 0, 0, 0}));  // nobody acknowledged
  EXPECT_TRUE(r && r->error);
  r = decode_error(error(0x008, {0, 0, 0x20, 0, 0, 0, 0, 0}));  // an overload frame is no error
  EXPECT_TRUE(r && !r->error);
}

TEST(SocketCanError, IsAReportAsTraceFilesHaveIt) {
  const auto bytes = error(0x088, {0, 0, 0x04, 0x0A, 0, 0, 9, 1});
  ASSERT_TRUE(decode_error(bytes)->error);
  const auto report = error_frame(bytes);
  EXPECT_EQ(report.id, 0x88U) << "without the flag that makes it no frame";
  EXPECT_EQ(report.size, 8);
  EXPECT_EQ(report.data[3], 0x0A);
  EXPECT_EQ(report.data[6], 9);
}

// ---- filters, judged by the kernel's own comparison ----

bool kernel_passes(const std::vector<KernelFilter>& filters, std::uint32_t can_id) {
  return std::ranges::any_of(filters, [can_id](const KernelFilter& f) { return (can_id & f.mask) == (f.id & f.mask); });
}

TEST(SocketCanFilter, SingleIdentifiersAreThoseThatTheKernelFindsByTable) {
  const auto filters = kernel_filters(std::vector{can::only(0x605), can::only(0)}, most_filters);
  // CAN_SFF_MASK | CAN_EFF_FLAG | CAN_RTR_FLAG; and every remote frame by one filter more
  EXPECT_EQ(filters, (std::vector<KernelFilter>{{0, 0xC00007FF}, {0x605, 0xC00007FF}, {0x40000000, 0x40000000}}));
  EXPECT_EQ(kernel_filters(std::vector{can::all_base}, most_filters), (std::vector<KernelFilter>{{0, 0x80000000}}));
  EXPECT_EQ(kernel_filters(std::vector{can::all_extended}, most_filters),
            (std::vector<KernelFilter>{{0x80000000, 0x80000000}}));
  EXPECT_TRUE(kernel_filters({}, most_filters).empty());
}

TEST(SocketCanFilter, HeartbeatsOfAllNodes) {
  const auto filters = kernel_filters(std::vector{can::IdRange{0x701, 0x77F}}, most_filters);
  for (std::uint32_t id = 0; id <= 0x7FF; ++id) EXPECT_EQ(kernel_passes(filters, id), id >= 0x701 && id <= 0x77F) << id;
  EXPECT_EQ(filters.size(), 1U + 2 + 4 + 8 + 3 + 1);  // 701h to 70Fh singly, blocks of 16, 32 and 64, remote frames
}

// Data frames exactly; remote frames at least.
RC_GTEST_PROP(SocketCanFilter, WhatIsWantedPassesAndNoOtherDataFrame, ()) {
  const auto seed = *rc::gen::arbitrary<std::uint32_t>();
  Random r(seed);
  std::vector<can::IdRange> ranges;
  for (auto n = r.below(12); n > 0; --n) {
    const bool extended = r.below(3) == 0;
    const auto limit = extended ? can::extended_mask : can::base_mask;
    const auto first = static_cast<std::uint32_t>(r.below(limit + 1ULL));
    const auto length = static_cast<std::uint32_t>(r.below(r.below(2) == 0 ? 20 : extended ? 0x100'0000 : 0x200));
    const auto last = std::min(limit, first + length);
    const auto flag = extended ? can::extended_flag : 0;
    ranges.push_back({first | flag, last | flag});
  }
  const auto filters = kernel_filters(ranges, most_filters);
  const auto wanted = can::normalised(ranges);
  RC_ASSERT(filters.size() <= most_filters);
  std::uint32_t wrong = 0;
  const auto check = [&](std::uint32_t key) {
    const bool in = std::ranges::any_of(ranges, [key](const can::IdRange& range) { return range.contains(key); });
    const bool right = kernel_passes(filters, key) == in && can::contains(wanted, key) == in &&
                       (!in || kernel_passes(filters, key | 0x4000'0000U));
    if (!right) wrong = key + 1;
  };
  for (auto id = static_cast<std::uint32_t>(r.below(9)); id <= can::base_mask; id += 9) check(id);
  for (const auto& range : ranges) {
    for (const auto key : {range.first - 1, range.first, range.last, range.last + 1}) {
      if ((key & ~can::extended_flag) <= ((key & can::extended_flag) != 0 ? can::extended_mask : can::base_mask))
        check(key);
    }
  }
  RC_ASSERT(wrong == 0U);
  RC_ASSERT(can::covers(wanted, wanted));
}

TEST(SocketCanFilter, TooManyRangesPassMoreAndNeverLess) {
  std::vector<can::IdRange> ranges;
  for (std::uint32_t id = 0; id < 0x7FF; id += 2) ranges.push_back(can::only(id));
  for (std::uint32_t id = 0; id < 600; ++id) ranges.push_back(can::only(can::extended_flag | id * 5));
  for (const std::size_t most : {std::size_t{4}, std::size_t{100}, most_filters}) {
    const auto filters = kernel_filters(ranges, most);
    EXPECT_LE(filters.size(), most);
    for (const auto& range : ranges) EXPECT_TRUE(kernel_passes(filters, range.first));
  }
  const auto only_base = kernel_filters(std::span(ranges).first(100), most_filters);
  EXPECT_EQ(only_base.size(), 101U);
}

TEST(SocketCanFilter, RangesOverTheBorderOfTheFormatsAndBeyondWhatExists) {
  EXPECT_EQ(can::normalised(std::vector{can::IdRange{0x700, can::extended_flag | 0x10}}),
            (std::vector{can::IdRange{0x700, 0x7FF}, can::IdRange{can::extended_flag, can::extended_flag | 0x10}}));
  EXPECT_TRUE(can::normalised(std::vector{can::IdRange{0x800, 0x7FFF'FFFF}, can::IdRange{5, 4}}).empty());
  EXPECT_EQ(can::normalised(std::vector{can::IdRange{0, 0xFFFF'FFFF}}),
            (std::vector{can::all_base, can::all_extended}));
  EXPECT_EQ(can::normalised(std::vector{can::only(3), can::IdRange{1, 2}, can::IdRange{2, 2}}),
            (std::vector{can::IdRange{1, 3}}));
  EXPECT_FALSE(can::covers(std::vector{can::IdRange{1, 3}}, std::vector{can::IdRange{3, 4}}));
  EXPECT_TRUE(
      can::covers(std::vector{can::IdRange{1, 3}, can::all_extended}, std::vector{can::only(can::extended_flag)}));
  EXPECT_FALSE(can::contains({}, 0));
}

// ---- times ----

constexpr std::int64_t day = 1'700'000'000'000'000'000;  // ns of the wall clock

TEST(SocketCanTime, AFrameIsAsOldAsTheWallClockSays) {
  StampMap map;
  map.begin(rt::Time{10s}, day);
  EXPECT_EQ(map.at(day - 2'000'000, rt::Time{10s}), rt::Time{10s} - 2ms);
  EXPECT_EQ(map.at(day - 1'000'000, rt::Time{10s}), rt::Time{10s} - 1ms);
  EXPECT_EQ(map.at({}, rt::Time{10s} - 1ns), rt::Time{10s} - 1ns);  // without a stamp, and before the latest
}

TEST(SocketCanTime, ItNeverGoesBackAndNeverBeyondNow) {
  StampMap map;
  map.begin(rt::Time{10s}, day);
  EXPECT_EQ(map.at(day - 1'000'000, rt::Time{10s}), rt::Time{10s} - 1ms);
  EXPECT_EQ(map.at(day - 5'000'000, rt::Time{10s}), rt::Time{10s} - 1ms);
  EXPECT_EQ(map.at(day + 5'000'000, rt::Time{10s}), rt::Time{10s});
  EXPECT_EQ(map.not_before(rt::Time{9s}), rt::Time{10s});
  EXPECT_EQ(map.not_before(rt::Time{11s}), rt::Time{11s});
  map.begin(rt::Time{12s}, day + 2'000'000'000);
  EXPECT_EQ(map.at(day + 500'000'000, rt::Time{12s}), rt::Time{11s});
}

TEST(SocketCanTime, AWallClockThatIsSetMovesNoFrame) {
  for (const std::int64_t step : {3'600'000'000'000LL, -3'600'000'000'000LL}) {
    StampMap map;
    map.begin(rt::Time{10s}, day);
    EXPECT_EQ(map.at(day - 1'000, rt::Time{10s}), rt::Time{10s} - 1us);
    // Stamped before the clock was set, read after.
    map.begin(rt::Time{11s}, day + 1'000'000'000 + step);
    EXPECT_EQ(map.at(day + 999'000'000, rt::Time{11s}), rt::Time{11s});
    map.begin(rt::Time{12s}, day + 2'000'000'000 + step);
    EXPECT_EQ(map.at(day + 1'999'000'000 + step, rt::Time{12s}), rt::Time{12s} - 1ms);
  }
}

// The wall clock is not read for every batch: for 100 ms it runs as it did, unless a stamp says that it was set.
TEST(SocketCanTime, ForAWhileTheWallClockRunsAsItDid) {
  StampMap map;
  EXPECT_FALSE(map.begin_as_before(rt::Time{10s}, day));
  map.begin(rt::Time{10s}, day);
  ASSERT_TRUE(map.begin_as_before(rt::Time{10s} + 50ms, day + 49'000'000));
  EXPECT_EQ(map.wall(), day + 50'000'000);
  EXPECT_EQ(map.at(day + 49'000'000, rt::Time{11s}), rt::Time{10s} + 49ms);
  EXPECT_FALSE(map.begin_as_before(rt::Time{10s} + 100ms, day + 99'000'000)) << "too long ago";
  EXPECT_FALSE(map.begin_as_before(rt::Time{10s} + 60ms, {}));
  EXPECT_FALSE(map.begin_as_before(rt::Time{10s} + 60ms, day + 61'000'000)) << "of the future: set forward";
  EXPECT_FALSE(map.begin_as_before(rt::Time{10s} + 60ms, day + 40'000'000)) << "20 ms old: set back";
  EXPECT_EQ(map.at(day + 49'500'000, rt::Time{11s}), rt::Time{10s} + 49ms + 500us) << "the batch is the one before";
}

}  // namespace
}  // namespace berth::io
