#include "berth/co/nmt_slave.hpp"

#include "berth/co/cob_id.hpp"

namespace berth::co {

NmtSlave::NmtSlave(can::Dispatcher& dispatcher, Owner& owner) : dispatcher_(&dispatcher), owner_(&owner) {
  dispatcher.add(can::only(nmt_command_id), *this);
}

void NmtSlave::power_on() noexcept {
  power_off();
  owner_->reset(NmtReset::node, dispatcher_->executor().now());
}

void NmtSlave::power_off() noexcept {
  cancel();
  state_ = NmtState::initialising;
  node_id_ = NodeId();
}

void NmtSlave::initialised(NodeId node_id) noexcept {
  if (state_ != NmtState::initialising) return;
  cancel();
  node_id_ = node_id;
  if (node_id.configured()) send_boot_up();
}

void NmtSlave::send_boot_up() noexcept {
  switch (dispatcher_->send(can::Frame::base(error_control_id(node_id_), {0x00}))) {
    case can::Queued::yes: enter(NmtState::pre_operational); break;
    case can::Queued::full: dispatcher_->executor().after(boot_up_retry_, *this); break;
    default: dispatcher_->executor().after(100 * boot_up_retry_, *this);  // bus-off or a cut cable: there is no hurry
  }
}

void NmtSlave::run() noexcept { send_boot_up(); }

void NmtSlave::received(const can::Frame& frame, rt::Time) noexcept {
  const auto request = parse_nmt(frame);
  if (!request || state_ == NmtState::initialising || !request->target.includes(node_id_)) return;
  apply(request->command);
}

void NmtSlave::apply(NmtCommand command) noexcept {
  if (command == NmtCommand::reset_node) return reset(NmtReset::node);
  if (command == NmtCommand::reset_communication) return reset(NmtReset::communication);
  if (state_ != NmtState::initialising) enter(state_after(command));
}

void NmtSlave::apply_error_behaviour(std::uint8_t value) noexcept {
  if (value == 1 || state_ == NmtState::initialising) return;
  if (value == 2) {
    enter(NmtState::stopped);
  } else if (state_ == NmtState::operational) {
    enter(NmtState::pre_operational);
  }
}

void NmtSlave::enter(NmtState to) noexcept {
  if (to == state_ || (held_ && to == NmtState::operational)) return;
  const auto from = state_;
  state_ = to;
  owner_->state_changed(from, to, dispatcher_->executor().now());
}

void NmtSlave::reset(NmtReset what) noexcept {
  cancel();
  enter(NmtState::initialising);
  owner_->reset(what, dispatcher_->executor().now());
}

}  // namespace berth::co
