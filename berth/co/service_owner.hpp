/// What the services of a device (PDO, SYNC, ...) need from the device.
#pragma once

#include <array>
#include <cstdint>

#include "berth/rt/executor.hpp"

namespace berth::co {

/// Implemented by the owner of the emergencies and the clock: `device::Device`, or a test.
class ServiceOwner {
 public:
  /// An error began: report it as EMCY. Called once until `clear_error` with the same code; only 8150h (CAN-ID
  /// collision) is never cleared and may be reported again.
  virtual void raise_error(std::uint16_t code, std::uint8_t register_bits,
                           const std::array<std::uint8_t, 5>& info) noexcept = 0;
  /// The error is gone. Only after `raise_error`.
  virtual void clear_error(std::uint16_t code) noexcept = 0;
  /// Converts a duration of the device's own clock, which drifts in a simulated device, to the executor's clock.
  [[nodiscard]] virtual rt::Duration in_world(rt::Duration own) const noexcept { return own; }

 protected:
  ~ServiceOwner() = default;
};

}  // namespace berth::co
