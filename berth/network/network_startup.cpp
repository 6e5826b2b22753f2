#include "berth/network/network_startup.hpp"

namespace berth::network {

void NetworkStartup::begin(Plan plan) {
  plan_ = std::move(plan);
  phase_.begin(plan_.rules);
  late_.cancel();
  if (has_mandatory() && plan_.boot_time.count() > 0) late_.arm(plan_.boot_time);
}

void NetworkStartup::end() noexcept {
  phase_.end();
  late_.cancel();
}

void NetworkStartup::stop() noexcept {
  phase_.stop();
  late_.cancel();
}

const Slave* NetworkStartup::missing() const noexcept {
  const auto it = std::ranges::find_if(
      plan_.slaves, [&](const Slave* slave) { return slave->what.rules.mandatory && !owner_->is_ready(*slave); });
  return it == plan_.slaves.end() ? nullptr : *it;
}

bool NetworkStartup::has_mandatory() const noexcept {
  return std::ranges::any_of(plan_.slaves, [](const Slave* slave) { return slave->what.rules.mandatory; });
}

void NetworkStartup::halt(const Slave& slave, News why) noexcept {
  late_.cancel();
  if (phase_.halt()) owner_->heard(why, &slave);
}

void NetworkStartup::late() noexcept {
  if (const Slave* const slave = missing(); slave != nullptr) halt(*slave, News::late);
}

NetworkStartup::Go NetworkStartup::look() noexcept {
  if (phase_.is(Phase::booting)) {
    const auto failed = std::ranges::find_if(
        plan_.slaves, [&](const Slave* slave) { return slave->what.rules.mandatory && owner_->has_failed(*slave); });
    if (failed != plan_.slaves.end()) halt(**failed, News::failed);
  }
  if (missing() != nullptr) return Go::nothing;
  if (plan_.resumes && phase_.resume()) owner_->heard(News::resumed, nullptr);
  if (!phase_.all_ready()) return Go::nothing;
  late_.cancel();
  owner_->heard(News::all_ready, nullptr);
  if (!phase_.is(Phase::ready)) return Go::nothing;  // the owner, just notified, has continued the startup itself
  const bool awaits = plan_.awaits_all && !has_mandatory();
  if (!master_operational_ && phase_.operates_itself() && !awaits) make_operational();
  if (master_operational_) return go();
  return phase_.starts_all() ? Go::nothing : Go::each;
}

void NetworkStartup::make_operational() noexcept {
  master_operational_ = true;  // set before the master's device reports it, so that the report is no news
  owner_->apply(co::NmtCommand::start);
}

void NetworkStartup::all_operational() noexcept {
  if (plan_.rules.application_operates || phase_.is(Phase::stopped) || phase_.is(Phase::off)) return;
  make_operational();
  static_cast<void>(go());
}

Result<NetworkStartup::Go> NetworkStartup::operate() {
  if (phase_.is(Phase::operational)) return Go::nothing;
  if (!phase_.may_operate()) return fail(Errc::invalid, "the startup has not reached this step");
  if (const Slave* const slave = missing(); slave != nullptr) {
    return fail(
        Error{.code = Errc::invalid, .node = slave->what.node.value(), .text = "this mandatory slave is not ready"});
  }
  phase_.make_ready();
  make_operational();
  return go();
}

NetworkStartup::Go NetworkStartup::own_state(NmtState state) noexcept {
  const bool before = std::exchange(master_operational_, state == NmtState::operational);
  if (before || !master_operational_) return Go::nothing;
  return phase_.is(Phase::ready) || phase_.is(Phase::operational) ? go() : Go::nothing;
}

// Called when the master is operational and all mandatory slaves are ready.
NetworkStartup::Go NetworkStartup::go() noexcept {
  if (phase_.operate()) owner_->heard(News::operational, nullptr);
  if (phase_.application_starts()) return Go::nothing;
  return phase_.starts_all() ? Go::all : Go::each;
}

std::optional<NetworkStartup::OnError> NetworkStartup::on_error(const Slave& slave) const noexcept {
  if (phase_.is(Phase::off) || phase_.is(Phase::stopped)) return std::nullopt;
  return phase_.on_error(slave.what.rules);
}

}  // namespace berth::network
