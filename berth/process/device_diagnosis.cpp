#include "berth/process/device_diagnosis.hpp"

namespace berth::process {

namespace {

constexpr std::uint8_t state_unknown = 255;

std::uint8_t error_control_of(co::HeartbeatEvent::Kind kind) noexcept {
  using enum co::HeartbeatEvent::Kind;
  switch (kind) {
    case lost: return BERTH_LOST;
    case boot_up:
    case never_seen: return BERTH_NOT_HEARD;
    case started:
    case state_changed:
    case recovered: break;
  }
  return BERTH_ALIVE;
}

}  // namespace

void forget_all(berth_diagnosis& told) noexcept {
  told = {};
  told.nmt_state = state_unknown;
  for (auto& node : told.nodes) node.nmt_state = state_unknown;
}

void tell_bus(const can::Status& bus, berth_diagnosis& told) noexcept {
  told.bus_up = bus.up ? 1 : 0;
  told.bus_off = bus.bus_off ? 1 : 0;
  told.error_passive = bus.error_passive() ? 1 : 0;
  told.transmit_errors = bus.tec;
  told.receive_errors = bus.rec;
  told.bus_errors = bus.errors;
  told.lost_frames = bus.lost;
}

DeviceDiagnosis::DeviceDiagnosis(device::Device& device, berth_diagnosis& told, const can::Port* port)
    : device_(&device), told_(&told), port_(port) {
  forget_all(*told_);
  auto& on = device.on();
  on.heartbeat = [this, before = std::move(on.heartbeat)](const co::HeartbeatEvent& event) {
    if (before) before(event);
    heartbeat(event);
  };
  on.emergency = [this, before = std::move(on.emergency)](NodeId node, const co::Emcy& message) {
    if (before) before(node, message);
    emergency(node, message);
  };
}

void DeviceDiagnosis::heartbeat(const co::HeartbeatEvent& event) noexcept {
  auto& node = told_->nodes[event.node.value() & 127U];
  node.error_control = error_control_of(event.kind);
  node.nmt_state = node.error_control == BERTH_LOST ? state_unknown : static_cast<std::uint8_t>(event.state);
}

void DeviceDiagnosis::emergency(NodeId id, const co::Emcy& message) noexcept {
  auto& node = told_->nodes[id.value() & 127U];
  node.emcy = message.code;
  node.error_register = message.error_register;
  ++node.emcy_count;
}

void DeviceDiagnosis::refresh() noexcept {
  told_->nmt_state = static_cast<std::uint8_t>(device_->state());
  const auto id = device_->node_id();
  told_->node_id = id.configured() ? id.value() : 0;
  told_->error_register = device_->values().get_or<std::uint8_t>({0x1001, 0}, 0);
  if (port_ != nullptr) tell_bus(port_->status(), *told_);
}

}  // namespace berth::process
