#include "berth/network/error_events.hpp"

namespace berth::network {

using co::NmtCommand;
using Kind = NetworkEvent::Kind;
using Phase = StartupPhase::Phase;

void ErrorEvents::boot_up(NodeId node, bool expected) noexcept {
  if (network_->is_off()) return;
  auto* const slave = boots_->find(node);
  if (slave == nullptr) return network_->tell({.kind = Kind::stranger, .node = node, .status = manager::BootStatus::a});
  const SlavePhase was = slave->status.phase;
  slave->status.state = NmtState::pre_operational;
  if (was == SlavePhase::booting) return boots_->booted_while_booting(*slave, expected);
  if (slave->status.ready()) return act(*slave, true);
  if (!startup_->is(Phase::stopped) && was != SlavePhase::idle) boots_->boot(*slave);
}

void ErrorEvents::lost(NodeId node) noexcept {
  auto* const slave = boots_->find(node);
  if (network_->is_off() || slave == nullptr) return;
  slave->status.state.reset();
  if (slave->status.ready()) {
    act(*slave, false);
  } else {
    network_->tell({.kind = Kind::slave_lost, .node = node});
  }
}

void ErrorEvents::back(NodeId node) noexcept {
  auto* const slave = boots_->find(node);
  if (network_->is_off() || slave == nullptr) return;
  network_->tell({.kind = Kind::slave_back, .node = node});
  // The slave was cut off from the bus when it was to be reset, so it missed the reset.
  const bool unreset = slave->status.phase == SlavePhase::awaited && !startup_->is(Phase::stopped);
  if (unreset) network_->command(NmtCommand::reset_node, node, false);
}

void ErrorEvents::told(NodeId node, NmtState state) noexcept {
  auto* const slave = boots_->find(node);
  if (slave != nullptr) slave->status.state = state;
}

void ErrorEvents::silent(NodeId node) noexcept {
  auto* const slave = boots_->find(node);
  const bool stale = slave != nullptr && !slave->status.supervised && !slave->status.ready();
  if (stale) slave->status.state.reset();
}

void ErrorEvents::overheard(const co::NmtRequest& request) noexcept {
  if (network_->is_off() || request.command != NmtCommand::start) return;
  for (const auto& slave : boots_->all()) {
    auto& state = slave->status.state;
    if (state && request.target.includes(slave->what.node)) state = NmtState::operational;
  }
}

void ErrorEvents::act(Slave& slave, bool rebooted) noexcept {
  const NodeId node = slave.what.node;
  network_->tell({.kind = rebooted ? Kind::slave_rebooted : Kind::slave_lost, .node = node});
  if (network_->is_off()) return;  // the callback has ended the network boot
  const auto what = startup_->on_error(slave);
  if (!what) return;
  if (*what != StartupPhase::OnError::one) {
    const bool stops = *what == StartupPhase::OnError::stop;
    slave.status.phase = SlavePhase::awaited;
    network_->end_for_all(stops);
    network_->tell({.kind = stops ? Kind::all_stopped : Kind::all_reset, .node = node});
    return network_->command(stops ? NmtCommand::stop : NmtCommand::reset_node, co::NmtTarget::all(), true);
  }
  if (rebooted || slave.what.rules.keep_alive) return boots_->boot(slave);
  slave.status.phase = SlavePhase::awaited;
  network_->command(NmtCommand::reset_node, node, false);
}

}  // namespace berth::network
