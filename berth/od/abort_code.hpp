/// SDO abort codes (CiA 301 §7.2.4.3.17): the object dictionary refuses an access with one, and the SDO server sends
/// it.
#pragma once

#include <cstdint>
#include <span>
#include <tl/expected.hpp>

#include "berth/base/ids.hpp"
#include "berth/base/result.hpp"

namespace berth::od {

/// Every abort code of CiA 301. `none` (0) is no abort: the access is granted. Other values sent by a peer use the same
/// type and are named "unknown abort code".
enum class AbortCode : std::uint32_t {
  none = 0,
  toggle_bit = 0x0503'0000,
  timeout = 0x0504'0000,
  command_specifier = 0x0504'0001,
  block_size = 0x0504'0002,
  sequence_number = 0x0504'0003,
  crc = 0x0504'0004,
  out_of_memory = 0x0504'0005,
  unsupported_access = 0x0601'0000,
  write_only = 0x0601'0001,
  read_only = 0x0601'0002,
  no_object = 0x0602'0000,
  not_mappable = 0x0604'0041,
  pdo_length = 0x0604'0042,
  parameter_incompatible = 0x0604'0043,
  internal_incompatible = 0x0604'0047,
  hardware = 0x0606'0000,
  length_mismatch = 0x0607'0010,
  length_too_high = 0x0607'0012,
  length_too_low = 0x0607'0013,
  no_sub_index = 0x0609'0011,
  invalid_value = 0x0609'0030,
  value_too_high = 0x0609'0031,
  value_too_low = 0x0609'0032,
  max_less_than_min = 0x0609'0036,
  no_sdo_connection = 0x060A'0023,
  general = 0x0800'0000,
  not_stored = 0x0800'0020,
  local_control = 0x0800'0021,
  device_state = 0x0800'0022,
  no_dictionary = 0x0800'0023,
  no_data = 0x0800'0024,
  /// Not an abort code and never sent: the write was accepted, and its answer comes later (`Hook::writing`).
  pending = 0xFFFF'FFFF,
};

/// Text for users: "value too low", "object does not exist". Static, never null.
[[nodiscard]] const char* text(AbortCode code) noexcept;
/// True for the codes of the table above (not for `none` and `pending`).
[[nodiscard]] bool known(AbortCode code) noexcept;
/// All codes of the table, ascending.
[[nodiscard]] std::span<const AbortCode> all_abort_codes() noexcept;

/// A value, or the abort code that refuses it.
template <class T>
using Answer = tl::expected<T, AbortCode>;

[[nodiscard]] inline tl::unexpected<AbortCode> refuse(AbortCode code) noexcept {
  return tl::unexpected<AbortCode>(code);
}

/// The same refusal as a `berth::Error` (Errc::aborted, detail = the code, text = `text(code)`).
[[nodiscard]] Error to_error(AbortCode code, ObjectRef object, std::uint8_t node = 0) noexcept;

}  // namespace berth::od
