#include "berth/network/startup_phase.hpp"

#include <array>

namespace berth::network {

std::string_view name(StartupPhase::Phase phase) noexcept {
  constexpr std::array<std::string_view, 6> names{"off", "booting", "halted", "ready", "operational", "stopped"};
  return names[static_cast<std::size_t>(phase)];
}

bool StartupPhase::step(Phase from, Phase to) noexcept {
  if (phase_ != from) return false;
  phase_ = to;
  return true;
}

bool StartupPhase::operate() noexcept {
  if (phase_ == Phase::operational) return false;
  phase_ = Phase::operational;
  return true;
}

bool StartupPhase::starts(const manager::SlaveRules& slave, bool master_operational) const noexcept {
  const bool on_its_way = is(Phase::booting) || is(Phase::ready) || is(Phase::operational);
  if (!on_its_way || startup_.application_starts || !slave.boots) return false;
  return !startup_.starts_all_at_once || master_operational;
}

StartupPhase::OnError StartupPhase::on_error(const manager::SlaveRules& slave) const noexcept {
  if (!slave.mandatory) return OnError::one;
  if (startup_.stops_all_on_error) return OnError::stop;
  return startup_.resets_all_on_error ? OnError::reset : OnError::one;
}

}  // namespace berth::network
