/// CAN frames in packet captures, in pcapng and classic pcap: Linux's struct can_frame, by itself or after the header
/// of a capture of all interfaces ("any", LINUX_SLL). Inside of room `trace`.
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <string_view>

#include "berth/trace/trace.hpp"

namespace berth::trace {

// Of struct can_frame and struct canfd_frame (linux/can.h).
inline constexpr std::uint32_t flag_remote = 0x4000'0000;
inline constexpr std::uint32_t flag_error = 0x2000'0000;
inline constexpr std::uint8_t fd_brs = 1;
inline constexpr std::uint8_t fd_esi = 2;
inline constexpr std::uint8_t fd_format = 4;

/// Link types (tcpdump.org/linktypes.html) that carry CAN frames.
enum class LinkType : std::uint8_t { other, can_socketcan, linux_sll };
inline constexpr std::uint16_t link_type_can_socketcan = 227;
[[nodiscard]] LinkType link_type_of(std::uint32_t number) noexcept;

/// The four bytes from `at` on, which must exist.
[[nodiscard]] std::uint32_t u32_at(std::string_view bytes, std::size_t at, bool big_endian) noexcept;

/// The result for a packet.
struct Captured {
  bool frame = false;  ///< `entry` has it: frame, error, and with LINUX_SLL the direction
  std::string wrong;   ///< why it is not one; empty: a packet of another protocol
};
/// `big_endian`: the byte order of the file, and of an identifier after LINUX_SLL's header; without that header an
/// identifier is always big-endian.
[[nodiscard]] Captured take_packet(LinkType type, bool big_endian, std::string_view packet, Entry& entry);

}  // namespace berth::trace
