// The harvester (examples/harvester): five buses, 62 devices, Berth on the backbone alone.
#include "tests/harvester/harvester.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <chrono>
#include <string>
#include <vector>

#include "../pch.hpp"

namespace berth::test {
namespace {

using namespace std::chrono_literals;
using places::SlotState;

}  // namespace

// From blank to operational, from the bottom up: each gateway runs after the last mandatory device beneath it.
TEST(HarvesterMachine, BootsFromBlankFromTheBottomUp) {
  Harvester machine;
  ASSERT_TRUE(machine.begin()) << machine.problem();
  ASSERT_TRUE(machine.run_until([&] { return machine.operational() && machine.all_run(); }, 60s)) << machine.log();
  for (const auto& bus : machine.machine().beneath) {
    const auto* const gateway = machine.machine().slot(bus.gateway->bus, bus.gateway->slot);
    ASSERT_NE(gateway, nullptr);
    const auto above = machine.operational_at(gateway->spec.name.name);
    for (const auto& spec : machine.machine().specs(bus.name)) {
      if (!spec.mandatory) continue;
      EXPECT_LT(machine.operational_at(spec.name.name), above) << spec.name.name;
    }
  }
}

// The two undercarriages have the same node-IDs, and each device sits in the slot of its own side: node-IDs go by serial
// number, ascending.
TEST(HarvesterMachine, EqualSubsystemsStayApart) {
  Harvester machine;
  ASSERT_TRUE(machine.begin()) << machine.problem();
  ASSERT_TRUE(machine.run_until([&] { return machine.operational() && machine.all_run(); }, 60s)) << machine.log();
  for (const auto& slot : machine.machine().slots) {
    const auto truth = machine.truth(slot.spec.name.name);
    EXPECT_EQ(truth.bus, slot.spec.name.bus);
    EXPECT_EQ(truth.active, slot.spec.id) << slot.spec.name.name;
  }
}

}  // namespace berth::test
