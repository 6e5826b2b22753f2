#include "berth/sim/frame_faults.hpp"

namespace berth::sim {

bool FrameFaults::victim(const Controller& node) const noexcept {
  return std::ranges::any_of(
      flaws_, [&](const Flaw& flaw) { return std::ranges::find(flaw.victims, &node) != flaw.victims.end(); });
}

bool FrameFaults::seen(const Controller& node, bool sends, std::int64_t bit, bool dominant) const noexcept {
  for (const auto& flaw : flaws_) {
    const bool struck = flaw.victims.empty() ? !(flaw.spare_senders && sends)
                                             : std::ranges::find(flaw.victims, &node) != flaw.victims.end();
    if (!struck || bit < flaw.first || bit > flaw.last) continue;
    dominant = flaw.kind == Fault::Kind::flip ? !dominant : flaw.kind == Fault::Kind::dominant;
  }
  return dominant;
}

}  // namespace berth::sim
