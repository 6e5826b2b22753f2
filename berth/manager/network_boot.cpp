#include "berth/manager/network_boot.hpp"

#include <algorithm>
#include <bitset>

namespace berth::manager {
namespace {

using co::NmtCommand;
using co::NmtTarget;

bool resets(NmtCommand command) noexcept {
  return command == NmtCommand::reset_node || command == NmtCommand::reset_communication;
}

Result<void> check(const NetworkPlan& plan) {
  if (!plan.startup.master) return fail(Errc::invalid, "1F80h bit 0 is not set: this device is no NMT master");
  std::bitset<128> named;
  for (const auto& slave : plan.slaves) {
    if (!slave.node.configured()) return fail(Errc::invalid, "a slave without a node-ID");
    Error error{.code = Errc::invalid, .node = slave.node.value(), .text = "named twice in the network list"};
    if (named.test(slave.node.value())) return fail(error);
    named.set(slave.node.value());
    error.text = "no target or no source for it";
    const bool unreachable = slave.target == nullptr || slave.source == nullptr;
    if (slave.rules.assigned && unreachable) return fail(error);
  }
  return {};
}

rt::Task<void> apply_to(BootBus& bus, NmtCommand command) {
  bus.apply(command);
  co_return;
}

// A mandatory slave that is not ready; null: there is none.
const SlaveBoots::Slave* missing(const SlaveBoots& boots) noexcept {
  const auto slaves = boots.all();
  const auto it = std::ranges::find_if(
      slaves, [](const auto& slave) { return slave->what.rules.mandatory && !slave->status.ready(); });
  return it == slaves.end() ? nullptr : it->get();
}

}  // namespace

NetworkBoot::NetworkBoot(rt::Executor& executor, BootBus& bus, const NetworkTiming& timing)
    : executor_(&executor),
      bus_(&bus),
      timing_(timing),
      boots_(executor, *this, timing),
      commands_(executor),
      startup_(executor) {}

// ---- the startup ----------------------------------------------------------------------------------------------------

Result<void> NetworkBoot::begin(NetworkPlan plan) {
  const auto good = check(plan);
  if (!good) return good;
  std::erase_if(plan.slaves, [&](const auto& slave) { return !slave.rules.assigned || slave.node == plan.own; });
  plan_ = std::move(plan);
  phase_.begin(plan_.startup);
  next_ = Next::begin;
  act_.post();
  return {};
}

void NetworkBoot::end(bool releases) noexcept {
  phase_.end();
  if (next_ != Next::release) next_ = releases ? Next::release : Next::cancel;
  act_.post();
}

void NetworkBoot::act() noexcept {
  const Next next = std::exchange(next_, Next::nothing);
  if (next == Next::nothing) return;
  boot_time_over_.cancel();
  startup_.cancel();
  if (next == Next::cancel) return boots_.cancel();
  if (next == Next::release) {
    commands_.cancel();
    return boots_.release();
  }
  boots_.set(plan_.slaves, plan_.boot_time, plan_.startup.flying);
  startup_.spawn(startup());
}

rt::Task<void> NetworkBoot::startup() {
  tell({.kind = Kind::begun});
  const bool has_mandatory = std::ranges::any_of(boots_.all(), [](const auto& s) { return s->what.rules.mandatory; });
  if (has_mandatory && plan_.boot_time.count() > 0) boot_time_over_.arm(plan_.boot_time);
  if (plan_.taken_over) {
    for (const auto& slave : boots_.all()) boots_.take_over(*slave);
    consider();
    co_return;
  }
  std::bitset<128> spared;
  for (const auto& slave : boots_.all()) spared[slave->what.node.value()] = slave->what.rules.keep_alive;
  const rt::Time since = executor_->now();
  if (spared.none()) {
    co_await send(NmtCommand::reset_communication, NmtTarget::all(), false);
  } else {
    if (plan_.own.configured()) spared.set(plan_.own.value());
    for (std::uint8_t node = 1; node < spared.size(); ++node) {
      const NmtTarget target{NodeId(node)};
      if (!spared[node]) co_await send(NmtCommand::reset_communication, target, false);
    }
  }
  for (const auto& slave : boots_.all()) boots_.boot(*slave, slave->what.rules.keep_alive ? rt::never : since);
  consider();
}

// Called in a task, so it ends none.
bool NetworkBoot::starts(const SlaveStatus& slave) noexcept {
  return phase_.starts(slave.rules, own_ == NmtState::operational);
}

void NetworkBoot::ended(const SlaveStatus& slave) noexcept {
  const auto kind = slave.ready() ? Kind::slave_ready : Kind::slave_failed;
  tell({.kind = kind, .node = slave.node, .status = slave.result.status, .detail = slave.result.detail});
  if (!slave.ready() && slave.rules.mandatory && phase_.is(Phase::booting)) return halt(slave.node, slave.result);
  if (timing_.resumes && missing(boots_) == nullptr) phase_.resume();
  consider();
}

void NetworkBoot::boot_time_over() noexcept {
  const auto* const slave = missing(boots_);
  if (!phase_.is(Phase::booting) || slave == nullptr) return;
  const bool silent = !slave->boot || !slave->boot->found();
  halt(slave->what.node, {.status = silent ? BootStatus::b : BootStatus::booted,
                          .detail = "its boot-up was not done in the boot time (1F89h)"});
}

void NetworkBoot::halt(NodeId node, const BootResult& why) noexcept {
  boot_time_over_.cancel();
  if (phase_.halt()) tell({.kind = Kind::halted, .node = node, .status = why.status, .detail = why.detail});
}

void NetworkBoot::consider() noexcept {
  if (!phase_.is(Phase::booting) || missing(boots_) != nullptr || !phase_.all_ready()) return;
  boot_time_over_.cancel();
  tell({.kind = Kind::ready});
  if (!phase_.is(Phase::ready)) return;  // the callback went on by itself
  if (own_ == NmtState::operational) return go();
  if (phase_.operates_itself()) static_cast<void>(operate());
}

Result<void> NetworkBoot::operate() {
  if (phase_.is(Phase::operational)) return {};
  if (!phase_.may_operate()) return fail(Errc::invalid, "the startup has not come so far");
  if (const auto* const slave = missing(boots_); slave != nullptr) {
    return fail(
        Error{.code = Errc::invalid, .node = slave->what.node.value(), .text = "this mandatory slave is not ready"});
  }
  phase_.make_ready();
  bus_->apply(NmtCommand::start);
  own_state(NmtState::operational);
  if (phase_.is(Phase::ready)) go();
  return {};
}

void NetworkBoot::own_state(NmtState state) noexcept {
  const NmtState before = std::exchange(own_, state);
  if (state != NmtState::operational || before == state) return;
  if (phase_.is(Phase::ready) || phase_.is(Phase::operational)) go();
}

// The master is operational, and all mandatory slaves are ready.
void NetworkBoot::go() noexcept {
  if (phase_.operate()) tell({.kind = Kind::operational});
  if (phase_.application_starts()) return;
  if (phase_.starts_all() && !plan_.taken_over) return command(NmtCommand::start, NmtTarget::all());
  // After a halted startup what became ready meanwhile, and of a network that was taken over what does not run.
  for (const auto& slave : boots_.all()) {
    const bool waiting = slave->status.phase == SlavePhase::ready && !slave->starting && slave->what.rules.boots;
    if (waiting) command(NmtCommand::start, slave->what.node);
  }
}

// ---- commands -------------------------------------------------------------------------------------------------------

void NetworkBoot::command(NmtCommand command, NmtTarget target, bool with_master) {
  // Later: who asks may be in the middle of a write to the dictionary that a reset loads anew.
  if (target.node != 0 && plan_.own == NodeId(target.node)) return commands_.spawn(apply_to(*bus_, command));
  commands_.spawn(send(command, target, with_master));
}

rt::Task<void> NetworkBoot::send(NmtCommand command, NmtTarget target, bool with_master) {
  auto* const known = target.node == 0 ? nullptr : boots_.find(NodeId(target.node));
  rt::Task<Result<rt::Time>> sending;
  if (known != nullptr) {
    sending = known->what.target->command(command);  // it may be beneath a gateway
  } else {
    sending = bus_->command(command, target);
  }
  const auto sent = co_await sending;
  if (!sent) not_sent(target.node == 0 ? NodeId() : NodeId(target.node), sent.error());
  const bool of_startup = phase_.is(Phase::booting) && startup_.running() > 0 && resets(command);
  if (sent && !of_startup) {
    for (const auto& slave : boots_.all()) {
      if (target.includes(slave->what.node)) commanded(*slave, command, *sent);
    }
  }
  if (with_master) bus_->apply(command);
}

// A command went out to it.
void NetworkBoot::commanded(SlaveBoots::Slave& slave, NmtCommand command, rt::Time at) noexcept {
  auto& status = slave.status;
  if (resets(command)) {
    status.state.reset();
    if (status.phase == SlavePhase::awaited || phase_.is(Phase::stopped) || phase_.is(Phase::off)) return;
    return boots_.boot(slave, at);
  }
  if (!status.supervised) status.state = co::state_after(command);
  if (!status.ready()) return;
  const auto before =
      std::exchange(status.phase, command == NmtCommand::start ? SlavePhase::started : SlavePhase::ready);
  if (before != SlavePhase::started && command == NmtCommand::start) started(status);
}

void NetworkBoot::not_sent(NodeId node, const Error& error) noexcept {
  tell({.kind = Kind::not_sent, .node = node, .detail = describe(error)});
}

// ---- what is known --------------------------------------------------------------------------------------------------

const SlaveStatus* NetworkBoot::find(NodeId node) const noexcept {
  const auto* const slave = boots_.find(node);
  return slave == nullptr ? nullptr : &slave->status;
}

Result<void> NetworkBoot::supervise(NodeId node, bool on) {
  auto* const slave = boots_.find(node);
  if (slave == nullptr) return fail(Errc::not_found, "the node is not assigned (1F81h)");
  if (!boots_.supervise(*slave, on)) {
    return fail(Errc::unsupported, "neither a heartbeat time (1016h) nor a guard time (1F81h) for it");
  }
  return {};
}

}  // namespace berth::manager
