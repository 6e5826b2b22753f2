/// How long a client waits before it connects again: after each failure up to twice as long as before, with chance, so
/// that thousands of machines do not come back to a broker in the same instant.
#pragma once

#include <algorithm>
#include <chrono>

#include "berth/base/random.hpp"

namespace berth::mqtt {

using Milliseconds = std::chrono::milliseconds;

struct Pauses {
  Milliseconds first{1'000};     ///< the longest pause before the second attempt
  Milliseconds longest{60'000};  ///< the pauses grow up to this
  /// A connection that lasted this long was good: the next pause is the first one again. A shorter one counts as a
  /// failure, so that two clients with one client-ID do not take the session from each other every second.
  Milliseconds good_after{10'000};
};

class Backoff {
 public:
  Backoff(const Pauses& pauses, Random random) noexcept : pauses_(pauses), random_(random), next_(pauses.first) {}

  /// The pause before the next attempt: half of the present bound up to all of it. Then the bound doubles.
  [[nodiscard]] Milliseconds next() noexcept {
    const auto pause = within(next_);
    next_ = std::min(next_ * 2, pauses_.longest);
    return pause;
  }
  /// The longest pause at once: another attempt would only do harm.
  [[nodiscard]] Milliseconds longest() noexcept {
    next_ = pauses_.longest;
    return within(next_);
  }
  /// A connection ended that had lasted `lasted`.
  void after(Milliseconds lasted) noexcept {
    if (lasted >= pauses_.good_after) next_ = pauses_.first;
  }

 private:
  [[nodiscard]] Milliseconds within(Milliseconds bound) noexcept {
    return Milliseconds(random_.between((bound.count() + 1) / 2, bound.count()));
  }

  Pauses pauses_;
  Random random_;
  Milliseconds next_;  // the present bound
};

}  // namespace berth::mqtt
