/// Learns how long devices take to answer.
///
/// A sample is the time from a request's confirmation to the end of the answer, minus the answer's time on the wire:
/// when the answer was in its sender's queue at the latest. `response` is an upper bound for the devices of this bus,
/// estimated from the last samples: the largest one, plus a margin that shrinks with their number. Up to one sample in
/// 32 far above the others is ignored: waiting for it at every silence would cost more than one wrong turn.
#pragma once

#include <array>
#include <cstddef>

#include "berth/rt/executor.hpp"

namespace berth::discovery {

class Latency {
 public:
  /// Negative samples count as 0.
  void note(rt::Duration sample) noexcept;
  /// Within [`shortest`, `longest`]; `longest` without samples. One or two samples are multiplied, because their spread
  /// is unknown.
  [[nodiscard]] rt::Duration response(rt::Duration shortest, rt::Duration longest) const noexcept;
  [[nodiscard]] std::size_t samples() const noexcept { return count_; }
  void forget() noexcept { *this = Latency(); }

 private:
  static constexpr std::size_t kept = 64;
  std::array<rt::Duration, kept> samples_{};
  std::size_t count_ = 0;  // at most `kept`
  std::size_t next_ = 0;
};

}  // namespace berth::discovery
