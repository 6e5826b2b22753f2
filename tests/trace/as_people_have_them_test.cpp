// Logs as today's tools write them, and as people pass them on.
#include <fmt/format.h>
#include <gtest/gtest.h>
#include <zlib.h>

#include <array>
#include <chrono>
#include <string>

#include "berth/trace/any_file.hpp"
#include "berth/trace/gunzip.hpp"
#include "formats.hpp"

namespace berth::trace::test {
namespace {

using namespace std::chrono_literals;

std::vector<std::string> frames(const Trace& trace) {
  std::vector<std::string> all;
  for (const auto& e : trace.entries) all.push_back(trace.buses[e.bus] + " " + can::to_string(e.frame));
  return all;
}
using Rows = std::vector<std::string>;

}  // namespace

TEST(CandumpOfToday, BlanksPadTheNamesOfBuses) {
  const auto kept =
      read(Format::candump, "(1.000000)  can0 701#05\n(1.100000) vcan0 705#05\n(1.200000)   c1  706#05  \n");
  EXPECT_EQ(kept.findings.size(), 0U) << kept.text();
  EXPECT_EQ(frames(kept.trace), (Rows{"can0 701#05", "vcan0 705#05", "c1 706#05"}));
}

TEST(CandumpOfToday, TimesHaveAnyNumberOfDigits) {
  const auto kept = read(Format::candump,
                         "(1714557600.123456789) can0 701#05\n(1714557601.5) can0 701#05\n"
                         " (1714557602.123456789)  can0  701   [1]  05\n"
                         " (2024-05-01 10:00:03.000000001)  can0  701   [1]  05\n");
  EXPECT_EQ(kept.findings.size(), 0U) << kept.text();
  ASSERT_EQ(kept.trace.entries.size(), 4U);
  EXPECT_EQ(kept.trace.entries[0].at, 1714557600s + 123456789ns);
  EXPECT_EQ(kept.trace.entries[1].at, 1714557601s + 500ms);
  EXPECT_EQ(kept.trace.entries[2].at, 1714557602s + 123456789ns);
  EXPECT_EQ(kept.trace.entries[3].at, 1714557603s + 1ns);
}

TEST(CandumpOfToday, AByteOrderMarkIsNoPartOfALine) {
  const auto kept = read(Format::candump, "\xEF\xBB\xBF(1.000000) can0 701#05\n", 2);
  EXPECT_EQ(kept.findings.size(), 0U) << kept.text();
  EXPECT_EQ(kept.trace.entries.size(), 1U);
}

TEST(CandumpOfToday, ADlcAboveEight) {
  const auto kept = read(Format::candump,
                         "(1.000000) can0 123#0011223344556677_F\n(1.000000) can0 123#R8_9\n"
                         " (1.000000)  can0  123  {F}  00 11 22 33 44 55 66 77\n");
  EXPECT_EQ(kept.findings.size(), 0U) << kept.text();
  EXPECT_EQ(frames(kept.trace), (Rows{"can0 123#0011223344556677", "can0 123#R8", "can0 123#0011223344556677"}));
  EXPECT_EQ(read(Format::candump, "(1.000000) can0 123#00_F\n").errors(), 1U);
  EXPECT_EQ(read(Format::candump, "(1.000000) can0 123#0011223344556677_8\n").errors(), 1U);
}

TEST(CandumpOfToday, WordsBelowAnErrorFrameBelongToIt) {
  const auto kept =
      read(Format::candump,
           "  can0  20000004   [8]  00 04 00 00 00 00 00 00   ERRORFRAME\n"
           "\tcontroller-problem{rx-error-warning}\n\terror-counter-tx-rx{{0}{96}}\n  can0  701   [1]  00\n");
  EXPECT_EQ(kept.findings.size(), 0U) << kept.text();
  ASSERT_EQ(kept.trace.entries.size(), 2U);
  EXPECT_TRUE(kept.trace.entries[0].error);
  EXPECT_EQ(read(Format::candump, "  can0  701   [1]  00\n\tcontroller-problem{}\n").errors(), 1U);
}

// -td: four lines in 2.4 ms, 0.5 s and 1 s.
TEST(CandumpOfToday, TimesThatFallNearZeroAreThoseBetweenLines) {
  const std::string text =
      " (000.000000)  can0  605   [0]\n (000.001000)  can1  585   [0]\n (000.500000)  can0  605   [0]\n"
      " (000.000900)  can0  585   [0]\n (001.000000)  can0  585   [0]\n";
  for (const std::size_t piece : {std::size_t{1}, std::size_t{1000}}) {
    const auto kept = read(Format::candump, text, piece);
    EXPECT_EQ(kept.count(Finding::Severity::warning), 1U) << kept.text();
    EXPECT_EQ(kept.errors(), 0U);
    ASSERT_EQ(kept.trace.entries.size(), 5U);
    EXPECT_EQ(kept.trace.entries[1].at, 1ms);
    EXPECT_EQ(kept.trace.entries[2].at, 501ms);
    EXPECT_EQ(kept.trace.entries[3].at, 501900us);
    EXPECT_EQ(kept.trace.entries[4].at, 1501900us);
  }
}

// -tz: from the first line on. So long as they do not fall, they are that, unless somebody says else.
TEST(CandumpOfToday, TimesThatRiseFromZeroStay) {
  std::string text;
  for (int i = 0; i < 200; ++i) text += fmt::format(" (000.{:06})  can0  605   [0]\n", i * 1000);
  const auto kept = read(Format::candump, text);
  EXPECT_EQ(kept.findings.size(), 0U) << kept.text();
  ASSERT_EQ(kept.trace.entries.size(), 200U);
  EXPECT_EQ(kept.trace.entries[199].at, 199ms);
  const std::string few =
      " (000.000000)  can0  605   [0]\n (000.100000)  can0  605   [0]\n (000.100000)  can0  605   [0]\n";
  EXPECT_EQ(read(Format::candump, few).trace.entries.back().at, 100ms);
  Kept said;
  const auto reader = make_reader(Format::candump, "t", {.deltas = true});
  reader->feed(few, said);
  reader->finish(said);
  ASSERT_EQ(said.trace.entries.size(), 3U);
  EXPECT_EQ(said.trace.entries.back().at, 200ms);
}

// CANoe writes classic frames as CANFD rows: bit 12 of the flags is clear; bit 4 is remote.
TEST(AscOfToday, ClassicFramesInRowsOfFd) {
  const auto kept = read(
      Format::asc,
      "date Wed May 01 10:00:00.000 am 2024\nbase hex  timestamps absolute\n"
      "   0.000000 CANFD   Start of measurement\n"
      "   1.0 CANFD   1 Rx        701             0 0 1 1 05   96000   49   200040  7a60 46500250 460a0250 0 0\n"
      "   1.1 CANFD   1 Tx        705             0 0 1 0   140000   73   200050  7a60 46500250 460a0250 0 0\n"
      "   1.2 CANFD   1 Rx        123  Engine     1 0 9 12 00 11 22 33 44 55 66 77 88 99 AA BB 1 2 203040 0 0 0 0 0\n");
  EXPECT_EQ(kept.findings.size(), 0U) << kept.text();
  EXPECT_EQ(frames(kept.trace), (Rows{"can0 701#05", "can0 705#R1", "can0 123##100112233445566778899AABB"}));
}

TEST(AscOfToday, ALoggersCapitalsAndDecimals) {
  const auto kept =
      read(Format::asc,
           "date Thu Sep 2 09:37:49 am 2021\nbase dec timestamps absolute\n"
           "770.592543 7  1282       Rx D 8   0   0   0   0   0 170   0   0\n770.592943 7  1793       Rx R 1\n");
  EXPECT_EQ(kept.findings.size(), 0U) << kept.text();
  EXPECT_EQ(frames(kept.trace), (Rows{"can6 502#0000000000AA0000", "can6 701#R1"}));
}

namespace {

std::string little(std::uint32_t value) {
  std::string bytes;
  for (int i = 0; i < 4; ++i) bytes += static_cast<char>(value >> (8 * i));
  return bytes;
}
std::string big(std::uint32_t value) {
  const auto bytes = little(value);
  return {bytes.rbegin(), bytes.rend()};
}

// A capture in one byte order, of one packet at 1.000002 s (or 1.000000002 s).
std::string capture(bool is_big, std::uint32_t magic, std::uint32_t link, const std::string& packet) {
  const auto word = is_big ? big : little;
  const std::string version = is_big ? std::string("\0\2\0\4", 4) : std::string("\2\0\4\0", 4);
  const auto size = static_cast<std::uint32_t>(packet.size());
  return word(magic) + version + word(0) + word(0) + word(65535) + word(link) + word(1) + word(2) + word(size) +
         word(size) + packet;
}

const std::string one_byte("\1\0\0\0\x05", 5);  // DLC, flags, reserved, data

}  // namespace

TEST(Pcap, BothByteOrdersAndUnits) {
  for (const bool is_big : {false, true}) {
    for (const std::size_t piece : {std::size_t{1}, std::size_t{1000}}) {
      const auto micros = capture(is_big, 0xA1B2C3D4, 227, big(0x701) + one_byte);
      EXPECT_EQ(recognise(micros), Format::pcap);
      const auto kept = read(Format::pcap, micros, piece);
      EXPECT_EQ(kept.findings.size(), 0U) << kept.text();
      ASSERT_EQ(kept.trace.entries.size(), 1U);
      EXPECT_EQ(frames(kept.trace), Rows{"can0 701#05"});
      EXPECT_EQ(kept.trace.entries[0].at, 1s + 2us);
      EXPECT_EQ(kept.trace.entries[0].direction, Direction::unknown);
    }
    const auto nanos = read(Format::pcap, capture(is_big, 0xA1B23C4D, 227, big(0x80000701) + one_byte));
    ASSERT_EQ(nanos.trace.entries.size(), 1U) << nanos.text();
    EXPECT_EQ(nanos.trace.entries[0].at, 1s + 2ns);
    EXPECT_EQ(frames(nanos.trace), Rows{"can0 00000701#05"});
  }
}

// Captured on "any": an identifier in the byte order of the computer that captured.
TEST(Pcap, CookedCapturesOfLinux) {
  for (const bool is_big : {false, true}) {
    for (const char way : {'\0', '\4'}) {
      const std::string cooked = std::string("\0", 1) + way + std::string("\1\x18\0\0\0\0\0\0\0\0\0\0\0\x0C", 14);
      const auto packet = cooked + (is_big ? big : little)(0x701) + one_byte;
      const auto kept = read(Format::pcap, capture(is_big, 0xA1B2C3D4, 113, packet));
      EXPECT_EQ(kept.findings.size(), 0U) << kept.text();
      EXPECT_EQ(frames(kept.trace), Rows{"can0 701#05"});
      EXPECT_EQ(kept.trace.entries[0].direction, way == '\4' ? Direction::sent : Direction::received);
    }
  }
  const std::string internet = std::string("\0\0\0\1\0\6\0\0\0\0\0\0\0\0\x08\0", 16) + std::string(40, 'x');
  const auto other = read(Format::pcap, capture(false, 0xA1B2C3D4, 113, internet));
  EXPECT_EQ(other.findings.size(), 0U) << other.text();
  EXPECT_EQ(other.trace.entries.size(), 0U);
}

TEST(Pcap, SaysWhatIsWrong) {
  EXPECT_EQ(read(Format::pcap, capture(false, 0xA1B2C3D4, 1, "ethernet")).errors(), 1U);
  EXPECT_EQ(read(Format::pcap, "hello, this is none of it at all").errors(), 1U);
  const auto whole = capture(false, 0xA1B2C3D4, 227, big(0x701) + one_byte);
  for (std::size_t size = 1; size < whole.size(); ++size) {
    const bool between = size == 24;
    EXPECT_EQ(read(Format::pcap, std::string_view(whole).substr(0, size)).errors(), between ? 0U : 1U) << size;
  }
  auto endless = whole;
  endless.replace(24 + 8, 4, little(0x7FFFFFFF));
  EXPECT_EQ(read(Format::pcap, endless).errors(), 1U);
  EXPECT_EQ(read(Format::pcap, capture(false, 0xA1B2C3D4, 227, "\1\2")).errors(), 1U);
}

namespace {

std::string gzip(const std::string& text) {
  z_stream stream{};
  EXPECT_EQ(deflateInit2(&stream, 9, Z_DEFLATED, 16 + MAX_WBITS, 8, Z_DEFAULT_STRATEGY), Z_OK);
  std::string packed(deflateBound(&stream, text.size()) + 64, '\0');
  stream.next_in = reinterpret_cast<Bytef*>(const_cast<char*>(text.data()));
  stream.avail_in = static_cast<uInt>(text.size());
  stream.next_out = reinterpret_cast<Bytef*>(packed.data());
  stream.avail_out = static_cast<uInt>(packed.size());
  EXPECT_EQ(deflate(&stream, Z_FINISH), Z_STREAM_END);
  packed.resize(stream.total_out);
  deflateEnd(&stream);
  return packed;
}

struct Unpacked {
  std::string text;
  std::string wrong;
  bool whole = false;
};
Unpacked unpack(const std::string& packed, std::size_t piece) {
  Unpacked unpacked;
  Gunzip gunzip;
  for (std::size_t at = 0; at < packed.size() && unpacked.wrong.empty(); at += piece) {
    unpacked.wrong = gunzip.feed(std::string_view(packed).substr(at, piece),
                                 [&](std::string_view bytes) { unpacked.text += bytes; });
  }
  unpacked.whole = gunzip.whole();
  return unpacked;
}

}  // namespace

TEST(Gunzip, OneMemberOrSeveralInAnyPieces) {
  std::string text;
  for (int i = 0; i < 20'000; ++i) text += fmt::format("({}.000000) can0 701#05\n", i);
  const std::string packed = gzip(text) + gzip("the end\n");
  EXPECT_TRUE(is_gzip(packed));
  for (const std::size_t piece : {std::size_t{1}, std::size_t{777}, packed.size()}) {
    const auto unpacked = unpack(packed, piece);
    EXPECT_EQ(unpacked.wrong, "");
    EXPECT_TRUE(unpacked.whole);
    EXPECT_TRUE(unpacked.text == text + "the end\n") << piece;
  }
}

TEST(Gunzip, DamagedCutShortOrABomb) {
  const std::string packed = gzip("(1.000000) can0 701#05\n");
  EXPECT_FALSE(unpack(packed.substr(0, packed.size() - 3), 5).whole);
  std::string damaged = packed;
  damaged[packed.size() - 6] = static_cast<char>(damaged[packed.size() - 6] ^ 1);  // of its CRC
  EXPECT_NE(unpack(damaged, 100).wrong, "");
  EXPECT_NE(unpack(packed + "rubbish", 100).wrong, "");
  EXPECT_NE(unpack(gzip(std::string(std::size_t{200} << 20U, '0')), 1000).wrong, "");
}

TEST(TraceFormats, WhatIsNoneIsNamed) {
  EXPECT_EQ(foreign("LOGG rest"), "a BLF file (Vector's binary log); export it as ASC");
  EXPECT_NE(foreign(std::string_view("\xFF\xFE(\0", 4)), "");
  EXPECT_NE(foreign("PK\x03\x04"), "");
  EXPECT_EQ(foreign("(1.000000) can0 1#"), "");
  EXPECT_EQ(foreign(""), "");
  EXPECT_EQ(parse_format("pcap"), Format::pcap);
  EXPECT_FALSE(is_written(Format::pcap));
  EXPECT_EQ(format_of_path("a.PCAP"), Format::pcap);
}

// One sentence, not one for each of its lines.
TEST(TraceFormats, ATextThatIsNoTraceIsToldOnce) {
  struct None final : Sink {
    void entry(const Entry&) override { ++got; }
    void finding(Finding) override { ++got; }
    int got = 0;
  };
  const auto read = [](std::string_view text) {
    None sink;
    AnyFile file("README.md");
    std::string wrong = file.feed(text, sink);
    if (wrong.empty()) wrong = file.end(sink);
    if (wrong.empty()) file.finish(sink);
    return std::pair(wrong, sink.got);
  };
  const auto [wrong, got] = read("# Berth\n\nGives every CANopen device its place (really).\n");
  EXPECT_EQ(wrong, "README.md: this is neither candump, pcapng, pcap, Vector ASC nor PEAK TRC; name it by --from");
  EXPECT_EQ(got, 0);
  EXPECT_EQ(read("# by hand\n(1.000000) can0 701#0\n").first, "") << "candump with a mistake: told by its line";
  EXPECT_GT(read("\n(1.000000 can0 701#05\n").second, 0);
}

}  // namespace berth::trace::test
