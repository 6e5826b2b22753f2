/// How slow and how forgetful a simulated device is.
#pragma once

#include <cstdint>

#include "berth/rt/executor.hpp"

namespace berth::device {

/// All durations are in the device's own clock, which is `drift_ppm` fast (+) or slow (-) of the world's.
struct Timing {
  rt::Duration response_min{0};           ///< from the end of a received frame to the device's reaction: uniform
  rt::Duration response_max{0};           ///< in [min, max]; both 0: at once
  std::uint32_t outlier_per_million = 0;  ///< so many frames in a million take `outlier` instead
  rt::Duration outlier{0};
  std::uint32_t repeat_per_million = 0;  ///< so many frames in a million are sent twice
  std::uint16_t rx_depth = 16;           ///< frames received but not processed; 1 = single-slot, a second one is lost
  rt::Duration boot{0};                  ///< power-on to boot-up message (or to LSS, when unconfigured)
  rt::Duration reset{0};                 ///< NMT reset node or reset communication to boot-up message
  bool deaf_while_storing = false;       ///< receives nothing while non-volatile memory is written
  /// As CANopenNode's example programs do: until 1010h was saved once and the device was reset after it, it reports a
  /// memory error (EMCY 5000h, 1001h bit 0), and does not become operational.
  bool needs_first_save = false;
  bool power_cycle_after_store = false;  ///< a configured node-ID counts only after power was off
  rt::Duration heartbeat_sent{0};        ///< sends heartbeats with this period, whatever 1017h says; 0: as 1017h says
  std::int32_t drift_ppm = 0;

  /// Converts a duration of the device's clock to the world's.
  [[nodiscard]] constexpr rt::Duration in_world(rt::Duration own) const noexcept {
    if (drift_ppm == 0) return own;
    const std::int64_t scale = 1'000'000 + drift_ppm;
    return rt::Duration(own.count() / scale * 1'000'000 + own.count() % scale * 1'000'000 / scale);
  }
};

}  // namespace berth::device
