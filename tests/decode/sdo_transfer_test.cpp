// SDO transfers out of frames that were written down by hand from CiA 301 §7.2.4.3.
#include "berth/decode/sdo_transfer.hpp"

#include <gtest/gtest.h>
#include <chrono>
#include <cstdint>
#include <string>
#include <vector>

#include <numeric>

namespace berth::decode {
namespace {

using namespace std::chrono_literals;
using End = SdoRecord::End;
using Mode = SdoRecord::Mode;
using Bytes = std::vector<std::uint8_t>;

class Heard final : public SdoTransfer::Listener {
 public:
  void ended(const SdoRecord& record) override { records.push_back(record); }
  void client(std::initializer_list<std::uint8_t> bytes) { put(bytes, true); }
  void server(std::initializer_list<std::uint8_t> bytes) { put(bytes, false); }
  void put(std::vector<std::uint8_t> bytes, bool request) {
    bytes.resize(8);
    transfer.frame(can::Frame::base(0x605, bytes), request, at, *this);
    at += 1ms;
  }
  SdoTransfer transfer;
  std::vector<SdoRecord> records;
  rt::Duration at{};
};

TEST(SdoTransfer, ExpeditedReadAndWrite) {
  Heard h;
  h.client({0x40, 0x18, 0x10, 0x01});
  h.server({0x43, 0x18, 0x10, 0x01, 1, 2, 3, 4});
  h.client({0x2B, 0x17, 0x10, 0x00, 0xF4, 0x01});
  h.server({0x60, 0x17, 0x10, 0x00});
  h.client({0x22, 0x00, 0x20, 0x05, 9, 8, 7, 6});  // no size: all four bytes
  h.server({0x60, 0x00, 0x20, 0x05});
  ASSERT_EQ(h.records.size(), 3U);
  EXPECT_EQ(h.records[0].object, (ObjectRef{0x1018, 1}));
  EXPECT_FALSE(h.records[0].write);
  EXPECT_EQ(h.records[0].bytes, (Bytes{1, 2, 3, 4}));
  EXPECT_EQ(h.records[0].frames, 2U);
  EXPECT_EQ(h.records[0].last - h.records[0].began, 1ms);
  EXPECT_TRUE(h.records[1].write);
  EXPECT_EQ(h.records[1].bytes, (Bytes{0xF4, 0x01}));
  EXPECT_TRUE(h.records[1].sized);
  EXPECT_FALSE(h.records[2].sized);
  EXPECT_EQ(h.records[2].bytes.size(), 4U);
  for (const auto& r : h.records) EXPECT_EQ(r.end, End::done);
}

TEST(SdoTransfer, SegmentedReadWithARepeatedSegment) {
  Heard h;
  h.client({0x40, 0x08, 0x10, 0x00});
  h.server({0x41, 0x08, 0x10, 0x00, 10});
  h.client({0x60});
  h.server({0x00, 'B', 'e', 'r', 't', 'h', ' ', 'd'});
  h.server({0x00, 'B', 'e', 'r', 't', 'h', ' ', 'd'});  // the same toggle bit again
  h.client({0x70});
  h.server({0x19, 'e', 'v', 'i'});  // toggle, 4 unused, last
  ASSERT_EQ(h.records.size(), 1U);
  EXPECT_EQ(std::string(h.records[0].bytes.begin(), h.records[0].bytes.end()), "Berth devi");
  EXPECT_EQ(h.records[0].announced, 10U);
  EXPECT_EQ(h.records[0].mode, Mode::segmented);
  EXPECT_EQ(h.records[0].frames, 7U);
}

TEST(SdoTransfer, SegmentedWriteWithoutASize) {
  Heard h;
  h.client({0x20, 0x00, 0x20, 0x00});
  h.server({0x60, 0x00, 0x20, 0x00});
  h.client({0x00, 1, 2, 3, 4, 5, 6, 7});
  h.server({0x20});
  h.client({0x1D, 8});  // toggle, 6 unused, last
  h.server({0x30});
  ASSERT_EQ(h.records.size(), 1U);
  EXPECT_EQ(h.records[0].bytes, (Bytes{1, 2, 3, 4, 5, 6, 7, 8}));
  EXPECT_FALSE(h.records[0].announced);
  EXPECT_TRUE(h.records[0].write);
}

TEST(SdoTransfer, AZeroByteSegmentedObject) {
  Heard h;
  h.client({0x40, 0x00, 0x20, 0x00});
  h.server({0x41, 0x00, 0x20, 0x00, 0});
  h.client({0x60});
  h.server({0x0F});
  ASSERT_EQ(h.records.size(), 1U);
  EXPECT_EQ(h.records[0].length, 0U);
  EXPECT_EQ(h.records[0].end, End::done);
}

// Block download of 20 bytes in two sub-blocks; the second segment of the first is lost and comes again.
TEST(SdoTransfer, BlockWriteWithALostSegment) {
  Heard h;
  h.client({0xC6, 0x50, 0x1F, 0x01, 20});
  h.server({0xA4, 0x50, 0x1F, 0x01, 3});
  h.client({0x01, 1, 2, 3, 4, 5, 6, 7});
  h.client({0x03, 15, 16, 17, 18, 19, 20, 0});  // 02h is missing
  h.server({0xA2, 1, 3});
  h.client({0x01, 8, 9, 10, 11, 12, 13, 14});
  h.client({0x82, 15, 16, 17, 18, 19, 20, 0});
  h.server({0xA2, 2, 3});
  h.client({0xC5, 0x12, 0x34});  // one byte of the last segment is unused
  h.server({0xA1});
  ASSERT_EQ(h.records.size(), 1U);
  Bytes expected(20);
  std::iota(expected.begin(), expected.end(), std::uint8_t{1});
  EXPECT_EQ(h.records[0].bytes, expected);
  EXPECT_EQ(h.records[0].mode, Mode::block);
  EXPECT_EQ(h.records[0].end, End::done);
  EXPECT_EQ(h.records[0].frames, 10U);
}

// The receiver had it, and the log has not: what stands behind the gap is not put in its place.
TEST(SdoTransfer, ABlockWriteOfWhichTheLogLacksASegment) {
  Heard h;
  h.client({0xC6, 0x50, 0x1F, 0x01, 21});
  h.server({0xA4, 0x50, 0x1F, 0x01, 3});
  h.client({0x01, 1, 2, 3, 4, 5, 6, 7});
  h.client({0x83, 15, 16, 17, 18, 19, 20, 21});  // 02h is not in the log
  h.server({0xA2, 3, 3});
  h.client({0xC1, 0x12, 0x34});
  h.server({0xA1});
  h.client({0x40, 0x00, 0x10, 0x00});
  h.server({0x43, 0x00, 0x10, 0x00, 1, 0, 0, 0});
  ASSERT_FALSE(h.records.empty());
  EXPECT_EQ(h.records[0].bytes, (Bytes{1, 2, 3, 4, 5, 6, 7}));
}

// Segments that were all recorded, and of which the receiver acknowledged fewer: they come again.
TEST(SdoTransfer, BlockReadWhereFewerAreAcknowledged) {
  Heard h;
  h.client({0xA4, 0x21, 0x10, 0x00, 127, 0});
  h.server({0xC6, 0x21, 0x10, 0x00, 14});
  h.client({0xA3});
  h.server({0x01, 1, 2, 3, 4, 5, 6, 7});
  h.server({0x82, 8, 9, 10, 11, 12, 13, 14});
  h.client({0xA2, 1, 127});
  h.server({0x81, 8, 9, 10, 11, 12, 13, 14});
  h.client({0xA2, 1, 127});
  h.server({0xC1, 0, 0});
  h.client({0xA1});
  ASSERT_EQ(h.records.size(), 1U);
  Bytes expected(14);
  std::iota(expected.begin(), expected.end(), std::uint8_t{1});
  EXPECT_EQ(h.records[0].bytes, expected);
  EXPECT_FALSE(h.records[0].write);
}

TEST(SdoTransfer, ABlockReadThatTheServerAnswersExpedited) {
  Heard h;
  h.client({0xA4, 0x17, 0x10, 0x00, 127, 4});
  h.server({0x4B, 0x17, 0x10, 0x00, 0xF4, 0x01});
  ASSERT_EQ(h.records.size(), 1U);
  EXPECT_EQ(h.records[0].mode, Mode::expedited);
  EXPECT_EQ(h.records[0].bytes, (Bytes{0xF4, 0x01}));
}

TEST(SdoTransfer, AbortsOfEitherSide) {
  Heard h;
  h.client({0x40, 0x00, 0x20, 0x00});
  h.server({0x80, 0x00, 0x20, 0x00, 0x00, 0x00, 0x02, 0x06});
  h.client({0x21, 0x00, 0x20, 0x00, 100});
  h.server({0x60, 0x00, 0x20, 0x00});
  h.client({0x80, 0x00, 0x20, 0x00, 0x00, 0x00, 0x04, 0x05});
  h.server({0x80, 0x01, 0x20, 0x00, 0x01, 0x00, 0x01, 0x06});  // of nothing that was seen
  ASSERT_EQ(h.records.size(), 3U);
  EXPECT_EQ(h.records[0].end, End::aborted_by_server);
  EXPECT_EQ(h.records[0].abort, 0x0602'0000U);
  EXPECT_EQ(h.records[1].end, End::aborted_by_client);
  EXPECT_EQ(h.records[1].abort, 0x0504'0000U);
  EXPECT_EQ(h.records[2].frames, 1U);
  EXPECT_EQ(h.records[2].object, (ObjectRef{0x2001, 0}));
}

TEST(SdoTransfer, WhatIsNotAnsweredAndWhatBelongsToNothing) {
  Heard h;
  h.server({0x43, 0x18, 0x10, 0x01, 1});  // stray
  h.client({0x40, 0x18, 0x10, 0x01});
  h.client({0x40, 0x18, 0x10, 0x02});     // the one before got no answer
  h.server({0x43, 0x18, 0x10, 0x01, 1});  // late: of the one before
  h.server({0x43, 0x18, 0x10, 0x02, 2});
  h.client({0x40, 0x18, 0x10, 0x03});
  h.transfer.finish(h);
  ASSERT_EQ(h.records.size(), 5U);
  EXPECT_EQ(h.records[0].end, End::stray);
  EXPECT_EQ(h.records[1].end, End::unfinished);
  EXPECT_EQ(h.records[1].object.sub, 1);
  EXPECT_EQ(h.records[2].end, End::stray) << "a late answer does not end the next transfer";
  EXPECT_EQ(h.records[3].end, End::done);
  EXPECT_EQ(h.records[3].bytes[0], 2);
  EXPECT_EQ(h.records[4].end, End::unfinished);
  h.transfer.finish(h);
  EXPECT_EQ(h.records.size(), 5U);
}

TEST(SdoTransfer, KeepsTheBeginningOfALongValueOnly) {
  Heard h;
  h.client({0x20, 0x00, 0x20, 0x00});
  h.server({0x60, 0x00, 0x20, 0x00});
  for (unsigned i = 0; i < 10'000; ++i) {
    const std::uint8_t toggle = i % 2 == 0 ? 0 : 0x10;
    h.put({static_cast<std::uint8_t>(toggle | (i == 9'999 ? 1 : 0)), 1, 2, 3, 4, 5, 6, 7}, true);
    h.put({static_cast<std::uint8_t>(0x20 | toggle)}, false);
  }
  ASSERT_EQ(h.records.size(), 1U);
  EXPECT_EQ(h.records[0].length, 70'000U);
  EXPECT_EQ(h.records[0].bytes.size(), SdoRecord::most_kept);
}

}  // namespace
}  // namespace berth::decode
