/// What goes wrong for the frame under way on one segment: which bits which nodes see wrong, which nodes lose it, and
/// whether it is an FD frame that is destroyed. Internal to `sim`; `FaultPlan` says what strikes, this is what it does.
#pragma once

#include <algorithm>
#include <cstdint>
#include <vector>

#include "berth/sim/fault.hpp"

namespace berth::sim {

class FrameFaults {
 public:
  /// Bits `first` to `last` on the wire, from the start of the frame.
  struct Flaw {
    Fault::Kind kind;  ///< flip, dominant or recessive
    int first;
    int last;
    std::vector<const Controller*> victims;  ///< empty: every node
    bool spare_senders;                      ///< with empty `victims`
  };

  /// Another frame begins.
  void clear() noexcept {
    losers_.clear();
    flaws_.clear();
    doomed_ = false;
  }
  /// The segment is quiet again: no node sees a wrong bit any more.
  void end_flaws() noexcept { flaws_.clear(); }

  void disturb(Flaw flaw) { flaws_.push_back(std::move(flaw)); }
  void lose(const Controller& node) { losers_.push_back(&node); }
  void doom() noexcept { doomed_ = true; }

  [[nodiscard]] bool disturbed() const noexcept { return !flaws_.empty(); }
  /// An FD frame that a fault strikes.
  [[nodiscard]] bool doomed() const noexcept { return doomed_; }
  [[nodiscard]] bool loses(const Controller& node) const noexcept {
    return !losers_.empty() && std::ranges::find(losers_, &node) != losers_.end();
  }
  [[nodiscard]] const std::vector<Flaw>& flaws() const noexcept { return flaws_; }
  /// Does the node see other bits than the nodes around it?
  [[nodiscard]] bool victim(const Controller& node) const noexcept;
  /// What the node sees of bit `bit` when this is on the wire; `sends`: it is a sender of the frame.
  [[nodiscard]] bool seen(const Controller& node, bool sends, std::int64_t bit, bool dominant) const noexcept;

 private:
  std::vector<const Controller*> losers_;  // by Fault::Kind::overrun
  std::vector<Flaw> flaws_;
  bool doomed_ = false;
};

}  // namespace berth::sim
