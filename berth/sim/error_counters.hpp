/// A controller's error counters and the state that they determine (Bosch CAN 2.0 §8; docs/protocols/can-frames.md
/// §Fault confinement).
#pragma once

#include <algorithm>
#include <cstdint>
#include <utility>

namespace berth::sim {

enum class ErrorState : std::uint8_t { active, passive, bus_off };

class ErrorCounters {
 public:
  [[nodiscard]] std::uint16_t tec() const noexcept { return tec_; }
  [[nodiscard]] std::uint16_t rec() const noexcept { return rec_; }
  [[nodiscard]] bool bus_off() const noexcept { return bus_off_; }
  [[nodiscard]] ErrorState state() const noexcept {
    if (bus_off_) return ErrorState::bus_off;
    return tec_ > 127 || rec_ > 127 ? ErrorState::passive : ErrorState::active;
  }
  [[nodiscard]] bool passive() const noexcept { return state() == ErrorState::passive; }
  /// Both are 0.
  [[nodiscard]] bool clean() const noexcept { return (tec_ | rec_) == 0; }

  void set(std::uint16_t tec, std::uint16_t rec) noexcept {
    tec_ = tec;
    rec_ = rec;
  }
  void set_bus_off(bool off) noexcept { bus_off_ = off; }
  /// True if the level (error-active, warning from 96 on, passive, bus-off) has changed since the last call.
  [[nodiscard]] bool level_changed() noexcept {
    const auto most = std::max(tec_, rec_);
    const std::uint8_t level = bus_off_ ? 3 : most > 127 ? 2 : most >= 96 ? 1 : 0;
    return std::exchange(told_, level) != level;
  }

 private:
  std::uint16_t tec_ = 0;
  std::uint16_t rec_ = 0;
  bool bus_off_ = false;
  std::uint8_t told_ = 0;
};

}  // namespace berth::sim
