/// Identifiers of the predefined connection set and COB-ID entries (CiA 301 §7.3.5; docs/protocols/cia301.md §CAN-IDs).
#pragma once

#include <cstdint>

#include "berth/base/ids.hpp"
#include "berth/can/frame.hpp"

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

/// True for identifiers that no PDO, SYNC, EMCY, TIME or additional SDO may be given (CiA 301 §7.3.5): writing one is
/// refused with 0609 0030. Base format; identifiers above 7FFh are not restricted.
[[nodiscard]] constexpr bool restricted(std::uint32_t id) noexcept {
  return id <= 0x07F || (id >= 0x101 && id <= 0x180) || (id >= 0x581 && id <= 0x5FF) || (id >= 0x601 && id <= 0x67F) ||
         (id >= 0x6E0 && id <= 0x6FF) || (id >= 0x701 && id <= 0x7FF);
}

/// The UNSIGNED32 of a COB-ID object (1005h, 1012h, 1014h, 1200h, 1400h, ...).
class CobId {
 public:
  static constexpr std::uint32_t invalid_bit = 0x8000'0000U;  ///< PDO, SDO, EMCY: does not exist
  static constexpr std::uint32_t second_bit = 0x4000'0000U;   ///< meaning by object: SYNC producer, TPDO no RTR, ...
  static constexpr std::uint32_t frame_bit = 0x2000'0000U;    ///< 29-bit identifier

  constexpr CobId() noexcept = default;  ///< invalid
  constexpr explicit CobId(std::uint32_t raw) noexcept : raw_(raw) {}
  [[nodiscard]] constexpr std::uint32_t raw() const noexcept { return raw_; }
  [[nodiscard]] constexpr bool valid() const noexcept { return (raw_ & invalid_bit) == 0; }
  [[nodiscard]] constexpr bool extended() const noexcept { return (raw_ & frame_bit) != 0; }
  [[nodiscard]] constexpr std::uint32_t id() const noexcept {
    return raw_ & (extended() ? can::extended_mask : can::base_mask);
  }
  /// As `can::Frame::key()` and `can::IdRange` have it.
  [[nodiscard]] constexpr std::uint32_t key() const noexcept { return extended() ? id() | can::extended_flag : id(); }
  /// Same frame format and CAN-ID, bits 29..0: what must not change while an object is in use.
  [[nodiscard]] constexpr bool same_identifier(CobId other) const noexcept {
    return ((raw_ ^ other.raw_) & ~(invalid_bit | second_bit)) == 0;
  }
  /// No bits above bit 10 in an 11-bit identifier.
  [[nodiscard]] constexpr bool well_formed() const noexcept {
    return extended() || (raw_ & (can::extended_mask & ~can::base_mask)) == 0;
  }
  /// The same, of an EMCY: its bit 30 is reserved, always 0 (CiA 301 §7.5.2.17, §7.5.2.31).
  [[nodiscard]] constexpr bool well_formed_emcy() const noexcept { return well_formed() && (raw_ & second_bit) == 0; }
  /// May be given to a PDO, SYNC, TIME or EMCY.
  [[nodiscard]] constexpr bool allowed() const noexcept { return well_formed() && (extended() || !restricted(id())); }
  friend constexpr bool operator==(CobId, CobId) noexcept = default;

 private:
  std::uint32_t raw_ = invalid_bit;
};

}  // namespace berth::co
