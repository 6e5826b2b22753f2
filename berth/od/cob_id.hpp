/// COB-IDs in object dictionaries (CiA 301 §7.3.5, §7.5.2; docs/protocols/cia301.md §CAN-IDs).
#pragma once

#include <algorithm>
#include <array>
#include <cstdint>

namespace berth::od {

/// CAN-IDs that are forbidden for PDO, SYNC, EMCY, TIME and additional SDO (CiA 301 §7.3.5, table of restricted
/// CAN-IDs).
struct RestrictedIds {
  std::uint32_t first;
  std::uint32_t last;
  const char* use;
};
inline constexpr std::array<RestrictedIds, 8> restricted_ids{{{0x000, 0x000, "NMT"},
                                                              {0x001, 0x07F, "reserved"},
                                                              {0x101, 0x180, "reserved"},
                                                              {0x581, 0x5FF, "the default SDO, server to client"},
                                                              {0x601, 0x67F, "the default SDO, client to server"},
                                                              {0x6E0, 0x6FF, "reserved"},
                                                              {0x701, 0x77F, "heartbeat and boot-up"},
                                                              {0x780, 0x7FF, "reserved"}}};
/// The service that a CAN-ID is reserved for; null: none. Base format; identifiers above 7FFh are not restricted.
[[nodiscard]] constexpr const char* restricted_use(std::uint32_t id) noexcept {
  const auto* const it = std::ranges::find_if(
      restricted_ids, [id](const RestrictedIds& each) { return id >= each.first && id <= each.last; });
  return it == restricted_ids.end() ? nullptr : it->use;
}
/// Writing a restricted CAN-ID into a COB-ID is refused with 0609 0030.
[[nodiscard]] constexpr bool restricted(std::uint32_t id) noexcept { return restricted_use(id) != nullptr; }

/// The UNSIGNED32 of a COB-ID object (1005h, 1012h, 1014h, 1200h, 1400h, ...).
class CobId {
 public:
  static constexpr std::uint32_t invalid_bit = 0x8000'0000U;  ///< PDO, SDO, EMCY: does not exist
  static constexpr std::uint32_t second_bit = 0x4000'0000U;   ///< meaning by object: SYNC producer, TPDO no RTR, ...
  static constexpr std::uint32_t frame_bit = 0x2000'0000U;    ///< 29-bit identifier
  static constexpr std::uint32_t base_mask = 0x7FFU;
  static constexpr std::uint32_t extended_mask = 0x1FFF'FFFFU;

  constexpr CobId() noexcept = default;  ///< invalid
  constexpr explicit CobId(std::uint32_t raw) noexcept : raw_(raw) {}
  [[nodiscard]] constexpr std::uint32_t raw() const noexcept { return raw_; }
  [[nodiscard]] constexpr bool valid() const noexcept { return (raw_ & invalid_bit) == 0; }
  [[nodiscard]] constexpr bool extended() const noexcept { return (raw_ & frame_bit) != 0; }
  [[nodiscard]] constexpr std::uint32_t id() const noexcept { return raw_ & (extended() ? extended_mask : base_mask); }
  /// The format of `can::Frame::key()` and `can::IdRange`.
  [[nodiscard]] constexpr std::uint32_t key() const noexcept { return extended() ? id() | key_of_extended : id(); }
  /// Same frame format and CAN-ID, bits 29..0: these must not change while an object is in use.
  [[nodiscard]] constexpr bool same_identifier(CobId other) const noexcept {
    return ((raw_ ^ other.raw_) & ~(invalid_bit | second_bit)) == 0;
  }
  /// True without bits above bit 10 in an 11-bit identifier.
  [[nodiscard]] constexpr bool well_formed() const noexcept {
    return extended() || (raw_ & (extended_mask & ~base_mask)) == 0;
  }
  /// The same for an EMCY: its bit 30 is reserved, always 0 (CiA 301 §7.5.2.17, §7.5.2.31).
  [[nodiscard]] constexpr bool well_formed_emcy() const noexcept { return well_formed() && (raw_ & second_bit) == 0; }
  /// True if allowed for a PDO, SYNC, TIME or EMCY.
  [[nodiscard]] constexpr bool allowed() const noexcept { return well_formed() && (extended() || !restricted(id())); }
  friend constexpr bool operator==(CobId, CobId) noexcept = default;

 private:
  static constexpr std::uint32_t key_of_extended = 0x8000'0000U;
  std::uint32_t raw_ = invalid_bit;
};

}  // namespace berth::od
