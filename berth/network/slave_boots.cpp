#include "berth/network/slave_boots.hpp"

#include <utility>

namespace berth::network {

void SlaveBoots::set(std::span<const NetworkSlave> slaves, rt::Duration boot_time, bool other_masters) {
  cancel();
  for (const auto& old : slaves_) supervise(*old, false);
  slaves_.clear();
  by_node_.fill(nullptr);
  for (const auto& slave : slaves) {
    slaves_.push_back(std::make_unique<Slave>(*executor_, slave));
    by_node_[slave.node.value()] = slaves_.back().get();
  }
  boot_time_ = boot_time;
  other_masters_ = other_masters;
}

void SlaveBoots::cancel() noexcept {
  due_.cancel();
  for (const auto& slave : slaves_) {
    slave->scope.cancel();
    slave->again = slave->waits = slave->starting = false;
    if (slave->status.phase == SlavePhase::booting) slave->status.phase = SlavePhase::idle;
  }
}

void SlaveBoots::release() noexcept {
  cancel();
  for (const auto& slave : slaves_) supervise(*slave, false);
}

void SlaveBoots::take_over(Slave& slave) noexcept {
  boot(slave);
  slave.may_run = true;
}

void SlaveBoots::boot(Slave& slave, rt::Time since) noexcept {
  slave.status.phase = SlavePhase::booting;
  slave.since = since;
  slave.may_run = false;
  slave.again = true;
  due_.post();
}

void SlaveBoots::booted_while_booting(Slave& slave, bool expected) noexcept {
  if (slave.again || slave.waits) return;
  // An expected boot-up comes from a reset by the slave's own boot steps, which go on. But if the slave has not
  // answered those steps yet, they would ask it again only late: so the boot begins again.
  const bool of_its_steps = expected && slave.boot && slave.boot->found();
  if (!of_its_steps) boot(slave);
}

bool SlaveBoots::supervise(Slave& slave, bool on) noexcept {
  const auto& rules = slave.what.rules;
  const bool has = rules.heartbeat.count() > 0 || rules.guard_time.count() > 0;
  slave.what.target->supervise(on ? rules : manager::SlaveRules{});
  slave.status.supervised = on && has;
  return has;
}

void SlaveBoots::begin_due() noexcept {
  for (const auto& slave : slaves_) {
    if (!slave->again) continue;
    slave->again = slave->waits = slave->starting = false;
    slave->scope.cancel();
    supervise(*slave, false);
    slave->scope.spawn(boot_awaited(*slave));
  }
}

rt::Task<void> SlaveBoots::boot_awaited(Slave& slave) {
  slave.what.source->renew(slave.what.rules);
  BootOptions options{
      .give_up = slave.what.rules.mandatory && boot_time_.count() > 0 ? executor_->now() + boot_time_ : rt::never,
      .pause = timing_.pause,
      .boot_timeout = timing_.boot_timeout};
  slave.boot.reset();
  if (slave.since != rt::never) {
    slave.waits = true;
    const bool booted = co_await slave.what.target->boots(slave.since, slave.since + timing_.boot_timeout);
    slave.waits = false;
    if (!booted && other_masters_) slave.may_run = true;
  }
  options.may_run = slave.may_run;
  co_await run(slave, options);
}

rt::Task<void> SlaveBoots::boot_found(Slave& slave, bool typed) {
  slave.status.phase = SlavePhase::booting;
  slave.what.source->renew(slave.what.rules);
  BootOptions options;
  options.identified = true;
  options.typed = typed;
  options.give_up = executor_->now();
  co_await run(slave, options);
}

rt::Task<void> SlaveBoots::run(Slave& slave, BootOptions options) {
  const manager::SlaveRules& rules = slave.what.rules;
  slave.status.rules = rules;
  slave.boot.emplace(*executor_, *slave.what.target, *slave.what.source, rules, options);
  BootResult result = co_await slave.boot->run();
  slave.status.result = std::move(result);
  const bool good = is_ready(slave.status.result.status);
  const bool started_by_another = good && other_masters_ && slave.status.state == NmtState::operational;
  const bool runs = slave.status.result.status == manager::BootStatus::l || started_by_another;
  slave.status.phase = runs ? SlavePhase::started : SlavePhase::ready;
  if (runs) slave.status.state = NmtState::operational;
  if (!good) slave.status.phase = SlavePhase::failed;
  slave.status.supervised = good && (rules.heartbeat.count() > 0 || rules.guard_time.count() > 0);
  // Decided before `ended`, after which the network may start all slaves: else this one would be started twice.
  slave.starting = good && !runs && owner_->starts(slave);
  owner_->ended(slave);
  const bool starts = slave.starting && slave.status.ready();
  if (starts) co_await start(slave);
  slave.starting = false;
}

rt::Task<void> SlaveBoots::start(Slave& slave) {
  slave.starting = true;
  const bool runs = co_await slave.what.target->runs();
  // The question may have taken a heartbeat period; meanwhile the slave may have booted again.
  if (!runs && !owner_->starts(slave)) {
    slave.starting = false;
    co_return;
  }
  if (!runs) {
    const auto sent = co_await slave.what.target->command(co::NmtCommand::start);
    slave.starting = false;
    if (!sent) {
      owner_->started(slave, fail(sent.error()));
      co_return;
    }
  }
  slave.starting = false;
  slave.status.phase = SlavePhase::started;
  if (runs || !slave.status.supervised) slave.status.state = NmtState::operational;
  owner_->started(slave, runs);
  if (!runs) co_await slave.what.target->start_sent();
}

}  // namespace berth::network
