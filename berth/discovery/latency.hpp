/// How long devices take to answer, learnt from what was heard.
///
/// A sample is the time from a request's confirmation to the end of the answer, less the answer's own time on the wire:
/// when the answer stood in its sender's queue at the latest. `response` is an upper bound of that for the devices of
/// this bus as far as the last samples tell: the largest of them, and a margin that shrinks with their number. Up to
/// one sample in 32 that is far beyond the others does not count: to wait for it at every silence would cost more than
/// to go wrong once.
#pragma once

#include <array>
#include <cstddef>

#include "berth/rt/executor.hpp"

namespace berth::discovery {

class Latency {
 public:
  /// Negative samples count as 0.
  void note(rt::Duration sample) noexcept;
  /// Within [`shortest`, `longest`]; `longest` without samples; of one or two a
  /// multiple, as nothing is known of their spread.
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
