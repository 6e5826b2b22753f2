/// The two indicators of a CANopen device (CiA 303-3; docs/protocols/cia301.md §Indicators): which are lit, by the
/// device's state and the time since its power-on. A pure function: no timer, no state.
#pragma once

#include "berth/base/ids.hpp"
#include "berth/rt/executor.hpp"

namespace berth::device {

/// How an indicator lights. Flickering 50 ms on, 50 ms off; blinking 200 ms on, 200 ms off; n flashes of 200 ms with
/// 200 ms between them, then 1 s dark.
enum class Light : std::uint8_t {
  off,
  on,
  flickering,
  blinking,
  single_flash,
  double_flash,
  triple_flash,
  quadruple_flash
};

/// The state of both indicators.
struct Leds {
  Light green = Light::off;  ///< run: the NMT state
  Light red = Light::off;    ///< error
  friend bool operator==(const Leds&, const Leds&) noexcept = default;
};

struct Lit {
  bool green = false;
  bool red = false;
  friend bool operator==(const Lit&, const Lit&) noexcept = default;
};
/// Whether each is lit at this time. If both flicker, they do so in turn.
[[nodiscard]] Lit lit(const Leds& leds, rt::Duration since_power_on) noexcept;

/// Input of `leds`. Of several errors it shows the first of: bus-off, LSS, invalid configuration, event timer, SYNC,
/// error control, warning limit (more flashes before fewer).
struct LedInputs {
  NmtState state = NmtState::initialising;
  bool lss = false;               ///< LSS configuration state; without a node-ID and without it, all is dark
  bool program_download = false;  ///< runs
  bool bus_off = false;
  bool warning_limit = false;        ///< an error counter reached 96
  bool error_control_event = false;  ///< heartbeat or life guarding lost
  bool sync_missing = false;
  bool event_timer_missed = false;  ///< an RPDO did not come in time
  bool invalid_configuration = false;
};
[[nodiscard]] Leds leds(const LedInputs& inputs) noexcept;

}  // namespace berth::device
