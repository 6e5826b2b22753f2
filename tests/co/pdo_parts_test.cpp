// The parts of a device's PDOs by themselves: the count of errors, the records, the queue of a SAM MPDO.
#include <gtest/gtest.h>

#include <vector>

#include "berth/co/mpdo.hpp"
#include "berth/co/pdo_records.hpp"
#include "berth/od/description.hpp"

namespace berth::co {
namespace {

struct Told final : ServiceOwner {
  void raise_error(std::uint16_t code, std::uint8_t, const std::array<std::uint8_t, 5>& info) noexcept override {
    raised.push_back({code, info[0]});
  }
  void clear_error(std::uint16_t code) noexcept override { cleared.push_back(code); }
  std::vector<std::pair<std::uint16_t, std::uint8_t>> raised;
  std::vector<std::uint16_t> cleared;
};

TEST(PdoFaults, OneEmergencyNamesTheFirstAndEndsWithTheLast) {
  Told told;
  PdoFaults faults(told);
  faults.begin(PdoFault::timeout, {3});
  faults.begin(PdoFault::timeout, {4});
  faults.begin(PdoFault::too_short, {5});
  EXPECT_EQ(told.raised, (std::vector<std::pair<std::uint16_t, std::uint8_t>>{{0x8250, 3}, {0x8210, 5}}));
  faults.end(PdoFault::timeout);
  EXPECT_TRUE(told.cleared.empty());
  faults.end(PdoFault::timeout);
  EXPECT_EQ(told.cleared, std::vector<std::uint16_t>{0x8250});
}

TEST(PdoRecords, AnIndexNamesKindRecordAndNumber) {
  EXPECT_EQ(PdoRecord::of(0x1400).kind, PdoKind::rpdo);
  EXPECT_EQ(PdoRecord::of(0x1400).number, 1);
  EXPECT_FALSE(PdoRecord::of(0x15FF).mapping);
  EXPECT_EQ(PdoRecord::of(0x15FF).number, 512);
  EXPECT_TRUE(PdoRecord::of(0x1600).mapping);
  EXPECT_EQ(PdoRecord::of(0x1BFF).kind, PdoKind::tpdo);
  EXPECT_TRUE(PdoRecord::of(0x1BFF).mapping);
  EXPECT_EQ(PdoRecord::of(0x1BFF).number, 512);
}

TEST(PdoRecords, OnlyTpdosHaveTypesForRemoteFramesAndMpdosOnlyEvents) {
  for (const unsigned type : {0xFCU, 0xFDU}) {
    EXPECT_TRUE(usable_type(PdoKind::tpdo, static_cast<std::uint8_t>(type), 1));
    EXPECT_FALSE(usable_type(PdoKind::rpdo, static_cast<std::uint8_t>(type), 1));
  }
  for (const unsigned count : {0xFEU, 0xFFU}) {
    EXPECT_TRUE(usable_type(PdoKind::tpdo, 0xFE, static_cast<std::uint8_t>(count)));
    EXPECT_FALSE(usable_type(PdoKind::tpdo, 0x01, static_cast<std::uint8_t>(count)));
  }
  EXPECT_FALSE(usable_type(PdoKind::tpdo, 0xF1, 1)) << "reserved";
}

TEST(MpdoFrames, WhatIsMadeIsHeard) {
  const std::array<std::uint8_t, 2> value{0x34, 0x12};
  const auto dam = mpdo::Heard::of(mpdo::make_dam(0x181, 5, {0x2000, 3}, value));
  EXPECT_TRUE(dam.destination);
  EXPECT_EQ(dam.node, 5);
  EXPECT_EQ(dam.object, (ObjectRef{0x2000, 3}));
  EXPECT_EQ(dam.data, (std::array<std::uint8_t, 4>{0x34, 0x12, 0, 0}));
  const auto sam = mpdo::Heard::of(mpdo::make_sam(0x181, NodeId(7), {0x2000, 3}, value));
  EXPECT_FALSE(sam.destination);
  EXPECT_EQ(sam.node, 7);
}

}  // namespace
}  // namespace berth::co
