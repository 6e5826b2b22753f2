/// The faults that are to strike frames of one bus: those planned one by one and those drawn at random. It decides
/// which frame is struck; what that does to the nodes is the segment's.
#pragma once

#include <cstdint>
#include <optional>
#include <span>
#include <vector>

#include "berth/base/random.hpp"
#include "berth/sim/fault.hpp"

namespace berth::sim {

class FaultPlan {
 public:
  /// A random disturbance of one frame: bit `bit` is flipped for `victims`.
  struct Flip {
    int bit = 0;
    std::vector<const Controller*> victims;
  };

  explicit FaultPlan(Random dice) noexcept : dice_(dice) {}

  /// Plans a fault; the number, from 1 upwards, is for `cancel`.
  unsigned add(Fault fault);
  /// False: it has struck its last frame, was cancelled before, or never was.
  bool cancel(unsigned fault) noexcept;
  /// Replaces what was drawn from before.
  void draw_from(const RandomFaults& faults) noexcept { random_ = faults; }
  /// The node goes: it is taken out of the victims.
  void forget(const Controller& node) noexcept;

  /// False: no frame can be struck, and nothing below need be asked.
  [[nodiscard]] bool any() const noexcept {
    return !planned_.empty() || random_.disturbed_per_million != 0 || random_.overrun_per_million != 0;
  }
  /// Frames begun on the bus so far: the next one's `FrameStart::number`.
  [[nodiscard]] std::uint64_t started() const noexcept { return started_; }
  /// To be called once for each frame begun, after `strike` and the draws for it.
  void count_start() noexcept { ++started_; }

  /// Calls `struck(const Fault&)` for each planned fault that strikes this frame, in the order of `add`. A fault that
  /// has struck as often as it was to is forgotten.
  template <class Struck>
  void strike(const FrameStart& start, const Struck& struck) {
    for (auto it = planned_.begin(); it != planned_.end();) {
      if (!fits(*it, start)) {
        ++it;
        continue;
      }
      struck(it->fault);
      const bool spent = it->fault.trigger.times != 0 && ++it->struck >= it->fault.trigger.times;
      it = spent ? planned_.erase(it) : it + 1;
    }
  }
  /// Draws for a frame of `length` bits that the nodes of `present`, at least one, take part in: `draw_flip` first.
  [[nodiscard]] std::optional<Flip> draw_flip(std::span<const Controller* const> present, int length);
  /// The node that loses the frame; null: none.
  [[nodiscard]] const Controller* draw_overrun(std::span<const Controller* const> present) noexcept;

 private:
  struct Planned {
    unsigned number;
    Fault fault;
    std::uint32_t skipped = 0;
    std::uint32_t struck = 0;
  };
  static bool fits(Planned& planned, const FrameStart& start);

  std::vector<Planned> planned_;
  unsigned next_ = 1;
  RandomFaults random_{};
  Random dice_;
  std::uint64_t started_ = 0;
};

}  // namespace berth::sim
