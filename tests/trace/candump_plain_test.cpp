// What `candump` prints without -L. The lines are as can-utils prints them (candump.c, lib.c).
#include "berth/trace/candump_plain.hpp"

#include <gtest/gtest.h>
#include <rapidcheck/gtest.h>
#include <chrono>
#include <string>
#include <vector>

#include "berth/trace/candump.hpp"

namespace berth::trace {
namespace {

using namespace std::chrono_literals;

TEST(PlainCandump, WithoutTime) {
  const auto line = parse_plain_candump("  can0  7E5   [8]  04 01 00 00 00 00 00 FF");
  ASSERT_TRUE(line);
  EXPECT_EQ(line->at, 0ns);
  EXPECT_EQ(line->bus, "can0");
  EXPECT_EQ(can::to_string(line->frame), "7E5#04010000000000FF");
}

TEST(PlainCandump, TimesInAllForms) {
  const auto at = [](const char* text) { return parse_plain_candump(text).value().at; };
  EXPECT_EQ(at(" (1436509052.249713)  can0  123   [0]"), 1436509052s + 249713us) << "-t a";
  EXPECT_EQ(at(" (000.000120)  can0  123   [0]"), 120us) << "-t d, -t z";
  EXPECT_EQ(at(" (2015-07-10 06:17:32.249713)  can0  123   [0]"), 1436509052s + 249713us) << "-t A";
}

TEST(PlainCandump, KindsOfFrames) {
  const auto frame = [](const char* text) { return can::to_string(parse_plain_candump(text).value().frame); };
  EXPECT_EQ(frame("  can0  1F900135   [0] "), "1F900135#");
  EXPECT_EQ(frame("  can0  00000123   [1]  AA"), "00000123#AA") << "eight digits: an extended identifier";
  EXPECT_EQ(frame("  can0  701   [0]  remote request"), "701#R");
  EXPECT_EQ(frame("  can0  701   [8]  remote request"), "701#R8");
  EXPECT_EQ(frame("  vcan1  123  [12]  00 11 22 33 44 55 66 77 88 99 AA BB"), "123##000112233445566778899AABB");
  EXPECT_EQ(frame("  vcan1  RX B E  123  [01]  AA"), "123##3AA");
  EXPECT_EQ(frame("  can0  123   [3]  41 42 00   'AB.'"), "123#414200") << "-a";
}

TEST(PlainCandump, Directions) {
  EXPECT_EQ(parse_plain_candump("  can0  RX - -  123   [0]")->direction, Direction::received);
  EXPECT_EQ(parse_plain_candump("  can0  TX - -  123   [0]")->direction, Direction::sent);
  EXPECT_EQ(parse_plain_candump("  can0  123   [0]")->direction, Direction::unknown);
}

TEST(PlainCandump, AnErrorFrameIsOne) {
  const auto line = parse_plain_candump("  can0  20000004   [8]  00 08 00 00 00 00 00 00   ERRORFRAME");
  ASSERT_TRUE(line);
  EXPECT_TRUE(line->error);
  EXPECT_EQ(line->frame.id, 4U);
}

TEST(PlainCandump, RefusesWhatItIsNot) {
  for (const char* bad : {"",
                          "can0",
                          "can0 123",
                          "can0 123 [2] AA",
                          "can0 123 [9] 00 11 22 33 44 55 66 77 88",
                          "can0 123 [1] AA BB",
                          "can0 823 [0]",
                          "can0 40000123 [0]",
                          "can0 12 [0]",
                          "can0 123 [x]",
                          "can0 123 []",
                          "can0 123 [1] A",
                          "can0 123 [13] 00",
                          "(1.) can0 123 [0]",
                          "can0 123 {8} 00 11 22 33 44 55 66 77",
                          "(2015-13-10 06:17:32.249713) can0 123 [0]",
                          "(2015-07-10 25:17:32.249713) can0 123 [0]",
                          "can0 123 [08] remote request",
                          "can0 QX - - 123 [0]",
                          "can0 RX ? - 123 [0]",
                          "(1436509052.249713) can0 123#"}) {
    EXPECT_FALSE(parse_plain_candump(bad)) << bad;
  }
}

TEST(PlainCandump, IsReadByTheReaderAndRecognised) {
  const std::string text =
      "  can0  7E5   [8]  04 01 00 00 00 00 00 00\n (1436509052.249713)  can1  701   [1]  00\n(1436509053.000000) can0 "
      "702#7F\n";
  EXPECT_EQ(recognise(text), Format::candump);
  const auto reading = read_candump(text, "x.log");
  EXPECT_TRUE(reading.findings.empty());
  ASSERT_EQ(reading.trace.entries.size(), 3U);
  EXPECT_EQ(reading.trace.buses, (std::vector<std::string>{"can0", "can1"}));
  EXPECT_EQ(can::to_string(reading.trace.entries[2].frame), "702#7F");
}

RC_GTEST_PROP(PlainCandump, NoBytesHurt, (const std::string& text)) {
  const auto line = parse_plain_candump(text);
  RC_ASSERT(!line || line->frame.size <= 64);
}

}  // namespace
}  // namespace berth::trace
