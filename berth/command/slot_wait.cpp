#include "berth/command/slot_wait.hpp"

#include <algorithm>

#include "berth/rt/task.hpp"

namespace berth::command {
namespace {

using operate::Network;
using operate::SlotReport;
using places::SlotState;

// In the other states, the slot may still get a device.
bool settled(SlotState state) {
  switch (state) {
    case SlotState::operational:
    case SlotState::question:
    case SlotState::power_cycle:
    case SlotState::failed:
    case SlotState::duplicate:
    case SlotState::wrong_type: return true;
    default: return false;
  }
}

rt::Duration pause_of(const Network& network) noexcept {
  return network.bus().timing.heartbeat_period / 8 + std::chrono::milliseconds(1);
}

}  // namespace

std::optional<SlotReport> slot_report(const Network& network, const std::string& name) {
  const auto slots = network.report();
  const auto it = std::ranges::find(slots, name, &SlotReport::name);
  return it == slots.end() ? std::nullopt : std::optional<SlotReport>(*it);
}

rt::Duration longest_wait(const Network& network) noexcept {
  const auto& timing = network.bus().timing;
  return 3 * timing.probe_period + timing.boot_timeout;
}

rt::Task<void> await_slot(Network& network, const std::string& name) {
  const rt::Time deadline = network.services().executor.now() + longest_wait(network);
  while (network.services().executor.now() < deadline) {
    co_await rt::sleep_for(pause_of(network));
    const auto slot = slot_report(network, name);
    if (slot && settled(slot->state)) co_return;
  }
}

rt::Task<void> await_restart(Network& network, const std::string& name, std::uint64_t boot_ups) {
  auto& services = network.services();
  rt::Time deadline = services.executor.now() + longest_wait(network);
  while (services.executor.now() < deadline) {
    co_await rt::sleep_for(pause_of(network));
    const auto slot = slot_report(network, name);
    if (!slot) co_return;
    // The state before the boot-up is that of the time before the reset.
    const bool booted = services.boots.boot_ups(slot->id) != boot_ups;
    if (booted && settled(slot->state)) co_return;
    if (slot->state == SlotState::configuring) deadline = services.executor.now() + longest_wait(network);
  }
}

}  // namespace berth::command
