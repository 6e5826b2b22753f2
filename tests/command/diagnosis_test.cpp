// What the doctor is told of a machine.
#include "berth/command/diagnosis.hpp"

#include "tests/pch.hpp"

namespace berth::command {
namespace {

using namespace std::chrono_literals;

// Links and configuration files move PDOs: then the identifier does not tell who sends it.
TEST(ExpectedOnABus, PdosAreThePredefinedOnesUnlessSomethingMovesThem) {
  design::Machine machine;
  machine.buses.emplace_back();
  machine.buses.back().name = "line";
  design::Slot slot;
  slot.spec.name = {"m", "line", "left"};
  slot.spec.id = NodeId(5);
  machine.slots.push_back(slot);
  EXPECT_TRUE(expected_on(machine, machine.buses[0]).predefined_pdos);
  machine.slots[0].spec.config = "left.dcf";
  EXPECT_FALSE(expected_on(machine, machine.buses[0]).predefined_pdos);
  machine.slots[0].spec.config.clear();
  machine.links.push_back({.from = {"left", "6000h"}, .to = {{"right", "6001h"}}, .deadline = 9ms, .place = {9, 1}});
  EXPECT_FALSE(expected_on(machine, machine.buses[0]).predefined_pdos);
}

}  // namespace
}  // namespace berth::command
