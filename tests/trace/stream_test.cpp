// Every format with every other: what one can hold comes through the other, whatever the pieces are.
#include "berth/trace/stream.hpp"

#include <gtest/gtest.h>
#include <rapidcheck/gtest.h>
#include <chrono>
#include <cstdint>
#include <string>
#include <vector>

#include "berth/can/length.hpp"
#include "formats.hpp"

namespace berth::trace {
namespace {

using namespace std::chrono_literals;
using test::Kept;
using test::read;
using test::write;

can::Frame any_frame() {
  const auto id = *rc::gen::oneOf(rc::gen::arbitrary<std::uint32_t>(), rc::gen::inRange<std::uint32_t>(0, 16));
  const auto bytes = *rc::gen::container<std::vector<std::uint8_t>>(*rc::gen::inRange<std::size_t>(0, 9),
                                                                    rc::gen::arbitrary<std::uint8_t>());
  can::Frame frame = *rc::gen::arbitrary<bool>() ? can::Frame::ext(id, bytes) : can::Frame::base(id, bytes);
  const int kind = *rc::gen::inRange(0, 6);
  if (kind == 0) frame.remote = true;
  if (kind == 1) {
    frame.fd = true;
    frame.brs = *rc::gen::arbitrary<bool>();
    frame.esi = *rc::gen::arbitrary<bool>();
    frame.size = *rc::gen::elementOf(std::vector<std::uint8_t>{0, 3, 8, 12, 16, 20, 24, 32, 48, 64});
    for (unsigned i = 0; i < frame.size; ++i) frame.data[i] = static_cast<std::uint8_t>(i * 7 + id);
  }
  return frame;
}

// Microseconds from 1970 to 2050, any directions, error frames, up to three buses.
Trace any_trace() {
  Trace trace;
  rt::Duration at = std::chrono::microseconds(*rc::gen::inRange<std::int64_t>(0, 2'500'000'000'000'000));
  const auto count = *rc::gen::inRange<std::size_t>(1, 25);
  for (std::size_t i = 0; i < count; ++i) {
    Entry entry;
    at += std::chrono::microseconds(*rc::gen::inRange<std::int64_t>(0, 3'000'000));
    entry.at = at;
    entry.bus = trace.bus(*rc::gen::elementOf(std::vector<std::string>{"can0", "can1", "backbone", "x"}));
    entry.direction = *rc::gen::elementOf(std::vector{Direction::unknown, Direction::received, Direction::sent});
    entry.frame = any_frame();
    if (*rc::gen::inRange(0, 8) == 0) {
      entry.error = true;
      entry.frame = can::Frame::base(0, {0, 8, 0, 0, 0, 0, 1, 2});
      entry.frame.id = *rc::gen::inRange<std::uint32_t>(0, 0x200);
    }
    trace.entries.push_back(entry);
  }
  return trace;
}

// What is left of a trace behind a format.
Trace held(Trace trace, Format format) {
  if (format == Format::candump || format == Format::pcapng) return trace;
  for (auto& entry : trace.entries) {
    if (entry.error) {
      entry.direction = Direction::unknown;
      entry.frame = can::Frame();
    } else if (entry.direction == Direction::unknown) {
      entry.direction = Direction::received;
    }
  }
  return trace;
}
Trace without_details(Trace trace) {
  for (auto& entry : trace.entries) {
    if (!entry.error) continue;
    entry.direction = Direction::unknown;
    entry.frame = can::Frame();
  }
  return trace;
}

bool same(const Trace& a, const Trace& b) {
  if (a.entries.size() != b.entries.size()) return false;
  for (std::size_t i = 0; i < a.entries.size(); ++i) {
    const auto& x = a.entries[i];
    const auto& y = b.entries[i];
    if (x.at != y.at || x.error != y.error || x.direction != y.direction || !(x.frame == y.frame)) return false;
    if (x.frame.esi != y.frame.esi || a.buses[x.bus] != b.buses[y.bus]) return false;
  }
  return true;
}

RC_GTEST_PROP(TraceFormats, EveryPairKeepsWhatBothCanHold, ()) {
  const Trace trace = any_trace();
  for (const Format first : all_formats) {
    for (const Format second : all_formats) {
      const auto one = read(first, write(first, trace).bytes, *rc::gen::inRange<std::size_t>(1, 100));
      RC_ASSERT(one.errors() == 0U);
      const auto two = read(second, write(second, one.trace).bytes, *rc::gen::inRange<std::size_t>(1, 100));
      RC_ASSERT(two.errors() == 0U);
      const bool lossy = first == Format::asc || first == Format::trc || second == Format::asc || second == Format::trc;
      const auto expected = held(held(trace, first), second);
      const bool same_again =
          lossy ? same(without_details(two.trace), without_details(expected)) : same(two.trace, expected);
      RC_ASSERT(same_again);
    }
  }
}

RC_GTEST_PROP(TraceFormats, PcapngKeepsNanoseconds, ()) {
  Trace trace = any_trace();
  for (auto& e : trace.entries) e.at += std::chrono::nanoseconds(*rc::gen::inRange(0, 1000));
  RC_ASSERT(same(read(Format::pcapng, write(Format::pcapng, trace).bytes).trace, trace));
}

RC_GTEST_PROP(TraceFormats, Trc11KeepsClassicFramesToATenthOfAMillisecond, ()) {
  Trace trace = any_trace();
  std::erase_if(trace.entries, [](const Entry& e) { return e.frame.fd; });
  const auto kept = read(Format::trc, write(Format::trc, trace, {.trc_1_1 = true}).bytes);
  RC_ASSERT(kept.errors() == 0U);
  RC_ASSERT(kept.trace.entries.size() == trace.entries.size());
  for (std::size_t i = 0; i < trace.entries.size(); ++i) {
    const auto& a = trace.entries[i];
    const auto& b = kept.trace.entries[i];
    RC_ASSERT(std::chrono::abs(a.at - b.at) <= 50us);
    RC_ASSERT(a.error == b.error);
    if (!a.error) RC_ASSERT(a.frame == b.frame);
  }
}

TEST(TraceFormats, AreKnownByContentAndName) {
  Trace trace;
  trace.buses = {"can0"};
  trace.entries.push_back({1s, 0, can::Frame::base(1, {1})});
  for (const Format format : all_formats) {
    const auto bytes = write(format, trace).bytes;
    EXPECT_EQ(recognise(std::string_view(bytes).substr(0, head_size)), format);
    EXPECT_EQ(parse_format(name(format)), format);
  }
  EXPECT_EQ(recognise("nonsense\n(1.000000) can0 1#\n"), Format::candump) << "a wrong line first";
  EXPECT_EQ(recognise("     1)      1841 0001 8  00\n"), Format::trc);
  EXPECT_EQ(recognise("BASE HEX  timestamps absolute\n"), Format::asc);
  EXPECT_FALSE(recognise(""));
  EXPECT_FALSE(recognise("hello\nworld\n"));
  EXPECT_EQ(format_of_path("a/b.LOG"), Format::candump);
  EXPECT_EQ(format_of_path("b.pcapng"), Format::pcapng);
  EXPECT_EQ(format_of_path("b.trc"), Format::trc);
  EXPECT_FALSE(format_of_path("b"));
  EXPECT_FALSE(format_of_path("b.txt"));
}

TEST(TraceFormats, LongLinesAreLeftOutInBoundedMemory) {
  Kept kept;
  const auto reader = make_reader(Format::candump, "t.log");
  reader->feed("(1.000000) can0 1#\n", kept);
  const std::string piece(10'000, 'x');
  for (int i = 0; i < 100; ++i) reader->feed(piece, kept);
  reader->feed("\n(2.000000) can0 2#\n(3.000000) can0 3#", kept);
  reader->finish(kept);
  EXPECT_EQ(kept.trace.entries.size(), 3U);
  ASSERT_EQ(kept.findings.size(), 2U) << kept.text();
  EXPECT_EQ(kept.findings[0].line, 2);
  EXPECT_EQ(kept.findings[1].line, 4) << "no line end: it may be cut short";
  EXPECT_EQ(kept.findings[1].severity, Finding::Severity::note);
}

TEST(TraceFormats, NothingWrittenIsAFileAllTheSame) {
  for (const Format format : all_formats) {
    const auto kept = read(format, write(format, {}).bytes);
    EXPECT_EQ(kept.errors(), 0U) << name(format) << kept.text();
    EXPECT_TRUE(kept.trace.entries.empty());
  }
}

TEST(TraceFormats, ErrorFramesAndDirectionsOfCandump) {
  const auto kept =
      read(Format::candump, "(1.000000) can0 20000004#0008000000000000 R\n(1.000000) can0 123#AA T\n(1.0) x\n");
  ASSERT_EQ(kept.trace.entries.size(), 2U);
  EXPECT_TRUE(kept.trace.entries[0].error);
  EXPECT_EQ(kept.trace.entries[0].frame.id, 4U);
  EXPECT_EQ(kept.trace.entries[0].frame.data[1], 8);
  EXPECT_EQ(kept.trace.entries[0].direction, Direction::received);
  EXPECT_EQ(kept.trace.entries[1].direction, Direction::sent);
  EXPECT_EQ(kept.errors(), 1U);
  EXPECT_EQ(write(Format::candump, kept.trace, {.directions = false}).bytes,
            "(0000000001.000000) can0 20000004#0008000000000000\n(0000000001.000000) can0 123#AA\n");
}

}  // namespace
}  // namespace berth::trace
