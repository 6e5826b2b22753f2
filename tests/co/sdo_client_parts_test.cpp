// The parts of an SDO client's transfer by themselves: its bytes, and its segments.
#include <gtest/gtest.h>

#include <numeric>
#include <vector>

#include "berth/co/sdo_client_stream.hpp"
#include "berth/co/sdo_segments.hpp"

namespace berth::co {
namespace {

using What = SdoSegments::Step::What;

std::vector<std::uint8_t> counted(std::size_t size) {
  std::vector<std::uint8_t> bytes(size);
  std::iota(bytes.begin(), bytes.end(), std::uint8_t{1});
  return bytes;
}

// A server's answer of this command byte and these bytes.
can::Frame segment_answer(std::uint8_t command, std::vector<std::uint8_t> bytes = {}) {
  can::Frame frame = sdo::make(0x581, command);
  std::ranges::copy(bytes, frame.data.begin() + 1);
  return frame;
}

// ---- segments

TEST(SdoSegments, ADownloadAlternatesTheToggleAndSaysWhatOfTheLastCounts) {
  const auto bytes = counted(9);
  SdoClientData data(100);
  data.download(bytes);
  SdoSegments segments;
  can::Frame request;
  ASSERT_EQ(segments.request(request, data).what, What::request);
  EXPECT_EQ(request.data[0], 0x00);
  EXPECT_EQ(request.data[7], 7);
  ASSERT_EQ(segments.answered(segment_answer(0x20), data).what, What::request);
  ASSERT_EQ(segments.request(request, data).what, What::request);
  EXPECT_EQ(request.data[0], 0x1B) << "toggle, five bytes that do not count, the last";
  EXPECT_EQ(request.data[2], 9);
  EXPECT_EQ(request.data[3], 0);
  EXPECT_EQ(segments.answered(segment_answer(0x30), data).what, What::done);
  EXPECT_EQ(data.done(), 9U);
}

TEST(SdoSegments, AnEmptyObjectIsOneSegment) {
  SdoClientData data(100);
  data.download({});
  SdoSegments segments;
  can::Frame request;
  ASSERT_EQ(segments.request(request, data).what, What::request);
  EXPECT_EQ(request.data[0], 0x0F);
  EXPECT_EQ(segments.answered(segment_answer(0x20), data).what, What::done);
}

TEST(SdoSegments, AnUploadIsKeptToTheLengthThatWasIndicated) {
  for (const std::size_t indicated : {8U, 9U, 10U}) {
    SdoClientData data(100);
    ASSERT_EQ(data.open(true, indicated), AbortCode::none);
    SdoSegments segments;
    ASSERT_EQ(segments.answered(segment_answer(0x00, {1, 2, 3, 4, 5, 6, 7}), data).what, What::request);
    const auto end = segments.answered(segment_answer(0x1B, {8, 9}), data);
    EXPECT_EQ(end.what, indicated == 9 ? What::done : What::refuse) << indicated;
    EXPECT_EQ(end.code, indicated == 8    ? AbortCode::length_too_high
                        : indicated == 10 ? AbortCode::length_too_low
                                          : AbortCode::none);
  }
}

TEST(SdoSegments, AnUploadOfUnknownSizeEndsAtTheLongestAllowed) {
  SdoClientData data(8);
  ASSERT_EQ(data.open(false, 0), AbortCode::none);
  SdoSegments segments;
  ASSERT_EQ(segments.answered(segment_answer(0x00, counted(7)), data).what, What::request);
  EXPECT_EQ(segments.answered(segment_answer(0x10, counted(7)), data).code, AbortCode::out_of_memory);
}

TEST(SdoSegments, ARepeatedToggleAndAnotherCommandAreRefused) {
  SdoClientData data(100);
  SdoSegments segments;
  EXPECT_EQ(segments.answered(segment_answer(0x10), data).code, AbortCode::toggle_bit);
  EXPECT_EQ(segments.answered(segment_answer(0x20), data).code, AbortCode::command_specifier);
  EXPECT_EQ(segments.answered(segment_answer(0x0E), data).code, AbortCode::general) << "empty, and not the last";
}

// ---- bytes

struct HalfReadySource final : SdoSource {
  [[nodiscard]] std::optional<std::size_t> size() const noexcept override { return 10; }
  od::Answer<std::size_t> read(std::span<std::uint8_t> into) noexcept override {
    std::ranges::fill(into, std::uint8_t{0xAB});
    return into.size();
  }
  [[nodiscard]] std::size_t ready() const noexcept override { return has; }
  bool rewind() noexcept override { return rewinds; }
  std::size_t has = 3;
  bool rewinds = false;
};

TEST(SdoClientData, ASourceThatHasTooLittleIsWaitedFor) {
  HalfReadySource source;
  SdoClientStream stream;
  stream.source = &source;
  SdoClientData data(100);
  data.use(stream);
  ASSERT_TRUE(data.is_download());
  data.begin();
  EXPECT_TRUE(data.rewind()) << "nothing was read yet";
  const auto early = data.window(7);
  ASSERT_FALSE(early.has_value());
  EXPECT_EQ(early.error(), AbortCode::pending);
  source.has = 100;
  ASSERT_EQ(data.window(7)->size(), 10U) << "never more than it said";
  data.consume(7);
  EXPECT_EQ(data.window(7)->size(), 3U);
  EXPECT_FALSE(data.rewind()) << "bytes were read, and this source cannot";
  source.rewinds = true;
  EXPECT_TRUE(data.rewind());
}

TEST(SdoClientData, OfASubBlockOnlyWhatCountsIsKept) {
  SdoClientData data(100);
  ASSERT_EQ(data.open(true, 10), AbortCode::none);
  std::ranges::copy(counted(14), data.extend(14));
  const auto bytes = data.filled(7, 7);
  EXPECT_EQ(data.keep(bytes), AbortCode::none);
  EXPECT_TRUE(data.too_few());
  std::ranges::copy(counted(7), data.extend(7));
  EXPECT_EQ(data.keep(data.filled(3, 4)), AbortCode::none);
  EXPECT_FALSE(data.too_few());
  EXPECT_EQ(data.value().size(), 10U);
  EXPECT_EQ(data.value().bytes()[9], 3);
  EXPECT_TRUE(data.too_many(1));
}

struct PendingSink final : SdoSink {
  od::AbortCode write(std::span<const std::uint8_t> bytes) noexcept override {
    taken += bytes.size();
    return od::AbortCode::pending;
  }
  std::size_t taken = 0;
};

TEST(SdoClientData, ASinkThatIsNotReadyHasTakenTheBytes) {
  PendingSink sink;
  SdoClientStream stream;
  stream.sink = &sink;
  SdoClientData data(2);
  data.use(stream);
  EXPECT_FALSE(data.is_download());
  ASSERT_EQ(data.open(false, 0), AbortCode::none);
  EXPECT_EQ(data.put(counted(7)), AbortCode::pending) << "longer than a value may be: that is the sink's affair";
  EXPECT_EQ(data.put({}), AbortCode::none) << "never empty";
  EXPECT_EQ(sink.taken, 7U);
  EXPECT_EQ(data.done(), 7U);
}

}  // namespace
}  // namespace berth::co
