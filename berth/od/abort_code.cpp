#include "berth/od/abort_code.hpp"

#include <algorithm>
#include <array>

namespace berth::od {
namespace {

constexpr std::array all_codes{
    AbortCode::toggle_bit,
    AbortCode::timeout,
    AbortCode::command_specifier,
    AbortCode::block_size,
    AbortCode::sequence_number,
    AbortCode::crc,
    AbortCode::out_of_memory,
    AbortCode::unsupported_access,
    AbortCode::write_only,
    AbortCode::read_only,
    AbortCode::no_object,
    AbortCode::not_mappable,
    AbortCode::pdo_length,
    AbortCode::parameter_incompatible,
    AbortCode::internal_incompatible,
    AbortCode::hardware,
    AbortCode::length_mismatch,
    AbortCode::length_too_high,
    AbortCode::length_too_low,
    AbortCode::no_sub_index,
    AbortCode::invalid_value,
    AbortCode::value_too_high,
    AbortCode::value_too_low,
    AbortCode::max_less_than_min,
    AbortCode::no_sdo_connection,
    AbortCode::general,
    AbortCode::not_stored,
    AbortCode::local_control,
    AbortCode::device_state,
    AbortCode::no_dictionary,
    AbortCode::no_data,
};
static_assert(std::ranges::is_sorted(all_codes));

}  // namespace

const char* text(AbortCode code) noexcept {
  switch (code) {
    case AbortCode::none: return "no abort";
    case AbortCode::toggle_bit: return "toggle bit not alternated";
    case AbortCode::timeout: return "SDO protocol timed out";
    case AbortCode::command_specifier: return "command specifier not valid or unknown";
    case AbortCode::block_size: return "invalid block size";
    case AbortCode::sequence_number: return "invalid sequence number";
    case AbortCode::crc: return "CRC error";
    case AbortCode::out_of_memory: return "out of memory";
    case AbortCode::unsupported_access: return "unsupported access to an object";
    case AbortCode::write_only: return "attempt to read a write-only object";
    case AbortCode::read_only: return "attempt to write a read-only object";
    case AbortCode::no_object: return "object does not exist";
    case AbortCode::not_mappable: return "object cannot be mapped to the PDO";
    case AbortCode::pdo_length: return "number and length of the mapped objects exceed the PDO length";
    case AbortCode::parameter_incompatible: return "general parameter incompatibility";
    case AbortCode::internal_incompatible: return "general internal incompatibility in the device";
    case AbortCode::hardware: return "access failed due to a hardware error";
    case AbortCode::length_mismatch: return "data type does not match, length does not match";
    case AbortCode::length_too_high: return "data type does not match, length too high";
    case AbortCode::length_too_low: return "data type does not match, length too low";
    case AbortCode::no_sub_index: return "sub-index does not exist";
    case AbortCode::invalid_value: return "invalid value for the parameter";
    case AbortCode::value_too_high: return "value too high";
    case AbortCode::value_too_low: return "value too low";
    case AbortCode::max_less_than_min: return "maximum value is less than minimum value";
    case AbortCode::no_sdo_connection: return "resource not available: SDO connection";
    case AbortCode::general: return "general error";
    case AbortCode::not_stored: return "data cannot be transferred or stored to the application";
    case AbortCode::local_control: return "data cannot be transferred or stored because of local control";
    case AbortCode::device_state: return "data cannot be transferred or stored because of the present device state";
    case AbortCode::no_dictionary: return "no object dictionary is present";
    case AbortCode::no_data: return "no data available";
    case AbortCode::pending: return "the answer comes later";
  }
  return "unknown abort code";
}

bool known(AbortCode code) noexcept { return std::ranges::binary_search(all_codes, code); }

std::span<const AbortCode> all_abort_codes() noexcept { return all_codes; }

Error to_error(AbortCode code, ObjectRef object, std::uint8_t node) noexcept {
  return Error{.code = Errc::aborted,
               .node = node,
               .sub = object.sub,
               .index = object.index,
               .detail = static_cast<std::uint32_t>(code),
               .text = text(code)};
}

}  // namespace berth::od
