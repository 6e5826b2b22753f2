#include "berth/device/leds.hpp"

namespace berth::device {
namespace {

using std::chrono::milliseconds;

bool flashes(int count, rt::Duration since) noexcept {
  constexpr auto step = milliseconds(200);
  const auto period = count * 2 * step + milliseconds(800);  // the last flash's own pause is part of the dark second
  const auto part = (since % period) / step;
  return part < 2 * count && part % 2 == 0;
}

Light green(const LedInputs& in) noexcept {
  if (in.lss) return Light::flickering;
  if (in.program_download) return Light::triple_flash;
  switch (in.state) {
    case NmtState::stopped: return Light::single_flash;
    case NmtState::pre_operational: return Light::blinking;
    case NmtState::operational: return Light::on;
    case NmtState::initialising: break;
  }
  return Light::off;
}

Light red(const LedInputs& in) noexcept {
  if (in.bus_off) return Light::on;
  if (in.lss) return Light::flickering;
  if (in.invalid_configuration) return Light::blinking;
  if (in.event_timer_missed) return Light::quadruple_flash;
  if (in.sync_missing) return Light::triple_flash;
  if (in.error_control_event) return Light::double_flash;
  return in.warning_limit ? Light::single_flash : Light::off;
}

bool shines(Light light, rt::Duration since) noexcept {
  switch (light) {
    case Light::off: return false;
    case Light::on: return true;
    case Light::flickering: return since / milliseconds(50) % 2 == 0;
    case Light::blinking: return since / milliseconds(200) % 2 == 0;
    case Light::single_flash: return flashes(1, since);
    case Light::double_flash: return flashes(2, since);
    case Light::triple_flash: return flashes(3, since);
    case Light::quadruple_flash: return flashes(4, since);
  }
  return false;
}

}  // namespace

Lit lit(const Leds& leds, rt::Duration since) noexcept {
  const auto red = leds.red == Light::flickering ? since + milliseconds(50) : since;
  return {shines(leds.green, since), shines(leds.red, red)};
}

Leds leds(const LedInputs& inputs) noexcept { return {green(inputs), red(inputs)}; }

}  // namespace berth::device
