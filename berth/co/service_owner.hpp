/// What the services of a device (PDO, SYNC, ...) need of the device they belong to.
#pragma once

#include <array>
#include <cstdint>

#include "berth/rt/executor.hpp"

namespace berth::co {

/// Implemented by what keeps the emergencies and the clock: `device::Device`, or a test.
class ServiceOwner {
 public:
  /// An error began: to be reported as EMCY. Told once until `clear_error` with the same code; only 8150h (CAN-ID
  /// collision) is never cleared and may be told again.
  virtual void raise_error(std::uint16_t code, std::uint8_t register_bits,
                           const std::array<std::uint8_t, 5>& info) noexcept = 0;
  /// The error is gone. Only after `raise_error`.
  virtual void clear_error(std::uint16_t code) noexcept = 0;
  /// How long the executor's clock runs while the device's own clock runs for `own`: a simulated device's drifts.
  [[nodiscard]] virtual rt::Duration in_world(rt::Duration own) const noexcept { return own; }

 protected:
  ~ServiceOwner() = default;
};

}  // namespace berth::co
