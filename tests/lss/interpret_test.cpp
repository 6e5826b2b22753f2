// What is said of a frame. Paper 4's tables are held as a whole in tests/device; here every service by itself.
#include <gtest/gtest.h>
#include <rapidcheck/gtest.h>
#include <cstdint>
#include <string>
#include <vector>

#include "berth/lss/interpret.hpp"

namespace berth::lss {
namespace {

std::string say(const char* frame) { return interpret(*can::parse_frame(frame), 0x6D0); }

TEST(LssInterpret, EveryService) {
  const std::vector<std::pair<const char*, const char*>> all{
      {"7E5#0400000000000000", "Switch Mode Global - Operation Mode"},
      {"7E5#0401000000000000", "Switch Mode Global - Configuration Mode"},
      {"7E5#0407000000000000", "Switch Mode Global - unknown mode 0x07"},
      {"7E5#4041533501000000", "Switch Mode Selective - Vendor ID: 0x01355341"},
      {"7E5#4103004704000000", "Switch Mode Selective - Product Code: 0x04470003"},
      {"7E5#4206000200000000", "Switch Mode Selective - Revision Nr.: 0x00020006"},
      {"7E5#430DF0EDFE000000", "Switch Mode Selective - Serial Nr.: 0xFEEDF00D"},
      {"7E4#4400000000000000", "Switch Mode Selective - Success"},
      {"7E5#1103000000000000", "Configure Node ID - NID: 0x03"},
      {"7E5#11FF000000000000", "Configure Node ID - NID: 0xFF"},
      {"7E4#1100000000000000", "Configure Node ID - Success"},
      {"7E4#1101000000000000", "Configure Node ID - Error 1: out of range"},
      {"7E4#11FF420000000000", "Configure Node ID - Error 255: manufacturer's 0x42"},
      {"7E4#1102000000000000", "Configure Node ID - Error 2"},
      {"7E5#1300040000000000", "Configure Bit Timing - Table: 0, Index: 4 (125 kbit/s)"},
      {"7E5#1300090000000000", "Configure Bit Timing - Table: 0, Index: 9 (automatic)"},
      {"7E5#1300050000000000", "Configure Bit Timing - Table: 0, Index: 5"},
      {"7E5#1380040000000000", "Configure Bit Timing - Table: 128, Index: 4"},
      {"7E4#1301000000000000", "Configure Bit Timing - Error 1: not supported"},
      {"7E5#15E8030000000000", "Activate Bit Timing - Delay: 1000 ms"},
      {"7E5#1700000000000000", "Store Configuration"},
      {"7E4#1700000000000000", "Store Configuration - Success"},
      {"7E4#1701000000000000", "Store Configuration - Error 1: not supported"},
      {"7E4#1702000000000000", "Store Configuration - Error 2: storage media access"},
      {"7E5#5A00000000000000", "Inquire Vendor ID"},
      {"7E5#5D00000000000000", "Inquire Serial Nr."},
      {"7E4#5B03004704000000", "Inquire Product Code - 0x04470003"},
      {"7E4#5C06000200000000", "Inquire Revision Nr. - 0x00020006"},
      {"7E5#5E00000000000000", "Inquire Node ID"},
      {"7E4#5EFF000000000000", "Inquire Node ID - NID: 0xFF"},
      {"7E5#4641533501000000", "Identify Remote Servants - Vendor ID: 0x01355341"},
      {"7E5#4703004704000000", "Identify Remote Servants - Product Code: 0x04470003"},
      {"7E5#4800000000000000", "Identify Remote Servants - Revision Nr. from 0x00000000"},
      {"7E5#49FFFFFFFF000000", "Identify Remote Servants - Revision Nr. to 0xFFFFFFFF"},
      {"7E5#4A01000000000000", "Identify Remote Servants - Serial Nr. from 0x00000001"},
      {"7E5#4B02000000000000", "Identify Remote Servants - Serial Nr. to 0x00000002"},
      {"7E4#4F00000000000000", "Identify Servant"},
      {"7E5#4C00000000000000", "Identify Non-Configured Servants"},
      {"7E4#5000000000000000", "Identify Non-Configured Servant"},
      {"7E5#5100000000800000", "LSS Fastscan: Checking for new nodes"},
      {"7E5#5100F0EDFE090303", "LSS Fastscan: Serial Nr. - Checking bits 9 - 31"},
      {"7E5#51000000002A0303", "LSS Fastscan: not a legal request"},
      {"1F90FEED#", "LSS Fastscan: Bits 16 - 31 are 0xFEED"},
      {"1F91000A#", "LSS Fastscan: Bits 0 - 15 are 0x000A"},
      {"6DF#", "LSS Fastscan: Next 4 bits are 0xF"},
      {"703#00", "Boot up of node 3"},
      {"77F#00", "Boot up of node 127"},
      {"7E5#7F00000000000000", "LSS: unknown request 0x7F"},
      {"7E4#8000000000000000", "LSS: unknown answer 0x80"},
  };
  for (const auto& [frame, words] : all) EXPECT_EQ(say(frame), words) << frame;
}

TEST(LssInterpret, OtherFramesSayNothing) {
  for (const auto* frame : {"703#05", "700#00", "780#00", "7E5#04", "7E4#R8", "1F920000#", "1F900000#00", "6CF#",
                            "6E0#", "181#0011", "00000703#00", "080#"}) {
    EXPECT_EQ(say(frame), "") << frame;
  }
  EXPECT_EQ(interpret(*can::parse_frame("6DF#")), "") << "identifiers by configuration";
}

TEST(LssInterpret, ARowOfTheTable) {
  EXPECT_EQ(table_row(7, *can::parse_frame("7E5#5141533501000001")),
            "7\t0x7E5\tLSS Fastscan: Vendor ID - Checking bits 0 - 31\t51 41 53 35 01 00 00 01");
  EXPECT_EQ(table_row(2, *can::parse_frame("1F900135#")), "2\t0x1F900135\tLSS Fastscan: Bits 16 - 31 are 0x0135\t");
}

// Any frame at all: no word of a standard service for what is none.
RC_GTEST_PROP(LssInterpretProperty, AnyBytes, ()) {
  auto frame = can::Frame::base(*rc::gen::element(0x7E4U, 0x7E5U), {0, 0, 0, 0, 0, 0, 0, 0});
  for (auto& byte : std::span(frame.data).first(8)) byte = *rc::gen::arbitrary<std::uint8_t>();
  const auto words = interpret(frame);
  RC_ASSERT(!words.empty());
  RC_ASSERT(words.starts_with("LSS Fastscan") == (frame.id == 0x7E5 && frame.data[0] == 0x51));
}

}  // namespace
}  // namespace berth::lss
