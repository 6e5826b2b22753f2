#include "berth/manager/error_events.hpp"

#include "berth/manager/network_boot.hpp"

namespace berth::manager {

using co::NmtCommand;
using Kind = NetworkEvent::Kind;
using Phase = NetworkBoot::Phase;

// Nothing has begun, or other slaves are about to come.
bool ErrorEvents::deaf() const noexcept {
  return network_->phase_.is(Phase::off) || network_->next_ == NetworkBoot::Next::begin;
}

void ErrorEvents::boot_up(NodeId node, bool expected) noexcept {
  if (deaf() || node == network_->plan_.own) return;
  auto& boots = network_->boots_;
  auto* const slave = boots.find(node);
  if (slave == nullptr) return network_->tell({.kind = Kind::stranger, .node = node, .status = BootStatus::a});
  const SlavePhase was = slave->status.phase;
  slave->status.state = NmtState::pre_operational;
  if (was == SlavePhase::booting) return boots.booted_while_booting(*slave, expected);
  if (slave->status.ready()) return act(*slave, true);
  if (!network_->phase_.is(Phase::stopped) && was != SlavePhase::idle) boots.boot(*slave);
}

void ErrorEvents::lost(NodeId node) noexcept {
  auto* const slave = network_->boots_.find(node);
  if (deaf() || slave == nullptr) return;
  slave->status.state.reset();
  if (slave->status.ready()) {
    act(*slave, false);
  } else {
    network_->tell({.kind = Kind::slave_lost, .node = node});
  }
}

void ErrorEvents::back(NodeId node) noexcept {
  auto* const slave = network_->boots_.find(node);
  if (deaf() || slave == nullptr) return;
  network_->tell({.kind = Kind::slave_back, .node = node});
  // The reset that it was sent has not reached it: it was cut off.
  const bool unreset = slave->status.phase == SlavePhase::awaited && !network_->phase_.is(Phase::stopped);
  if (unreset) network_->command(NmtCommand::reset_node, node);
}

void ErrorEvents::told(NodeId node, NmtState state) noexcept {
  auto* const slave = network_->boots_.find(node);
  if (slave != nullptr) slave->status.state = state;
}

void ErrorEvents::overheard(const co::NmtRequest& request) noexcept {
  if (deaf() || request.command != NmtCommand::start) return;
  for (const auto& slave : network_->boots_.all()) {
    auto& state = slave->status.state;
    if (state && request.target.includes(slave->what.node)) state = NmtState::operational;
  }
}

void ErrorEvents::act(SlaveBoots::Slave& slave, bool rebooted) noexcept {
  const NodeId node = slave.what.node;
  const auto& rules = slave.what.rules;
  network_->tell({.kind = rebooted ? Kind::slave_rebooted : Kind::slave_lost, .node = node});
  if (network_->phase_.is(Phase::stopped) || deaf()) return;  // the callback may have ended it
  using OnError = StartupPhase::OnError;
  const OnError what = network_->phase_.on_error(rules);
  if (what != OnError::one) {
    const bool stops = what == OnError::stop;
    slave.status.phase = SlavePhase::awaited;
    network_->end();
    if (stops) network_->phase_.stop();
    network_->tell({.kind = stops ? Kind::all_stopped : Kind::all_reset, .node = node});
    return network_->command(stops ? NmtCommand::stop : NmtCommand::reset_node, co::NmtTarget::all(), true);
  }
  if (rebooted || rules.keep_alive) return network_->boots_.boot(slave);
  slave.status.phase = SlavePhase::awaited;
  network_->command(NmtCommand::reset_node, node);
}

}  // namespace berth::manager
