#include "berth/operate/configuration_fit.hpp"

#include <fmt/format.h>

#include "berth/design/machine.hpp"
#include "berth/places/plan.hpp"

namespace berth::operate {

std::string not_for(const places::SlotSpec& slot, const manager::Configuration& configuration) {
  if (!design::is_for(slot, configuration.type)) {
    return fmt::format("it is for devices of type {}, and the slot is for {}; write a configuration of the slot's type",
                       to_string(configuration.type), to_string(slot.type));
  }
  const bool other =
      slot.device_type != 0 && configuration.device_type != 0 && slot.device_type != configuration.device_type;
  if (other) {
    return fmt::format(
        "its device type 1000h is {:08X}h, and device_type of the slot is {:08X}h; write a "
        "configuration of the slot's device type",
        configuration.device_type, slot.device_type);
  }
  Identity device(slot.type.vendor, slot.type.product, configuration.revision, 0);
  constexpr std::uint8_t serial = 1U << 3U;
  device.unknown = serial;
  if (configuration.revision != 0 && !places::fits(slot, device)) {
    return fmt::format(
        "it is for revision {:08X}h, which the slot's revision excludes; write a configuration of the "
        "slot's revision",
        configuration.revision);
  }
  return {};
}

}  // namespace berth::operate
