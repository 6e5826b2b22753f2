/// Identifiers of the predefined connection set and COB-ID entries (CiA 301 §7.3.5; docs/protocols/cia301.md §CAN-IDs).
#pragma once

#include <cstdint>

#include "berth/base/ids.hpp"
#include "berth/can/frame.hpp"
#include "berth/od/cob_id.hpp"

namespace berth::co {

inline constexpr std::uint32_t nmt_command_id = 0x000;
inline constexpr std::uint32_t sync_id = 0x080;
inline constexpr std::uint32_t time_id = 0x100;
/// All nodes' identifiers of one kind, node-ID 1..127.
inline constexpr can::IdRange all_emcy{0x081, 0x0FF};
inline constexpr can::IdRange all_sdo_responses{0x581, 0x5FF};
inline constexpr can::IdRange all_sdo_requests{0x601, 0x67F};
inline constexpr can::IdRange all_error_control{0x701, 0x77F};

/// The node must be configured.
[[nodiscard]] constexpr std::uint32_t emcy_id(NodeId node) noexcept { return 0x080U + node.value(); }
[[nodiscard]] constexpr std::uint32_t sdo_response_id(NodeId node) noexcept { return 0x580U + node.value(); }
[[nodiscard]] constexpr std::uint32_t sdo_request_id(NodeId node) noexcept { return 0x600U + node.value(); }
[[nodiscard]] constexpr std::uint32_t error_control_id(NodeId node) noexcept { return 0x700U + node.value(); }
/// The first four PDOs of a device have identifiers of their own: `number` 1..4.
[[nodiscard]] constexpr std::uint32_t tpdo_id(unsigned number, NodeId node) noexcept {
  return 0x080U + 0x100U * number + node.value();
}
[[nodiscard]] constexpr std::uint32_t rpdo_id(unsigned number, NodeId node) noexcept {
  return 0x100U + 0x100U * number + node.value();
}

using od::CobId;
using od::restricted;
static_assert(CobId(CobId::frame_bit | 1U).key() == (can::extended_flag | 1U) && CobId::base_mask == can::base_mask &&
              CobId::extended_mask == can::extended_mask);

}  // namespace berth::co
