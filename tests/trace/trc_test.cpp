// PEAK's trace files, version by version.
#include <gtest/gtest.h>
#include <chrono>
#include <string>
#include <vector>

#include "berth/trace/trc.hpp"

#include "formats.hpp"

namespace berth::trace {
namespace {

using namespace std::chrono_literals;
using test::read;

// 44548.6028595139 is 18 December 2021, 14:28:07.062 (PEAK's converter says so in the same file).
constexpr auto start = 1639837687s + 62ms;
constexpr auto slack = 5us;  // ten decimals of a day are 8.64 us

void near(rt::Duration a, rt::Duration b) {
  EXPECT_LE(std::chrono::abs(a - b), slack) << a.count() << " " << b.count();
}

TEST(Trc, Version10) {
  const auto kept = read(Format::trc,
                         ";##########################\r\n;   Start time: 11.09.2002 16:00:20.682\r\n"
                         "     1)      1841 0001 8  00 11 22 33 44 55 66 77\r\n"
                         "     2)      1842 0008 4  ERROR 00 19 08 07\r\n"
                         "     3)      1843 FFFFFFFF 4  00 00 00 04 ------BUSLIGHT\r\n"
                         "     4)      1844 0100 3  RTR\r\n"
                         "     5)      1845 00000100 0\r\n");
  EXPECT_EQ(kept.errors(), 0U) << kept.text();
  const auto& e = kept.trace.entries;
  ASSERT_EQ(e.size(), 4U);
  EXPECT_EQ(e[0].at, 1841ms);
  EXPECT_EQ(e[0].direction, Direction::unknown);
  EXPECT_EQ(e[0].frame, can::Frame::base(1, {0, 0x11, 0x22, 0x33, 0x44, 0x55, 0x66, 0x77}));
  EXPECT_TRUE(e[1].error);
  EXPECT_EQ(e[1].frame.id, 0x08U);
  EXPECT_EQ(e[1].frame.data[2], 0x80);  // other error, while sending
  EXPECT_EQ(e[1].frame.data[7], 8);     // receive counter
  EXPECT_EQ(e[1].frame.data[6], 7);
  EXPECT_EQ(e[2].frame, can::Frame::request(0x100, 3));
  EXPECT_EQ(e[3].frame, can::Frame::ext(0x100, {}));
}

TEST(Trc, Version11) {
  const auto kept = read(Format::trc,
                         ";$FILEVERSION=1.1\r\n;$STARTTIME=44548.6028595139\r\n;\r\n"
                         "     1)     17535.4  Tx     00000100  8  00 00 00 00 00 00 00 01 \r\n"
                         "     2)     17540.3  Warng  FFFFFFFF  4  00 00 00 08  BUSHEAVY \r\n"
                         "     3)     19295.4  Rx         0000  2  01 05 \r\n"
                         "     4)     19296.0  Error      0004  4  01 07 20 00 \r\n"
                         "     5)     19297.0  Rx         0701  1  RTR \r\n");
  EXPECT_EQ(kept.errors(), 0U) << kept.text();
  const auto& e = kept.trace.entries;
  ASSERT_EQ(e.size(), 4U);
  near(e[0].at, start + 17535400us);
  EXPECT_EQ(e[0].direction, Direction::sent);
  EXPECT_TRUE(e[0].frame.extended);
  EXPECT_EQ(e[1].frame, can::Frame::base(0, {1, 5}));
  EXPECT_TRUE(e[2].error);
  EXPECT_EQ(e[2].frame.data[2], 4);  // stuff error, while receiving
  EXPECT_EQ(e[3].frame, can::Frame::request(0x701, 1));
  ASSERT_EQ(kept.findings.size(), 1U);
  EXPECT_NE(kept.findings[0].message.find("1 lines"), std::string::npos);
}

TEST(Trc, Version12And13HaveBuses) {
  const auto old = read(Format::trc, ";$FILEVERSION=1.2\n 1) 1.0 2 Rx 0123 1 AA\n");
  ASSERT_EQ(old.trace.entries.size(), 1U) << old.text();
  EXPECT_EQ(old.trace.buses, std::vector<std::string>{"can1"});
  const auto kept = read(Format::trc,
                         ";$FILEVERSION=1.3\n;$STARTTIME=44548.6028595139\n"
                         ";   Bus  Name   Connection                 Protocol  Bit rate\n"
                         ";   1    PCAN   Untitled@pcan_usb          CAN       500 kbit/s\n"
                         ";   2    PTCAN  PCANLight_USB_16@pcan_usb  CAN\n"
                         ";-----------------------------------------------\n"
                         ";---+-- ------+------ +- --+-- ----+--- +- -+-- -+ -- --\n"
                         "     1)        17535.4 2  Tx    00000100 -  2    00 01\n"
                         "     2)        17535.5 1  Rx        0100 -  0\n");
  ASSERT_EQ(kept.trace.entries.size(), 2U) << kept.text();
  EXPECT_EQ(kept.trace.buses, (std::vector<std::string>{"PTCAN", "PCAN"}));
  EXPECT_EQ(kept.trace.entries[1].bus, 1);
}

TEST(Trc, Version20HasNoBus) {
  const auto kept = read(Format::trc,
                         ";$FILEVERSION=2.0\n;$STARTTIME=44548.6028595139\n;$COLUMNS=N,O,T,I,d,l,D\n"
                         "      1     17535.400 DT 00000100 Tx 8  00 00 00 00 00 00 00 00\n"
                         "      2     17540.300 ST          Rx    00 00 00 08\n"
                         "      3     19295.401 FB     0000 Rx 12  01 02 03 04 05 06 07 08 09 0A 0B 0C\n"
                         "      4     19295.500 RR     0701 Rx 1\n");
  EXPECT_EQ(kept.errors(), 0U) << kept.text();
  const auto& e = kept.trace.entries;
  ASSERT_EQ(e.size(), 3U);
  near(e[1].at, start + 19295401us);
  EXPECT_TRUE(e[1].frame.fd && e[1].frame.brs && !e[1].frame.esi);
  EXPECT_EQ(e[1].frame.size, 12);
  EXPECT_EQ(e[2].frame, can::Frame::request(0x701, 1));
}

TEST(Trc, Version21) {
  const auto kept = read(Format::trc,
                         ";$FILEVERSION=2.1\n;$STARTTIME=44548.6028595139\n;$COLUMNS=N,O,T,B,I,d,R,L,D\n"
                         ";   Bus   Name            Connection               Protocol\n"
                         ";   N/A   N/A             N/A                      N/A      \n"
                         "      1     17535.400 DT 1  00000100 Tx -  8    00 00 00 00 00 00 00 00\n"
                         "      2     17540.300 ST 1         - Rx -  4    00 00 00 08\n"
                         "      3     17600.000 BI 2      07FF Rx -  9    00 01 02 03 04 05 06 07 08 09 0A 0B\n"
                         "      4     17700.000 ER 1      0002 Rx -  4    00 13 05 80\n");
  EXPECT_EQ(kept.errors(), 0U) << kept.text();
  const auto& e = kept.trace.entries;
  ASSERT_EQ(e.size(), 3U);
  EXPECT_EQ(kept.trace.buses, (std::vector<std::string>{"can0", "can1"}));
  EXPECT_TRUE(e[1].frame.fd && e[1].frame.brs && e[1].frame.esi);
  EXPECT_EQ(e[1].frame.size, 12) << "L is the DLC";
  EXPECT_TRUE(e[2].error);
  EXPECT_EQ(e[2].frame.data[2], 0x82) << "form error while sending";
  EXPECT_EQ(e[2].frame.data[6], 0x80);
  EXPECT_EQ(e[2].frame.data[7], 5);
}

TEST(Trc, ColumnsInAnotherOrder) {
  const auto kept = read(Format::trc, ";$FILEVERSION=2.1\n;$COLUMNS=O,I,d,T,L,D\n 1.5 0123 Tx DT 2 AA BB\n");
  ASSERT_EQ(kept.trace.entries.size(), 1U) << kept.text();
  EXPECT_EQ(kept.trace.entries[0].at, 1500us);
  EXPECT_EQ(kept.trace.entries[0].frame, can::Frame::base(0x123, {0xAA, 0xBB}));
}

// Found by the fuzz target: offsets of more than 104 days.
TEST(Trc, FramesYearsApart) {
  Trace trace;
  trace.buses = {"can0"};
  trace.entries.push_back({5s + 1us, 0, can::Frame::base(1, {1}), Direction::received});
  trace.entries.push_back({1436509052250001us, 0, can::Frame::base(2, {1}), Direction::received});
  const auto kept = read(Format::trc, test::write(Format::trc, trace).bytes);
  EXPECT_EQ(kept.errors(), 0U) << kept.text();
  EXPECT_EQ(kept.trace, trace);
}

TEST(Trc, SaysWhereItIsWrong) {
  const std::pair<const char*, int> wrong[] = {
      {"nonsense", 1},
      {"   1   x DT 1 0100 Rx - 0", 8},
      {"   1   1.000 DT 0 0100 Rx - 0", 17},
      {"   1   1.000 DT 1 0800 Rx - 0", 19},      // four digits beyond 11 bits
      {"   1   1.000 DT 1 FFFFFFFF Rx - 0", 19},  // beyond 29 bits
      {"   1   1.000 DT 1 0100 xR - 0", 24},
      {"   1   1.000 DT 1 0100 Rx - 16", 29},  // no DLC
      {"   1   1.000 DT 1 0100 Rx - 2 00", 33},
      {"   1   1.000 DT 1 0100 Rx - 2 00 0", 34},
      {"   1   1.000", 13},
  };
  for (const auto& [line, column] : wrong) {
    const auto kept = read(Format::trc, std::string(";$FILEVERSION=2.1\n") + line + "\n 2 2.0 DT 1 0001 Rx - 0\n");
    ASSERT_EQ(kept.errors(), 1U) << line << "\n" << kept.text();
    EXPECT_EQ(kept.findings[0].line, 2) << line;
    EXPECT_EQ(kept.findings[0].column, column) << line << ": " << kept.text();
    EXPECT_EQ(kept.trace.entries.size(), 1U) << "the good line stays: " << line;
  }
}

TEST(Trc, Writes21And11) {
  Trace trace;
  trace.buses = {"backbone", "can1"};
  can::Frame fd = can::Frame::base(0x123, {0xAA, 0xBB});
  fd.fd = fd.brs = true;
  trace.entries.push_back({1436509052249713us, 0, can::Frame::base(0x7E5, {0x51, 0}), Direction::received});
  trace.entries.push_back({1436509052250001us, 1, can::Frame::ext(0x1F90'0135, {}), Direction::sent});
  trace.entries.push_back({1436509052250400us, 0, can::Frame::request(0x701, 1), Direction::sent});
  trace.entries.push_back({1436509052250900us, 0, fd, Direction::received});
  const auto rows = [](const std::string& text) { return text.substr(text.rfind(";---+--")); };
  const auto text = test::write(Format::trc, trace);
  EXPECT_TRUE(text.bytes.starts_with(";$FILEVERSION=2.1\r\n;$STARTTIME=42195.26")) << text.bytes;
  const auto body = text.bytes.substr(text.bytes.rfind("-- --\r\n") + 7);
  EXPECT_EQ(body,
            ";   berth: bus 1 is backbone\r\n"
            "      1         0.713 DT 1      07E5 Rx -  2    51 00\r\n"
            "      2         1.001 DT 2  1F900135 Tx -  0\r\n"
            "      3         1.400 RR 1      0701 Tx -  1\r\n"
            "      4         1.900 FB 1      0123 Rx -  2    AA BB\r\n");
  EXPECT_TRUE(text.lost.empty());
  const auto old = test::write(Format::trc, trace, {.trc_1_1 = true});
  EXPECT_EQ(old.bytes.substr(old.bytes.rfind("-- --\r\n") + 7),
            "     1)         0.7  Rx         07E5  2  51 00\r\n"
            "     2)         1.0  Tx     1F900135  0 \r\n"
            "     3)         1.4  Tx         0701  1  RTR\r\n");
  ASSERT_EQ(old.lost.size(), 3U);
  EXPECT_EQ(old.lost[0], "1 FD frames are left out: the format has none");
  EXPECT_EQ(old.lost[1], "2 times are rounded to the format's unit");
  EXPECT_EQ(old.lost[2], "1 frames are of further buses: the format has one");
  EXPECT_FALSE(rows(old.bytes).empty());
}

}  // namespace
}  // namespace berth::trace
