// Vector's ASCII log: what its tools write, in the forms that are met, and what is wrong and where.
#include <gtest/gtest.h>
#include <chrono>
#include <string>
#include <vector>

#include "berth/trace/asc.hpp"

#include "berth/trace/calendar.hpp"
#include "formats.hpp"

namespace berth::trace {
namespace {

using namespace std::chrono_literals;
using test::read;

constexpr auto july = 1436509052s;  // 10 July 2015, 06:17:32 UTC

TEST(Asc, FramesOfEveryKind) {
  const auto kept =
      read(Format::asc,
           "date Fri Jul 10 06:17:32.249 2015\n"
           "base hex  timestamps absolute\n"
           "internal events logged\n"
           "// version 9.0.0\n"
           "Begin Triggerblock Fri Jul 10 06:17:32.249 2015\n"
           "   0.000000 Start of measurement\n"
           "   0.000713 1  7E5             Rx   d 8 51 00 00 00 00 80 00 00  Length = 240015 BitCount = 124 ID = 2021\n"
           "   0.001001 2  1F900135x       Tx   d 0\n"
           "   0.001400 1  701             Rx   r 1\n"
           "   0.001500 1  701             Rx   r\n"
           "   0.001900 CANFD   2 Rx        123                                   1 0 2  2 AA BB   130000  130     "
           "3000 0 0 0 0 0\n"
           "   0.002000 CANFD   2 Tx        7d  BrakeSnData_4                    0 1 9 12 01 02 03 04 05 06 07 08 09 "
           "0a 0b 0c 1 2\n"
           "   0.002100 1  ErrorFrame  ECC: 10100010\n"
           "   1.015991 1  Statistic: D 0 R 0 XD 0 XR 0 E 0 O 0 B 0.00%\n"
           "   1.020000 CAN 1 Status:chip status error active\n"
           "   3.297743 1  J1939TP FEE3p        6    0  0   -   Rx   d 2 23 A0\n"
           "   3.300000 1  123             TxRq d 1 00\n"
           "End TriggerBlock\n");
  EXPECT_EQ(kept.errors(), 0U) << kept.text();
  ASSERT_EQ(kept.findings.size(), 1U) << kept.text();
  EXPECT_NE(kept.findings[0].message.find("4 events"), std::string::npos) << kept.text();
  EXPECT_EQ(kept.trace.buses, (std::vector<std::string>{"can0", "can1"}));
  const auto& e = kept.trace.entries;
  ASSERT_EQ(e.size(), 7U);
  EXPECT_EQ(e[0].at, july + 249ms + 713us);
  EXPECT_EQ(e[0].frame, can::Frame::base(0x7E5, {0x51, 0, 0, 0, 0, 0x80, 0, 0}));
  EXPECT_EQ(e[0].direction, Direction::received);
  EXPECT_EQ(e[1].frame, can::Frame::ext(0x1F90'0135, {}));
  EXPECT_EQ(e[1].direction, Direction::sent);
  EXPECT_EQ(e[1].bus, 1);
  EXPECT_EQ(e[2].frame, can::Frame::request(0x701, 1));
  EXPECT_EQ(e[3].frame, can::Frame::request(0x701, 0));
  EXPECT_TRUE(e[4].frame.fd && e[4].frame.brs && !e[4].frame.esi);
  EXPECT_EQ(e[4].frame.size, 2);
  EXPECT_EQ(e[5].frame.id, 0x7DU);
  EXPECT_EQ(e[5].frame.size, 12);
  EXPECT_TRUE(e[5].frame.esi && !e[5].frame.brs);
  EXPECT_EQ(e[5].frame.data[11], 0x0C);
  EXPECT_TRUE(e[6].error);
}

TEST(Asc, DecimalAndRelative) {
  const auto kept = read(Format::asc,
                         "date Sam Sep 30 03:06:13 pm 2017\r\nbase dec  timestamps relative\r\n"
                         "0.5 1 255 Rx d 2 16 255\r\n0.25 1 Statistic: D 0\r\n0.25 1 536870911x Tx d 0\r\n");
  ASSERT_EQ(kept.trace.entries.size(), 2U) << kept.text();
  // 30 September 2017, 15:06:13 UTC
  EXPECT_EQ(kept.trace.entries[0].at, 1506783973s + 500ms);
  EXPECT_EQ(kept.trace.entries[0].frame, can::Frame::base(255, {16, 255}));
  EXPECT_EQ(kept.trace.entries[1].at, 1506783974s);
  EXPECT_EQ(kept.trace.entries[1].frame, can::Frame::ext(0x1FFF'FFFF, {}));
}

TEST(Asc, WithoutADateTimeCountsFromZero) {
  const auto kept = read(Format::asc, "date gestern\nbase hex timestamps absolute\n 1.5 1 7FF Rx d 0\n");
  ASSERT_EQ(kept.trace.entries.size(), 1U);
  EXPECT_EQ(kept.trace.entries[0].at, 1500ms);
  ASSERT_EQ(kept.findings.size(), 1U);
  EXPECT_EQ(kept.findings[0].severity, Finding::Severity::warning);
  EXPECT_EQ(kept.findings[0].line, 1);
}

TEST(Asc, SaysWhereItIsWrong) {
  const std::pair<const char*, int> wrong[] = {
      {"nonsense", 1},
      {"  1.0 1  7G1  Rx   d 1 00", 10},           // no hex digit
      {"  1.0 1  800  Rx   d 1 00", 10},           // beyond 11 bits, no x
      {"  1.0 1  20000000x  Rx   d 1 00", 10},     // beyond 29 bits
      {"  1.0 1  7F1  Rx   q 1 00", 20},           // neither d nor r
      {"  1.0 1  7F1  Rx   d g 00", 22},           // no DLC
      {"  1.0 1  7F1  Rx   d 2 00", 26},           // a byte is missing
      {"  1.0 1  7F1  Rx   d 2 00 1G", 27},        // no byte
      {"  1.0 CANFD 0 Rx 123 1 0 2 2 AA BB", 13},  // channels count from 1
      {"  1.0 CANFD 1 xR 123 1 0 2 2 AA BB", 15},
      {"  1.0 CANFD 1 Rx 123 1 0 9 2 AA BB", 26},  // two bytes do not have DLC 9
      {"  1.0 CANFD 1 Rx 123 1 0 2 2 AA", 32},
      {"  99999999999.0 1 123 Rx d 0", 1},
  };
  for (const auto& [line, column] : wrong) {
    const auto kept = read(Format::asc, std::string("base hex timestamps absolute\n") + line + "\n 2.0 1 1 Rx d 0\n");
    ASSERT_EQ(kept.errors(), 1U) << line << "\n" << kept.text();
    EXPECT_EQ(kept.findings[0].line, 2) << line;
    EXPECT_EQ(kept.findings[0].column, column) << line << ": " << kept.text();
    EXPECT_EQ(kept.trace.entries.size(), 1U) << "the good line stays: " << line;
  }
}

TEST(Asc, WritesWhatLog2ascWrites) {
  Trace trace;
  trace.buses = {"can0", "backbone"};
  trace.entries.push_back({july + 249713us, 0, can::Frame::base(0x7E5, {0x51, 0}), Direction::received});
  trace.entries.push_back({july + 250001us, 1, can::Frame::ext(0x1F90'0135, {}), Direction::sent});
  trace.entries.push_back({july + 250400us, 0, can::Frame::request(0x701, 1)});
  const auto written = test::write(Format::asc, trace);
  EXPECT_EQ(written.bytes,
            "date Fri Jul 10 06:17:32.249 2015\nbase hex  timestamps absolute\nno internal events logged\n"
            "// version 9.0.0\n// written by berth, times are UTC\n"
            "Begin Triggerblock Fri Jul 10 06:17:32.249 2015\n   0.000000 Start of measurement\n"
            "   0.000713 1  7E5             Rx   d 2 51 00\n"
            "// berth: channel 2 is backbone\n"
            "   0.001001 2  1F900135x       Tx   d 0\n"
            "   0.001400 1  701             Rx   r 1\n"
            "End TriggerBlock\n");
  ASSERT_EQ(written.lost.size(), 1U);
  EXPECT_EQ(written.lost[0], "1 frames whose direction is unknown are written as received (Rx)");
}

TEST(Calendar, DatesAreWrittenAndRead) {
  EXPECT_EQ(write_date(july + 249999us), "Fri Jul 10 06:17:32.249 2015");
  EXPECT_EQ(write_date(rt::Duration(0)), "Thu Jan 01 00:00:00.000 1970");
  EXPECT_EQ(parse_date("Fri Jul 10 06:17:32.249 2015"), july + 249ms);
  EXPECT_EQ(parse_date("Jul 10 06:17:32 am 2015"), july + 0ms);
  EXPECT_EQ(parse_date("Fre Jul 10 12:17:32 am 2015"), july - 6h);
  EXPECT_EQ(parse_date("Don M\xC3\xA4r 1 00:00:00 2018"), 1519862400s);
  for (const char* no : {"", "Fri", "Fri Jul 32 06:17:32 2015", "Fri Feb 30 06:17:32 2015", "Fri Jul 10 25:17:32 2015",
                         "Fri Jul 10 06:17 2015", "Fri Jul 10 06:17:32", "Fri Foo 10 06:17:32 2015"})
    EXPECT_FALSE(parse_date(no)) << no;
}

// A fuzzer's finding: the writer writes every time that a trace can hold, and the reader ended with the year 2200.
TEST(Calendar, DatesToTheEndOfTime) {
  const rt::Duration late = 7'777'777'400s;
  EXPECT_EQ(parse_date(write_date(late)), late);
  EXPECT_EQ(parse_date("Mon Dec 31 23:59:59.999 2255"), 9'025'257'599s + 999ms);
  EXPECT_FALSE(parse_date("Tue Jan 01 00:00:00 2256"));
  EXPECT_EQ(parse_ole_date("129735.5"), std::chrono::days(104'166) + 12h);
  EXPECT_FALSE(parse_ole_date("129736")) << "nanoseconds of 64 bits end there";
  EXPECT_FALSE(parse_ole_date("144548.6028595139"));
}

// PEAK's own example: 39414.8339742292 is 28 November 2007, 20:00:55.373 (forum of PEAK-System).
TEST(Calendar, OleDates) {
  const auto found = parse_ole_date("39414.8339742292");
  ASSERT_TRUE(found);
  EXPECT_EQ(*found / 1ms, (1196280055s + 373ms) / 1ms);
  EXPECT_EQ(parse_ole_date("25569"), rt::Duration(0));
  EXPECT_EQ(write_ole_date(rt::Duration(12h)), "25569.50000000000000");
  for (const char* no : {"", "x", "1.5", "25569.", "25569.x", "999999999"}) {
    if (std::string(no) == "25569.") continue;  // a bare point is harmless
    EXPECT_FALSE(parse_ole_date(no)) << no;
  }
  for (const auto at : {july + 249713us, july + 1us, july + 999999us, july - 1us})
    EXPECT_EQ(parse_ole_date(write_ole_date(at)), rt::Duration(at)) << write_ole_date(at);
}

}  // namespace
}  // namespace berth::trace
