/// The abort codes that a conformance check accepts when a device refuses an access (CiA 301 §7.2.4.3.17).
#pragma once

#include <algorithm>
#include <array>

#include "berth/od/abort_code.hpp"

namespace berth::doctor {

/// Abort codes, any of which is accepted: several where CiA 301 leaves the choice open and stacks differ.
struct Codes {
  std::array<od::AbortCode, 4> any{};
  [[nodiscard]] bool has(od::AbortCode code) const noexcept {
    return code != od::AbortCode::none && std::ranges::find(any, code) != any.end();
  }
};
namespace codes {
using od::AbortCode;
inline constexpr Codes no_object{{AbortCode::no_object}};
inline constexpr Codes no_sub{{AbortCode::no_sub_index}};
inline constexpr Codes write_only{{AbortCode::write_only}};
inline constexpr Codes read_only{{AbortCode::read_only}};
inline constexpr Codes unknown_command{{AbortCode::command_specifier}};
inline constexpr Codes toggle{{AbortCode::toggle_bit}};
inline constexpr Codes block_size{{AbortCode::block_size}};
inline constexpr Codes too_long{{AbortCode::length_too_high, AbortCode::length_mismatch}};
inline constexpr Codes too_short{{AbortCode::length_too_low, AbortCode::length_mismatch}};
inline constexpr Codes too_high{{AbortCode::value_too_high, AbortCode::invalid_value}};
inline constexpr Codes too_low{{AbortCode::value_too_low, AbortCode::invalid_value}};
inline constexpr Codes bad_value{{AbortCode::invalid_value, AbortCode::value_too_high, AbortCode::value_too_low}};
inline constexpr Codes bad_cob_id{{AbortCode::invalid_value}};
inline constexpr Codes frozen{{AbortCode::invalid_value, AbortCode::device_state}};
inline constexpr Codes wrong_signature{{AbortCode::not_stored}};
inline constexpr Codes no_data{{AbortCode::no_data}};
inline constexpr Codes mapping_frozen{{AbortCode::unsupported_access, AbortCode::device_state}};
inline constexpr Codes not_mappable{{AbortCode::not_mappable, AbortCode::no_object}};
inline constexpr Codes pdo_length{{AbortCode::pdo_length, AbortCode::value_too_high}};
inline constexpr Codes twice{{AbortCode::parameter_incompatible}};
inline constexpr Codes state{{AbortCode::device_state}};
}  // namespace codes

}  // namespace berth::doctor
