// A row of a live trace for a terminal: what is given up, in which order.
#include "apps/berth/trace_brief.hpp"

#include <gtest/gtest.h>

#include "berth/text/columns.hpp"

namespace berth::test {
namespace {

using namespace std::chrono_literals;
using cli::brief_line;

constexpr const char* pdo_words =
    "TPDO 1 of node 2 [Berth I-O module]: Read input 8 bit.Inputs 1 to 8 = 90, Read input 8 bit.Inputs 9 to 16 = 255";

std::string pdo_at(std::size_t width) { return brief_line(149ms, {}, "182#5AFF", pdo_words, {.width = width}); }

// Without the type the bytes have room again.
TEST(TraceBrief, BytesGoFirstThenTheDevicesType) {
  EXPECT_EQ(pdo_at(140), "    0.1490 182  " + std::string(pdo_words) + std::string(9, ' ') + "5AFF");
  EXPECT_EQ(pdo_at(127), "    0.1490 182  " + std::string(pdo_words));
  EXPECT_EQ(pdo_at(126),
            "    0.1490 182  TPDO 1 of node 2: Read input 8 bit.Inputs 1 to 8 = 90, "
            "Read input 8 bit.Inputs 9 to 16 = 255              5AFF");
}

TEST(TraceBrief, TheValuesStayAtEightyColumns) {
  EXPECT_EQ(pdo_at(80), "    0.1490 182  TPDO 1 of node 2: Inputs 1 to 8 = 90, Inputs 9 to 16 = 255  5AFF");
  EXPECT_EQ(pdo_at(60), "    0.1490 182  TPDO 1 of node 2: Input~ = 90, Input~ = 255");
}

TEST(TraceBrief, AnAbortKeepsItsReason) {
  const std::string line = brief_line(
      12s, {}, "585#8020100100000206",
      "SDO read node 5 1020h:01 Verify configuration.Configuration date: abort by the server, 06020000h, no object",
      {.width = 88});
  EXPECT_EQ(line, "   12.0000 585  SDO read node 5 1020h:01 Con~: abort by the server, 06020000h, no object");
}

TEST(TraceBrief, NoLineIsWiderThanTheTerminal) {
  for (std::size_t width = 0; width < 150; ++width) {
    EXPECT_LE(text::columns(pdo_at(width)), width);
    const std::string odd =
        brief_line(1s, "bus", "181#", "a = , b: = c = 1234h = \xC3\xA4\xC3\xA4 = ", {.width = width});
    EXPECT_LE(text::columns(odd), width);
  }
}

}  // namespace
}  // namespace berth::test
