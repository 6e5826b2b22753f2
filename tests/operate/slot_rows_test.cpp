// The slot table fits a terminal of 80 columns: what is given up, in which order.
#include "berth/operate/slot_rows.hpp"

#include <gtest/gtest.h>

#include <chrono>
#include <string>

#include "berth/text/columns.hpp"

using namespace berth;
using namespace std::chrono_literals;
using operate::SlotReport;
using operate::SlotRows;

namespace {

SlotReport slot(std::uint8_t id, const std::string& name, const std::string& bus = "field") {
  SlotReport s{bus,
               NodeId(id),
               name,
               {1, 7},
               LssAddress{1, 7, 0x10001, 0xABCDEF},
               places::SlotState::operational,
               rt::Time(12345ms),
               ""};
  s.nmt = NmtState::operational;
  s.heard = rt::Time(20s);
  return s;
}

operate::EmcyReport emcy(std::uint32_t count) { return {0x2310, 0x03, "current", rt::Time(3s), count}; }

}  // namespace

TEST(SlotRows, AShortNameLeavesRoomForAll) {
  const std::vector<SlotReport> slots{slot(3, "s3")};
  const SlotRows rows(slots, {});
  EXPECT_EQ(rows.heading(), "bus     id  slot  state        NMT       since  type               serial");
  EXPECT_EQ(rows.row(slots[0]), "field    3  s3    operational  op     12.345 s  00000001-00000007  00ABCDEF");
}

// A slot may take several types (`also =`): the one that is there counts.
TEST(SlotRows, TheTypeIsThatOfTheDevice) {
  std::vector<SlotReport> slots{slot(3, "s3")};
  slots[0].device = Identity(LssAddress{1, 9, 0x10001, 0xABCDEF});
  EXPECT_NE(SlotRows(slots, {}).row(slots[0]).find("00000001-00000009"), std::string::npos);
  slots[0].device.reset();
  EXPECT_NE(SlotRows(slots, {}).row(slots[0]).find("00000001-00000007"), std::string::npos);
}

TEST(SlotRows, TheTimeGoesFirstThenTheType) {
  std::vector<SlotReport> slots{slot(3, std::string(20, 'n'))};
  const SlotRows rows(slots, {.now = rt::Time(20s + 400ms)});
  EXPECT_EQ(rows.heading(), "bus     id  slot                  state        NMT  heard  serial");
  EXPECT_EQ(rows.row(slots[0]), "field    3  nnnnnnnnnnnnnnnnnnnn  operational  op   0.4 s  00ABCDEF");
}

TEST(SlotRows, AnErrorIsAColumnWhereThereIsOne) {
  std::vector<SlotReport> slots{slot(3, "s3"), slot(4, "s4")};
  slots[1].emcy = emcy(12);
  const SlotRows rows(slots, {.now = rt::Time(21s)});
  EXPECT_NE(rows.heading().find("  EMCY  "), std::string::npos) << rows.heading();
  EXPECT_NE(rows.row(slots[1]).find("  2310h x12  "), std::string::npos) << rows.row(slots[1]);
  slots[1].emcy = emcy(1);
  EXPECT_NE(SlotRows(slots, {}).row(slots[1]).find("  2310h  "), std::string::npos);
}

// Twenty letters, two buses, a state of many letters, an error: state and error stay to the end.
TEST(SlotRows, FitEveryWidth) {
  std::vector<SlotReport> slots{slot(3, "hoist-left-and-right"), slot(127, "b", "a bus of many words")};
  slots[0].state = places::SlotState::power_cycle;
  slots[1].emcy = emcy(4'000'000'000U);
  for (std::size_t width = 60; width <= 200; ++width) {
    const SlotRows rows(slots, {.width = width, .now = rt::Time(9999s)});
    for (const auto& line : {rows.heading(), rows.row(slots[0]), rows.row(slots[1])}) {
      EXPECT_LE(text::columns(line), width) << line;
    }
    EXPECT_NE(rows.row(slots[0]).find("power cycle needed"), std::string::npos);
    EXPECT_NE(rows.row(slots[1]).find("2310h"), std::string::npos);
  }
}
