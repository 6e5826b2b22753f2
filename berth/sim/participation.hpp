/// When a node may take part in a bus's traffic, and when it may begin a frame: the recessive bits that it must see
/// first (after power-on, a restart, bus-off), and suspend transmission. Internal to `sim`.
#pragma once

#include <algorithm>
#include <cstdint>
#include <utility>

#include "berth/rt/executor.hpp"

namespace berth::sim {

class Participation {
 public:
  /// It has seen the required bits.
  [[nodiscard]] bool takes_part() const noexcept { return runs_left_ == 0; }
  /// It counts recessive bits.
  [[nodiscard]] bool integrating() const noexcept { return runs_left_ != 0 && runs_left_ != for_ever; }
  /// It does not even count: bus-off until a restart.
  [[nodiscard]] bool excluded() const noexcept { return runs_left_ == for_ever; }

  /// From `since` on it must see so many runs of 11 recessive bits; 0: it takes part at once.
  void integrate(std::uint32_t runs, rt::Time since) noexcept {
    runs_left_ = runs;
    recessive_since_ = since;
  }
  void take_part() noexcept { runs_left_ = 0; }
  void exclude() noexcept { runs_left_ = for_ever; }

  // While `integrating`
  [[nodiscard]] std::uint32_t runs_left() const noexcept { return runs_left_; }
  /// The bits up to `until`, of the length `bit`, were recessive; true if that was the last run.
  [[nodiscard]] bool count(rt::Time until, rt::Duration bit) noexcept {
    const auto run = 11 * bit;
    const auto seen = std::max<std::int64_t>(0, (until - recessive_since_) / run);
    runs_left_ -= static_cast<std::uint32_t>(std::min<std::int64_t>(seen, runs_left_));
    recessive_since_ += seen * run;
    return runs_left_ == 0;
  }
  /// When the last run ends if no bit is dominant until then.
  [[nodiscard]] rt::Time due(rt::Duration bit) const noexcept { return recessive_since_ + runs_left_ * 11 * bit; }
  /// A bit before `at` was dominant.
  void dominant_until(rt::Time at) noexcept { recessive_since_ = std::max(recessive_since_, at); }
  /// Recessive bits of the unfinished run at `at`: 0 to 10.
  [[nodiscard]] unsigned bits_of_run(rt::Time at, rt::Duration bit) const noexcept {
    return static_cast<unsigned>(std::max<std::int64_t>(0, (at - recessive_since_) / bit) % 11);
  }

  /// Suspend transmission: the node begins no frame before `until`.
  void suspend(rt::Time until) noexcept {
    suspends_ = true;
    not_before_ = until;
  }
  /// True if it was suspended.
  bool end_suspension() noexcept { return std::exchange(suspends_, false); }
  [[nodiscard]] bool suspends() const noexcept { return suspends_; }
  [[nodiscard]] bool suspended(rt::Time at) const noexcept { return suspends_ && not_before_ > at; }
  /// While `suspends`.
  [[nodiscard]] rt::Time not_before() const noexcept { return not_before_; }

 private:
  static constexpr std::uint32_t for_ever = 0xFFFF'FFFFU;
  std::uint32_t runs_left_ = 0;
  bool suspends_ = false;
  rt::Time recessive_since_{};
  rt::Time not_before_{};
};

}  // namespace berth::sim
