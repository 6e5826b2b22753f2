/// Errors of received PDOs: one emergency for all RPDOs with the same error.
#pragma once

#include <array>
#include <cstdint>

#include "berth/co/emcy.hpp"
#include "berth/co/service_owner.hpp"

namespace berth::co {

enum class PdoFault : std::uint8_t { too_short, too_long, timeout, unavailable };
inline constexpr std::size_t pdo_faults = 4;

/// Counts the RPDOs with each fault.
class PdoFaults {
 public:
  explicit PdoFaults(ServiceOwner& owner) noexcept : owner_(&owner) {}
  /// One more RPDO has the fault. The first raises the emergency, with its `info`.
  void begin(PdoFault fault, const std::array<std::uint8_t, 5>& info) noexcept {
    const auto which = static_cast<std::size_t>(fault);
    if (counts_[which]++ == 0) owner_->raise_error(codes[which], error_register::communication, info);
  }
  /// One RPDO less has the fault. The last clears the emergency.
  void end(PdoFault fault) noexcept {
    const auto which = static_cast<std::size_t>(fault);
    if (--counts_[which] == 0) owner_->clear_error(codes[which]);
  }

 private:
  static constexpr std::array<std::uint16_t, pdo_faults> codes{emcy_code::pdo_length, emcy_code::pdo_too_long,
                                                               emcy_code::rpdo_timeout, emcy_code::mpdo_destination};
  ServiceOwner* owner_;
  std::array<std::uint16_t, pdo_faults> counts_{};
};

}  // namespace berth::co
