/// The errors of the current frame on one segment: which nodes see which bits wrong, which nodes lose it, whether it is
/// an FD frame that is destroyed, and how it ended for the first node. Internal to `sim`. `FaultPlan` decides which
/// fault occurs; this implements its effect.
#pragma once

#include <algorithm>
#include <cstdint>
#include <utility>
#include <vector>

#include "berth/rt/executor.hpp"
#include "berth/sim/fault.hpp"

namespace berth::sim {

class Bus;
class SegmentNodes;

/// From the start of a frame to the beginning of its bit `bit`. `data_bit`: bit time of an FD frame's data phase.
[[nodiscard]] rt::Duration offset_of_bit(const can::Frame& frame, int bit, rt::Duration bit_time,
                                         rt::Duration data_bit) noexcept;

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
    doomed_ = failed_ = good_ = false;
  }
  /// Gets the planned faults for the frame that begins at `start`, sent by node `sender`.
  void draw(Bus& bus, const can::Frame& frame, rt::Time start, int sender, const SegmentNodes& nodes);
  /// The segment is quiet again: no node sees wrong bits any more.
  void end_flaws() noexcept { flaws_.clear(); }

  void disturb(Flaw flaw) { flaws_.push_back(std::move(flaw)); }
  void lose(const Controller& node) { losers_.push_back(&node); }
  void doom() noexcept { doomed_ = true; }

  [[nodiscard]] bool disturbed() const noexcept { return !flaws_.empty(); }
  /// True for an FD frame that a fault affects.
  [[nodiscard]] bool doomed() const noexcept { return doomed_; }
  [[nodiscard]] bool loses(const Controller& node) const noexcept {
    return !losers_.empty() && std::ranges::find(losers_, &node) != losers_.end();
  }
  /// The frame has met an error, or has been counted as good: true only at the first call.
  [[nodiscard]] bool fail() noexcept { return !std::exchange(failed_, true); }
  [[nodiscard]] bool pass() noexcept { return !std::exchange(good_, true); }
  [[nodiscard]] const std::vector<Flaw>& flaws() const noexcept { return flaws_; }
  /// True if the node sees other bits than the nodes around it.
  [[nodiscard]] bool victim(const Controller& node) const noexcept;
  /// The node's view of bit `bit` when this is on the wire; `sends`: it is a sender of the frame.
  [[nodiscard]] bool seen(const Controller& node, bool sends, std::int64_t bit, bool dominant) const noexcept;

 private:
  std::vector<const Controller*> losers_;  // by Fault::Kind::overrun
  std::vector<Flaw> flaws_;
  bool doomed_ = false;
  bool failed_ = false;
  bool good_ = false;
};

}  // namespace berth::sim
