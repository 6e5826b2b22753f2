// A device as CANopenNode's programs are without storage files: it stays pre-operational until 1010h was saved and it
// was restarted. The slot says so, and a person is asked once.
#include <gtest/gtest.h>

#include <string>

#include "berth/rt/scope.hpp"
#include "tests/harness/rig.hpp"

using namespace berth;
using namespace berth::harness;
using places::SlotState;

namespace first_save_tests {
namespace {

constexpr std::uint32_t save_signature = 0x6576'6173;  // "save", CiA 301 §7.5.2.13

rt::Task<void> save(operate::Network& network, NodeId node) {
  const auto saved = co_await network.services().sdo.write<std::uint32_t>(node, 0x1010, 1, save_signature);
  EXPECT_TRUE(saved) << describe(saved.error());
}

rt::Task<void> reset(operate::Network& network, NodeId node, co::NmtCommand command) {
  const auto sent = co_await network.services().nmt.send(command, node);
  EXPECT_TRUE(sent);
}

std::string reason_of(Rig& rig, unsigned id) {
  for (const auto& slot : rig.network().report()) {
    if (slot.id.value() == id) return slot.reason;
  }
  return {};
}

}  // namespace

TEST(FirstSave, TheSlotSaysWhyAndOffersToSave) {
  auto machine = one_bus(125'000);
  add_slot(machine, 5, type_b);
  auto plant = one_bus_plant(1);
  add_device(plant, "node", type_b, 1).storing.needs_first_save = true;
  Rig rig(machine, plant);
  unsigned offers = 0;
  rig.on_event([&](const operate::Event& e) { offers += e.offers_save ? 1U : 0U; });
  rig.begin();
  ASSERT_TRUE(rig.run_until([&] { return rig.state(5) == SlotState::failed; }, 30s)) << rig.log();
  for (const char* const word : {"EMCY 5000h", "`berth store 5`", "`berth nmt reset-node 5`"}) {
    EXPECT_NE(reason_of(rig, 5).find(word), std::string::npos) << reason_of(rig, 5);
  }
  const auto told = rig.log().size();
  rig.run_for(60s);
  EXPECT_FALSE(rig.operational()) << rig.log();
  EXPECT_EQ(rig.log().size(), told) << "it was tried again, which cannot help\n" << rig.log();
  EXPECT_EQ(offers, 1U) << rig.log();
  rt::Scope scope(rig.world().executor());
  // Saved, it still has to start anew: NMT reset communication is not enough.
  scope.spawn(save(rig.network(), NodeId(5)));
  rig.run_for(1s);
  scope.spawn(reset(rig.network(), NodeId(5), co::NmtCommand::reset_communication));
  rig.run_for(20s);
  EXPECT_FALSE(rig.operational()) << rig.log();
  scope.spawn(reset(rig.network(), NodeId(5), co::NmtCommand::reset_node));
  EXPECT_TRUE(rig.until_operational(30s)) << rig.log();
}

// It is not asked of a device that tells another error.
TEST(FirstSave, AnotherErrorIsNoReasonToSave) {
  auto machine = one_bus(125'000);
  add_slot(machine, 5, type_b);
  auto plant = one_bus_plant(1);
  add_device(plant, "node", type_b, 1);
  Rig rig(machine, plant);
  unsigned offers = 0;
  rig.on_event([&](const operate::Event& e) { offers += e.offers_save ? 1U : 0U; });
  rig.begin();
  ASSERT_TRUE(rig.until_operational(30s)) << rig.log();
  EXPECT_EQ(offers, 0U);
}

}  // namespace first_save_tests
