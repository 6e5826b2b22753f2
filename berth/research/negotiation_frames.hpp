/// The frames of the negotiation of node-IDs without a master (paper 2; S2.5 to S2.11).
///
/// All are classic extended data frames without data. The identifier contains the message, so that equal frames merge
/// on the bus and no two can collide (S2.4, S2.19). Of the 29 bits 13 are used (Table 1, S2.6):
///
///     bit 28..13  reserved, 0     a frame with one of them set is not ours
///     bit 12..8   data code       1 ss bb: byte bb of identity object 1018h, sub-index ss + 1, bits 7..0 first (S2.8)
///     bit  7..0   data field      00001: ReqUsedNodeId, data field 0; 00010: ActUsedNodeId, the node-ID (S2.10)
///
/// Base frames, FD frames and remote frames of the same number are not ours (S2.5), nor are frames with data: they
/// belong to another protocol. Other codes are reserved and ignored.
#pragma once

#include <cstdint>
#include <optional>
#include <string>

#include "berth/base/ids.hpp"
#include "berth/can/frame.hpp"

namespace berth::research {

inline constexpr std::uint32_t request_used_id = 0x100;  ///< ReqUsedNodeId
inline constexpr std::uint32_t used_id = 0x200;          ///< ActUsedNodeId | node-ID
inline constexpr std::uint32_t identity_id = 0x1000;     ///< | byte number << 8 | value
inline constexpr unsigned identity_bytes = 16;

/// The identifiers that a negotiating device receives; a device with a node-ID only needs `negotiation_control`
/// (S2.12).
inline constexpr can::IdRange negotiation_frames{can::extended_flag | 0x100, can::extended_flag | 0x1FFF};
inline constexpr can::IdRange negotiation_control{can::extended_flag | 0x100, can::extended_flag | 0x27F};

[[nodiscard]] can::Frame request_used() noexcept;
/// `id`: 1..127.
[[nodiscard]] can::Frame used(NodeId id) noexcept;
/// Byte 0..15 of the identity in sending order: sub-index 1 first, least significant byte first.
[[nodiscard]] can::Frame identity(const LssAddress& address, unsigned byte) noexcept;
/// The value that `identity` sends as that byte.
[[nodiscard]] constexpr std::uint8_t identity_byte(const LssAddress& address, unsigned byte) noexcept {
  return static_cast<std::uint8_t>(address.part(byte / 4) >> (byte % 4 * 8));
}

struct NegotiationMessage {
  enum class Kind : std::uint8_t { request_used, used, identity };
  Kind kind = Kind::request_used;
  NodeId node{};           ///< used
  std::uint8_t byte = 0;   ///< identity: 0..15
  std::uint8_t value = 0;  ///< identity
};
/// Empty: not a message of the negotiation.
[[nodiscard]] std::optional<NegotiationMessage> decode_negotiation(const can::Frame& frame) noexcept;

/// As in paper 2's Figure 2: "Request used node-IDs", "sub: 1, byte: 0, value: 0x19"; an announcement, whose words are
/// cut off in the figure, is "Used node-ID: 0x20".
[[nodiscard]] std::string interpretation(const NegotiationMessage& message);

}  // namespace berth::research
