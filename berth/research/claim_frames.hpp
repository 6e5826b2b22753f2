/// Claiming a node-ID as SAE J1939-81 claims a source address: the comparison in paper 2 (S2.4). docs/claim.md has the
/// rules, the choices and the reasons why no machine should use it.
///
/// The device's name is in the data field. Two devices that claim one node-ID at the same moment send one identifier
/// with different data, which causes bit errors at every repetition. This is paper 2's objection.
///
///     claim           18EEFF00h + node-ID    NAME, 64 bit little-endian       node-ID 1..127; 254: cannot claim
///     claim request   18EA0000h + to << 8 + from   00 EE 00                   to FFh: all devices
#pragma once

#include <cstdint>
#include <optional>

#include "berth/base/ids.hpp"
#include "berth/can/frame.hpp"

namespace berth::research {

inline constexpr std::uint32_t claim_id = 0x18EE'FF00;          ///< priority 6, PGN EE00h, to all devices
inline constexpr std::uint32_t claim_request_id = 0x18EA'0000;  ///< priority 6, PGN EA00h
inline constexpr std::uint8_t claim_nobody = 254;               ///< J1939's null address
inline constexpr std::uint8_t claim_everybody = 255;

/// The identifiers that a device receives.
inline constexpr can::IdRange claims{can::extended_flag | claim_id, can::extended_flag | claim_id | 0xFFU};
inline constexpr can::IdRange claim_requests{can::extended_flag | claim_request_id,
                                             can::extended_flag | claim_request_id | 0xFFFFU};

/// J1939's NAME, made from an LSS address: identity number = low 21 bits of the serial number, manufacturer code = low
/// 11 bits of the vendor-ID, function instance = low 5 bits of the revision, function and vehicle system = low 15 bits
/// of the product code, arbitrary address capable = 1, the rest 0. 52 of 128 bits: different devices may have one NAME.
[[nodiscard]] constexpr std::uint64_t claim_name(const LssAddress& a) noexcept {
  return (std::uint64_t{a.serial} & 0x1F'FFFFU) | (std::uint64_t{a.vendor} & 0x7FFU) << 21 |
         (std::uint64_t{a.revision} & 0x1FU) << 35 | (std::uint64_t{a.product} & 0xFFU) << 40 |
         (std::uint64_t{a.product} >> 8 & 0x7FU) << 49 | std::uint64_t{1} << 63;
}

struct Claim {
  std::uint8_t id = claim_nobody;  ///< 1..127, or `claim_nobody`
  std::uint64_t name = 0;
};
[[nodiscard]] can::Frame claim(const Claim& claim) noexcept;
/// Asks `to` (a node-ID or `claim_everybody`) for its claim.
[[nodiscard]] can::Frame claim_request(std::uint8_t to = claim_everybody, std::uint8_t from = claim_nobody) noexcept;

/// Empty: not a claim of a node-ID.
[[nodiscard]] std::optional<Claim> decode_claim(const can::Frame& frame) noexcept;
/// The node-ID that the request asks; empty: no request for claims.
[[nodiscard]] std::optional<std::uint8_t> decode_claim_request(const can::Frame& frame) noexcept;

}  // namespace berth::research
