/// Decides whether quick questions pay. Internal to `discovery`.
///
/// A quick question does not wait for the slowest possible answer. If that answer comes, it counts for the next
/// question and leads the walk the wrong way. How often this happens depends on how many devices answer and how often
/// one is late; so it is counted.
#pragma once

#include <algorithm>

#include "berth/rt/executor.hpp"

namespace berth::discovery {

/// Counts quick attempts, and those that found a device.
class Haste {
 public:
  [[nodiscard]] bool pays() const noexcept { return attempts_ <= 2 * good_ + 2; }
  void note(bool found) noexcept {
    ++attempts_;
    if (found) ++good_;
  }

 private:
  unsigned attempts_ = 0;
  unsigned good_ = 0;
};

/// The window of a patient question: the bound, until enough questions were answered to know the slowest answer.
class Patience {
 public:
  [[nodiscard]] rt::Duration response(rt::Duration shortest, rt::Duration bound) const noexcept {
    return answered_ < enough ? bound : std::clamp(slowest_ * 3 / 2, std::min(shortest, bound), bound);
  }
  /// The time that an answer to a patient question took.
  void note(rt::Duration sample) noexcept {
    ++answered_;
    slowest_ = std::max(slowest_, sample);
  }
  /// The learnt time was too short: learns the slowest answer anew.
  void renew() noexcept { answered_ = 0; }

 private:
  static constexpr unsigned enough = 64;  // a device that is late once in twenty answers was late at least once among
                                          // them
  unsigned answered_ = 0;
  rt::Duration slowest_{0};
};

}  // namespace berth::discovery
