#include "berth/network/network_boot.hpp"

#include <algorithm>
#include <bitset>

namespace berth::network {
namespace {

using co::NmtCommand;
using co::NmtTarget;

bool resets(NmtCommand command) noexcept {
  return command == NmtCommand::reset_node || command == NmtCommand::reset_communication;
}

Result<void> check(const NetworkPlan& plan) {
  if (!plan.startup.master) return fail(Errc::invalid, "1F80h bit 0 is not set: this device is not an NMT master");
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

}  // namespace

NetworkBoot::NetworkBoot(rt::Executor& executor, BootBus& bus, const NetworkTiming& timing)
    : executor_(&executor),
      bus_(&bus),
      timing_(timing),
      boots_(executor, *this, timing),
      startup_(executor, *this),
      commands_(executor),
      beginning_(executor) {}

// ---- the startup ----------------------------------------------------------------------------------------------------

Result<void> NetworkBoot::begin(NetworkPlan plan) {
  const auto good = check(plan);
  if (!good) return good;
  std::erase_if(plan.slaves, [&](const auto& slave) { return !slave.rules.assigned || slave.node == plan.own; });
  plan_ = std::move(plan);
  startup_.begin({.rules = plan_.startup});  // without slaves: they are added later
  next_ = Next::begin;
  act_.post();
  return {};
}

void NetworkBoot::end(bool releases) noexcept {
  startup_.end();
  if (next_ != Next::release) next_ = releases ? Next::release : Next::cancel;
  act_.post();
}

bool NetworkBoot::is_off() const noexcept { return startup_.is(Phase::off) || next_ == Next::begin; }

void NetworkBoot::end_for_all(bool stopped) noexcept {
  end();
  if (stopped) startup_.stop();
}

void NetworkBoot::act() noexcept {
  const Next next = std::exchange(next_, Next::nothing);
  if (next == Next::nothing) return;
  beginning_.cancel();
  if (next == Next::cancel) return boots_.cancel();
  if (next == Next::release) {
    commands_.cancel();
    return boots_.release();
  }
  boots_.set(plan_.slaves, plan_.boot_time, plan_.startup.flying);
  NetworkStartup::Plan startup{.rules = plan_.startup, .boot_time = plan_.boot_time, .slaves = {}};
  startup.resumes = timing_.resumes;
  for (const auto& slave : boots_.all()) startup.slaves.push_back(slave.get());
  startup_.begin(std::move(startup));
  beginning_.spawn(reset_and_boot());
}

rt::Task<void> NetworkBoot::reset_and_boot() {
  tell({.kind = Kind::begun});
  if (plan_.taken_over) {
    for (const auto& slave : boots_.all()) boots_.take_over(*slave);
    go(startup_.look());
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
  go(startup_.look());
}

// Called within a slave's task, so this must not end any task.
void NetworkBoot::ended(Slave& slave) noexcept {
  const SlaveStatus& status = slave.status;
  const auto kind = status.ready() ? Kind::slave_ready : Kind::slave_failed;
  tell({.kind = kind, .node = status.node, .status = status.result.status, .detail = status.result.detail});
  go(startup_.look());
}

void NetworkBoot::started(Slave& slave, const Result<bool>& ran) noexcept {
  NetworkEvent event{.kind = Kind::slave_started, .node = slave.what.node};
  if (!ran) event = {.kind = Kind::not_sent, .node = slave.what.node, .detail = describe(ran.error())};
  tell(event);
}

void NetworkBoot::heard(NetworkStartup::News news, const Slave* slave) noexcept {
  using News = NetworkStartup::News;
  if (news == News::all_ready) return tell({.kind = Kind::ready});
  if (news == News::operational) return tell({.kind = Kind::operational});
  if (slave == nullptr) return;
  BootResult why = slave->status.result;
  if (news == News::late) {
    const bool silent = !slave->boot || !slave->boot->found();
    why.status = silent ? manager::BootStatus::b : manager::BootStatus::booted;
    why.detail = "its boot-up was not done in the boot time (1F89h)";
  }
  tell({.kind = Kind::halted, .node = slave->what.node, .status = why.status, .detail = why.detail});
}

Result<void> NetworkBoot::operate() {
  const auto begun = startup_.operate();
  if (!begun) return fail(begun.error());
  own_ = NmtState::operational;
  go(*begun);
  return {};
}

void NetworkBoot::own_state(NmtState state) noexcept {
  own_ = state;
  go(startup_.own_state(state));
}

void NetworkBoot::apply(NmtCommand command) noexcept {
  if (command == NmtCommand::start) own_ = NmtState::operational;
  bus_->apply(command);
}

void NetworkBoot::go(NetworkStartup::Go what) noexcept {
  using Go = NetworkStartup::Go;
  if (what == Go::nothing) return;
  // In a network that was taken over, only slaves that are not operational are started.
  if (what == Go::all && !plan_.taken_over) return command(NmtCommand::start, NmtTarget::all());
  for (const auto& slave : boots_.all()) {
    if (slave->waits_for_start() && startup_.starts(*slave)) command(NmtCommand::start, slave->what.node);
  }
}

// ---- commands -------------------------------------------------------------------------------------------------------

void NetworkBoot::command(NmtCommand command, NmtTarget target, bool with_master) {
  // Done later, in a task: the caller may be in the middle of a write to the dictionary, which a reset reloads.
  if (target.node != 0 && plan_.own == NodeId(target.node)) return commands_.spawn(apply_to(*bus_, command));
  commands_.spawn(send(command, target, with_master));
}

rt::Task<void> NetworkBoot::send(NmtCommand command, NmtTarget target, bool with_master) {
  auto* const known = target.node == 0 ? nullptr : boots_.find(NodeId(target.node));
  rt::Task<Result<rt::Time>> sending;
  if (known != nullptr) {
    sending = known->what.target->command(command);  // by its own target: it may be beneath a gateway
  } else {
    sending = bus_->command(command, target);
  }
  const auto sent = co_await sending;
  const NodeId whom = target.node == 0 ? NodeId() : NodeId(target.node);
  if (!sent) tell({.kind = Kind::not_sent, .node = whom, .detail = describe(sent.error())});
  const bool of_startup = startup_.is(Phase::booting) && beginning_.running() > 0 && resets(command);
  if (sent && !of_startup) {
    for (const auto& slave : boots_.all()) {
      if (target.includes(slave->what.node)) commanded(*slave, command, *sent);
    }
  }
  if (with_master) bus_->apply(command);
}

// The NMT command was sent to this slave.
void NetworkBoot::commanded(Slave& slave, NmtCommand command, rt::Time at) noexcept {
  auto& status = slave.status;
  if (resets(command)) {
    status.state.reset();
    if (status.phase == SlavePhase::awaited || startup_.is(Phase::stopped) || startup_.is(Phase::off)) return;
    return boots_.boot(slave, at);
  }
  if (!status.supervised) status.state = co::state_after(command);
  if (!status.ready()) return;
  const auto before =
      std::exchange(status.phase, command == NmtCommand::start ? SlavePhase::started : SlavePhase::ready);
  if (before != SlavePhase::started && command == NmtCommand::start) started(slave, false);
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

}  // namespace berth::network
