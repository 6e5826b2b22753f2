/// The faults for frames of one bus, planned or drawn at random. It decides which frame is affected; the segment
/// implements the effect on the nodes.
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

  /// Plans a fault; the returned number, from 1 upwards, is for `cancel`.
  unsigned add(Fault fault);
  /// False: it has affected its last frame, was already cancelled, or never existed.
  bool cancel(unsigned fault) noexcept;
  /// Replaces the former random faults.
  void draw_from(const RandomFaults& faults) noexcept { random_ = faults; }
  /// The node is destroyed: removes it from the victims.
  void forget(const Controller& node) noexcept;

  /// False: no frame can be affected, and the functions below need not be called.
  [[nodiscard]] bool any() const noexcept {
    return !planned_.empty() || random_.disturbed_per_million != 0 || random_.overrun_per_million != 0;
  }
  /// Frames begun on the bus so far: the next one's `FrameStart::number`.
  [[nodiscard]] std::uint64_t started() const noexcept { return started_; }
  /// Call once for each frame begun, after `strike` and the draws for it.
  void count_start() noexcept { ++started_; }

  /// Calls `struck(const Fault&)` for each planned fault that affects this frame, in the order of `add`. A fault is
  /// forgotten after its last frame.
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
  /// Draws for a frame of `length` bits with the participating nodes `present`, at least one: `draw_flip` first.
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
