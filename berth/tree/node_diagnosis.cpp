#include "berth/tree/node_diagnosis.hpp"

#include "berth/process/device_diagnosis.hpp"

namespace berth::tree {

namespace {

std::uint8_t configuration_of(places::SlotState state) noexcept {
  using enum places::SlotState;
  switch (state) {
    case unknown: break;
    case empty:
    case absent: return BERTH_NO_DEVICE;
    case binding:
    case present:
    case configuring: return BERTH_CONFIGURING;
    case operational: return BERTH_CONFIGURED;
    case question:
    case power_cycle:
    case failed:
    case duplicate:
    case wrong_type: return BERTH_REFUSED;
  }
  return BERTH_CONFIGURATION_UNKNOWN;
}

std::uint8_t error_control_of(const operate::BusServices& bus, const operate::SlotReport& slot) noexcept {
  if (bus.heartbeats.lost(slot.id) || slot.state == places::SlotState::absent) return BERTH_LOST;
  if (bus.watched_state(slot.id)) return BERTH_ALIVE;
  return bus.heartbeats.supervised(slot.id) ? BERTH_NOT_HEARD : BERTH_NOT_WATCHED;
}

void fill(const operate::SlotReport& slot, const operate::BusServices& bus, berth_node_diagnosis& node) noexcept {
  if (slot.nmt) node.nmt_state = static_cast<std::uint8_t>(*slot.nmt);
  node.error_control = error_control_of(bus, slot);
  node.configuration = configuration_of(slot.state);
  node.boot = manager::is_ready(slot.boot) ? '\0' : manager::letter(slot.boot);
  if (!slot.emcy) return;
  node.emcy = slot.emcy->code;
  node.error_register = slot.emcy->error_register;
  node.emcy_count = slot.emcy->count;
}

}  // namespace

berth_diagnosis diagnosis_of(Session& session, std::string_view bus) {
  berth_diagnosis told;
  process::forget_all(told);
  auto* const network = session.network(bus);
  if (network == nullptr) return told;
  const auto& services = network->services();
  told.node_id = services.bus.master.configured() ? services.bus.master.value() : 0;
  process::tell_bus(services.port.status(), told);
  for (const auto& slot : session.slots()) {
    if (slot.bus == services.bus.name && slot.id.configured()) fill(slot, services, told.nodes[slot.id.value()]);
  }
  return told;
}

}  // namespace berth::tree
