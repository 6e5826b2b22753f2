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

// The quick way does what the other does, and leaves alone what it cannot do.
TEST(SdoSegments, TheQuickWayIsTheOtherInFewerSteps) {
  for (std::size_t size = 0; size < 40; ++size) {
    const auto bytes = counted(size);
    SdoClientData slow_data(100), quick_data(100);
    slow_data.download(bytes);
    quick_data.download(bytes);
    SdoSegments slow, quick;
    can::Frame a, b;
    bool more = true;
    for (std::uint8_t toggle = 0; more; toggle ^= sdo::toggle_bit) {
      const bool whole = size - slow_data.done() > sdo::segment_bytes;
      ASSERT_EQ(slow.request(a, slow_data).what, What::request);
      ASSERT_EQ(quick.quick_request(b, quick_data), whole) << size;
      ASSERT_TRUE(whole || quick.request(b, quick_data).what == What::request);
      ASSERT_EQ(load_le<std::uint64_t>(a.data.data()), load_le<std::uint64_t>(b.data.data())) << size;
      const auto other = segment_answer(static_cast<std::uint8_t>(0x20U | (toggle ^ sdo::toggle_bit)));
      ASSERT_FALSE(quick.quick_answered(other, quick_data)) << "the toggle bit";
      const auto answer = segment_answer(static_cast<std::uint8_t>(0x20U | toggle));
      more = slow.answered(answer, slow_data).what == What::request;
      ASSERT_EQ(quick.quick_answered(answer, quick_data), more);
      ASSERT_EQ(slow_data.done(), quick_data.done());
    }
  }
}

TEST(SdoSegments, TheQuickWayTakesNoMoreThanIsAllowedOrIndicated) {
  const auto whole = [](std::uint8_t toggle) { return segment_answer(toggle, {1, 2, 3, 4, 5, 6, 7}); };
  SdoClientData allowed(13);
  ASSERT_EQ(allowed.open(false, 0), AbortCode::none);
  SdoSegments a;
  EXPECT_TRUE(a.quick_answered(whole(0x00), allowed));
  EXPECT_FALSE(a.quick_answered(whole(0x00), allowed)) << "the toggle bit";
  EXPECT_FALSE(a.quick_answered(whole(0x10), allowed)) << "14 of 13 bytes";
  EXPECT_EQ(a.answered(whole(0x10), allowed).code, AbortCode::out_of_memory);
  SdoClientData indicated(100);
  ASSERT_EQ(indicated.open(true, 13), AbortCode::none);
  SdoSegments b;
  EXPECT_TRUE(b.quick_answered(whole(0x00), indicated));
  EXPECT_FALSE(b.quick_answered(whole(0x10), indicated));
  EXPECT_EQ(b.answered(whole(0x10), indicated).code, AbortCode::length_too_high);
  for (const unsigned command : {0x01U, 0x02U, 0x20U, 0x60U, 0x80U}) {
    SdoClientData data(100);
    ASSERT_EQ(data.open(false, 0), AbortCode::none);
    EXPECT_FALSE(SdoSegments().quick_answered(segment_answer(static_cast<std::uint8_t>(command), counted(7)), data))
        << command;
    EXPECT_EQ(data.done(), 0U);
  }
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

// ---- values

TEST(SdoValue, SegmentsAreAppendedAsOtherBytesAre) {
  for (const bool reserved : {false, true}) {
    for (std::size_t first = 0; first < 30; ++first) {
      const auto bytes = counted(first + 7 * 200 + 5);
      const std::span<const std::uint8_t> all(bytes);
      SdoValue value;
      if (reserved) value.reserve(bytes.size());
      value.append(all.first(first));
      for (std::size_t at = first; at < first + 7 * 200; at += 7) {
        value.append_segment(bytes.data() + at);
        ASSERT_EQ(value.size(), at + 7);
      }
      const SdoValue copy = value;
      value.append(all.last(5));
      ASSERT_TRUE(std::ranges::equal(value.bytes(), all)) << first;
      ASSERT_TRUE(std::ranges::equal(copy.bytes(), all.first(bytes.size() - 5)));
      ASSERT_FALSE(copy == value);
      std::ranges::fill(std::span(value.extend(14), 14), std::uint8_t{9});
      value.drop_back(14);
      ASSERT_EQ(value, SdoValue(all));
    }
  }
}

}  // namespace
}  // namespace berth::co
