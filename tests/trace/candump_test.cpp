// candump's log format: what its manual shows, what is wrong and where, and the figures of a trace.
#include "berth/trace/candump.hpp"

#include <gtest/gtest.h>
#include <rapidcheck/gtest.h>
#include <chrono>
#include <cstdint>
#include <string>
#include <vector>

#include <cmath>

namespace berth::trace {
namespace {

using namespace std::chrono_literals;

Entry only_entry(const std::string& line) {
  const auto reading = read_candump(line, "t.log");
  EXPECT_TRUE(reading.findings.empty()) << line << ": " << to_string(reading.findings.front());
  EXPECT_EQ(reading.trace.entries.size(), 1U) << line;
  return reading.trace.entries.empty() ? Entry{} : reading.trace.entries.front();
}

// The line of can-utils' own manual.
TEST(Candump, ReadsTheManualsLine) {
  const auto reading = read_candump("(1436509052.249713) vcan0 044#2A366C2BBA\n", "t.log");
  ASSERT_EQ(reading.trace.entries.size(), 1U);
  const Entry& entry = reading.trace.entries[0];
  EXPECT_EQ(entry.at, 1436509052s + 249713us);
  EXPECT_EQ(reading.trace.buses, std::vector<std::string>{"vcan0"});
  EXPECT_EQ(entry.frame, can::Frame::base(0x44, {0x2A, 0x36, 0x6C, 0x2B, 0xBA}));
}

TEST(Candump, KindsOfFrames) {
  EXPECT_EQ(only_entry("(0.000001) can0 1F900135#").frame, can::Frame::ext(0x1F90'0135, {}));
  EXPECT_EQ(only_entry("(0.000001) can0 00000044#01").frame, can::Frame::ext(0x44, {1})) << "eight digits: extended";
  EXPECT_EQ(only_entry("(0.000001) can0 701#R").frame, can::Frame::request(0x701, 0));
  EXPECT_EQ(only_entry("(0.000001) can0 701#R1").frame, can::Frame::request(0x701, 1));
  const auto fd = only_entry("(0.000001) can0 123##3AABB").frame;
  EXPECT_TRUE(fd.fd && fd.brs && fd.esi);
  EXPECT_EQ(fd.size, 2);
  EXPECT_EQ(only_entry("(0.000001) can0 123#AA R").frame, only_entry("(0.000001) can0 123#aa T\r\n").frame);
}

struct Wrong {
  const char* line;
  int column;
};

TEST(Candump, SaysWhereItIsWrong) {
  const Wrong wrong[] = {
      {"nonsense", 1},                                   // no time
      {"(x.000000) can0 1#", 2},                         // no seconds
      {"(-1.000000) can0 1#", 2},                        // before the beginning
      {"(99999999999999999999.000000) can0 1#", 2},      // no 64 bits
      {"(9999999999.000000) can0 1#", 2},                // no nanoseconds in 64 bits
      {"(1,000000) can0 1#", 3},                         // no point
      {"(1.) can0 1#", 4},                               // no digit behind the point
      {"(1.000000)can0 1#", 11},                         // no blank
      {"(1.000000) can0", 16},                           // no frame
      {"(1.000000) can0 123", 20},                       // no #
      {"(1.000000) can0 12G#", 19},                      // no digit
      {"(1.000000) can0 #12", 17},                       // no identifier
      {"(1.000000) can0 800#", 17},                      // beyond 11 bits
      {"(1.000000) can0 FFFFFFFF#", 17},                 // beyond 29 bits
      {"(1.000000) can0 123456789#", 17},                // nine digits
      {"(1.000000) can0 123#1", 22},                     // half a byte
      {"(1.000000) can0 123#1x", 22},                    // no digit
      {"(1.000000) can0 123#112233445566778899", 21},    // nine bytes
      {"(1.000000) can0 123#R9", 22},                    // no DLC of a classic frame
      {"(1.000000) can0 123##", 22},                     // no flags
      {"(1.000000) can0 123##1112233445566778899", 23},  // nine bytes do not exist in FD
      {"(1.000000) can0 123#11 X", 24},                  // no direction
      {"(1.000000) can0 123#11 R R", 24},
  };
  for (const auto& each : wrong) {
    const auto reading = read_candump(std::string("(0.000000) can0 1#\n") + each.line + "\n", "t.log");
    ASSERT_EQ(reading.findings.size(), 1U) << each.line;
    EXPECT_EQ(reading.findings[0].severity, Finding::Severity::error) << each.line;
    EXPECT_EQ(reading.findings[0].line, 2) << each.line;
    EXPECT_EQ(reading.findings[0].column, each.column) << each.line << ": " << reading.findings[0].message;
    EXPECT_EQ(reading.findings[0].file, "t.log");
    EXPECT_EQ(reading.trace.entries.size(), 1U) << "the good line stays: " << each.line;
  }
}

TEST(Candump, ErrorFramesAndClocksSetBackAreWarnings) {
  const auto reading = read_candump(
      "(2.000000) can0 1#\n(1.000000) can0 20000004#0000000000000000\n(1.000000) can0 2#\n(0.500000) can1 3#\n",
      "t.log");
  ASSERT_EQ(reading.findings.size(), 2U);
  EXPECT_FALSE(has_errors(reading.findings));
  EXPECT_EQ(reading.findings[0].line, 2);
  EXPECT_EQ(reading.findings[1].line, 3) << "another bus has its own clock";
  EXPECT_EQ(reading.trace.entries.size(), 3U);
}

// Each bus costs what reads the trace: there is a bound, and what is beyond it is told with its line.
TEST(Candump, VeryManyBusesAreRefused) {
  std::string text;
  for (int i = 0; i < 300; ++i) text += "(0.000001) bus" + std::to_string(i) + " 123#\n";
  text += "(0.000002) bus7 124#\n";
  const auto reading = read_candump(text, "t.log");
  EXPECT_EQ(reading.trace.buses.size(), 256U);
  EXPECT_EQ(reading.trace.entries.size(), 257U) << "of the known ones all";
  EXPECT_EQ(reading.trace.entries.back().bus, 7U);
  ASSERT_FALSE(reading.findings.empty());
  EXPECT_EQ(reading.findings.front().severity, Finding::Severity::error);
  EXPECT_EQ(reading.findings.front().line, 257);
  EXPECT_NE(reading.findings.front().message.find("256 buses"), std::string::npos);
}

TEST(Candump, ManyFindingsAreCounted) {
  std::string text;
  for (int i = 0; i < 1000; ++i) text += "bad\n";
  const auto reading = read_candump(text, "t.log");
  ASSERT_EQ(reading.findings.size(), most_findings + 1);
  EXPECT_NE(reading.findings.back().message.find("900"), std::string::npos) << reading.findings.back().message;
  EXPECT_TRUE(has_errors(reading.findings));
}

TEST(Candump, WritesWhatCandumpWrites) {
  EXPECT_EQ(candump_line(1436509052s + 249713us, "vcan0", can::Frame::base(0x44, {0x2A, 0x36, 0x6C, 0x2B, 0xBA})),
            "(1436509052.249713) vcan0 044#2A366C2BBA");
  EXPECT_EQ(candump_line(215ms + 499ns, "field", can::Frame::ext(0x1F90'0135, {})),
            "(0000000000.215000) field 1F900135#");
  EXPECT_EQ(candump_line(999'999'500ns, "b", can::Frame::request(0x701, 1)), "(0000000001.000000) b 701#R1");
}

RC_GTEST_PROP(Candump, WhatIsWrittenIsReadAgain, ()) {
  Trace trace;
  const auto count = *rc::gen::inRange<std::size_t>(0, 30);
  rt::Duration at{};
  for (std::size_t i = 0; i < count; ++i) {
    Entry entry;
    at += std::chrono::microseconds(*rc::gen::inRange<std::int64_t>(0, 2'000'000));
    entry.at = at;
    entry.bus = trace.bus(std::string("can") + static_cast<char>('0' + *rc::gen::inRange(0, 3)));
    const auto bytes = *rc::gen::container<std::vector<std::uint8_t>>(*rc::gen::inRange<std::size_t>(0, 9),
                                                                      rc::gen::arbitrary<std::uint8_t>());
    const auto id = *rc::gen::arbitrary<std::uint32_t>();
    entry.frame = *rc::gen::arbitrary<bool>() ? can::Frame::ext(id, bytes) : can::Frame::base(id, bytes);
    if (*rc::gen::inRange(0, 4) == 0) entry.frame = can::Frame::request(id, static_cast<std::uint8_t>(bytes.size()));
    trace.entries.push_back(entry);
  }
  const auto reading = read_candump(write_candump(trace), "t.log");
  RC_ASSERT(reading.findings.empty());
  RC_ASSERT(reading.trace == trace);
}

// Lengths (docs/protocols/can-frames.md): 000#0100 has 68 bits, 701#05 58, 080# 51.
TEST(TraceStatistics, CountsBitsExactly) {
  const auto reading = read_candump(
      "(1.000000) a 000#0100\n(1.002000) b 080#\n(1.004000) a 701#05\n(1.010000) a 701#05\n(1.011000) a 123##1AABB\n",
      "t");
  ASSERT_TRUE(reading.findings.empty());
  const auto a = statistics(reading.trace, 0);
  EXPECT_EQ(a.frames, 4U);
  EXPECT_EQ(a.bits, 68U + 58U + 58U);
  EXPECT_EQ(a.fd_frames, 1U);
  EXPECT_EQ(a.first, rt::Duration(1s));
  EXPECT_EQ(a.last, rt::Duration(1s + 11ms));
  EXPECT_EQ(a.span(), rt::Duration(11ms));
  EXPECT_EQ(a.longest_gap, rt::Duration(6ms));
  // 116 bits behind the first frame at 50 kbit/s are 2.32 of 11 ms.
  EXPECT_NEAR(a.load(50'000), 2.32 / 11, 1e-9);
  ASSERT_EQ(a.ids.size(), 3U);
  EXPECT_EQ(a.ids[0], (IdStatistics{0x000, 1, 68}));
  EXPECT_EQ(a.ids[1], (IdStatistics{0x123, 1, 0}));
  EXPECT_EQ(a.ids[2], (IdStatistics{0x701, 2, 116, 6ms, 6ms, 6ms}));
  const auto b = statistics(reading.trace, 1);
  EXPECT_EQ(b.frames, 1U);
  EXPECT_EQ(b.bits, 51U);
  EXPECT_EQ(b.load(50'000), 0);
}

// Periods 10, 10, 20 and 0 ms: average 10, deviations 0, 0, 10 and -10: the root of 200 / 4.
TEST(TraceStatistics, PeriodsAndJitter) {
  const auto reading = read_candump(
      "(1.000000) a 181#\n(1.010000) a 181#\n(1.020000) a 181#\n(1.040000) a 181#\n(1.040000) a 181#\n"
      "(1.050000) a 1F900135#\n",
      "t");
  const auto all = statistics(reading.trace, 0);
  ASSERT_EQ(all.ids.size(), 2U);
  EXPECT_EQ(all.ids[0].shortest, rt::Duration(0));
  EXPECT_EQ(all.ids[0].longest, rt::Duration(20ms));
  EXPECT_EQ(all.ids[0].average, rt::Duration(10ms));
  EXPECT_NEAR(static_cast<double>(all.ids[0].jitter.count()), std::sqrt(50.0) * 1e6, 1);
  EXPECT_EQ(all.ids[1].key, 0x1F90'0135U | can::extended_flag);
  EXPECT_EQ(all.ids[1].longest, rt::Duration(0));
}

}  // namespace
}  // namespace berth::trace
