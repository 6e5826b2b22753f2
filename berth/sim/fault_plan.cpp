#include "berth/sim/fault_plan.hpp"

namespace berth::sim {

unsigned FaultPlan::add(Fault fault) {
  planned_.push_back({next_, std::move(fault)});
  return next_++;
}

bool FaultPlan::cancel(unsigned fault) noexcept {
  return std::erase_if(planned_, [&](const Planned& planned) { return planned.number == fault; }) > 0;
}

void FaultPlan::forget(const Controller& node) noexcept {
  for (auto& planned : planned_) std::erase(planned.fault.victims, &node);
}

bool FaultPlan::fits(Planned& planned, const FrameStart& start) {
  const Trigger& trigger = planned.fault.trigger;
  const bool fits = (!trigger.frame || *trigger.frame == start.number) &&
                    (!trigger.not_before || *trigger.not_before <= start.at) && (!trigger.when || trigger.when(start));
  return fits && planned.skipped++ >= trigger.skip;
}

std::optional<FaultPlan::Flip> FaultPlan::draw_flip(std::span<const Controller* const> present, int length) {
  if (!dice_.chance(random_.disturbed_per_million)) return std::nullopt;
  Flip flip;
  for (const Controller* node : present) {
    if (dice_.chance(500'000)) flip.victims.push_back(node);
  }
  if (flip.victims.empty()) flip.victims.push_back(present[dice_.below(present.size())]);
  flip.bit = static_cast<int>(dice_.below(static_cast<std::uint64_t>(length)));
  return flip;
}

const Controller* FaultPlan::draw_overrun(std::span<const Controller* const> present) noexcept {
  return dice_.chance(random_.overrun_per_million) ? present[dice_.below(present.size())] : nullptr;
}

}  // namespace berth::sim
