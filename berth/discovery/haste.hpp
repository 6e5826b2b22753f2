/// Whether it pays to be quick. Internal to `discovery`.
///
/// A quick question does not wait for the slowest answer there may be; that answer, when it does come, is taken for one
/// to the next question, and leads the wrong way. How often that happens depends on how many devices answer, and on how
/// often one of them is late: it is counted.
#pragma once

#include <algorithm>

#include "berth/rt/executor.hpp"

namespace berth::discovery {

/// Quick attempts, and those that found a device.
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

/// How long a patient question waits: up to the bound, until so many were answered that the slowest answer is known.
class Patience {
 public:
  [[nodiscard]] rt::Duration response(rt::Duration shortest, rt::Duration bound) const noexcept {
    return answered_ < enough ? bound : std::clamp(slowest_ * 3 / 2, std::min(shortest, bound), bound);
  }
  /// The answer to a patient question came so late.
  void note(rt::Duration sample) noexcept {
    ++answered_;
    slowest_ = std::max(slowest_, sample);
  }
  /// It was not enough: the slowest answer is still to be learnt.
  void renew() noexcept { answered_ = 0; }

 private:
  static constexpr unsigned enough = 64;  // a device that is late once in twenty answers was late among them
  unsigned answered_ = 0;
  rt::Duration slowest_{0};
};

}  // namespace berth::discovery
