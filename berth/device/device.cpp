#include "berth/device/device.hpp"

#include <utility>

namespace berth::device {
namespace {

constexpr unsigned warning_limit = 96;

}  // namespace

Device::Device(can::Dispatcher& dispatcher, std::shared_ptr<const od::Description> description, NvMemory* memory,
               Options options, TimedPort* host, const Timing& timing, const ProgramOptions& programs)
    : options_(std::move(options)),
      values_(std::move(description)),
      life_({&dispatcher, memory, host, timing, programs}, options_, values_, told_) {}

void Device::set_blank(NodeId id, std::uint32_t bit_rate) noexcept {
  options_.node_id = id;
  options_.bit_rate = bit_rate;
}

const Programs* Device::programs() const noexcept {
  const auto& programming = life_.parts().programming;
  return programming ? &std::as_const(*programming).programs() : nullptr;
}

LedInputs Device::led_inputs() const noexcept {
  const auto& parts = life_.parts();
  const auto status = life_.status();
  return {.state = state(),
          .lss = powered() && !booting() && parts.lss.configures(),
          .program_download = programs() != nullptr && programs()->downloading(),
          .bus_off = status.bus_off,
          .warning_limit = status.tec >= warning_limit || status.rec >= warning_limit,
          .error_control_event = parts.errors.active(co::emcy_code::life_guard_or_heartbeat),
          .sync_missing = parts.services.sync_missing(),
          .event_timer_missed = parts.errors.active(co::emcy_code::rpdo_timeout)};
}

std::size_t Device::memory() const noexcept {
  return sizeof(Device) - sizeof(od::Values) + values_.memory() + options_.name.capacity() +
         options_.presets.capacity() * sizeof(Preset) + life_.parts().memory();
}

}  // namespace berth::device
