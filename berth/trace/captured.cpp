#include "berth/trace/captured.hpp"

#include <fmt/format.h>

#include <cstring>

#include "berth/can/length.hpp"

namespace berth::trace {
namespace {

// LINUX_SLL: type of the packet, of the address, its length, eight bytes of it, protocol.
constexpr std::size_t cooked_header = 16;
constexpr unsigned outgoing = 4;
constexpr unsigned protocol_can = 0x000C;
constexpr unsigned protocol_canfd = 0x000D;

std::uint8_t octet(std::string_view bytes, std::size_t at) noexcept { return static_cast<std::uint8_t>(bytes[at]); }
unsigned big_u16(std::string_view bytes, std::size_t at) noexcept {
  return static_cast<unsigned>(octet(bytes, at)) << 8U | octet(bytes, at + 1);
}

// Takes one frame. At least the eight bytes before its data are there, and the first four of them are `id`.
std::string take_frame(std::uint32_t id, std::string_view bytes, Entry& entry) {
  const std::uint8_t flags = octet(bytes, 5);
  can::Frame& frame = entry.frame;
  frame.size = octet(bytes, 4);
  entry.error = (id & flag_error) != 0;
  frame.extended = !entry.error && (id & can::extended_flag) != 0;
  frame.remote = !entry.error && (id & flag_remote) != 0;
  frame.fd = !entry.error && ((flags & fd_format) != 0 || frame.size > 8 || bytes.size() == 72);
  frame.brs = frame.fd && (flags & fd_brs) != 0;
  frame.esi = frame.fd && (flags & fd_esi) != 0;
  frame.id = id & can::extended_mask;
  if (!entry.error && !frame.extended && frame.id > can::base_mask)
    return fmt::format("identifier {:X}h without the flag for extended ones", frame.id);
  if (frame.fd && frame.remote) return "an FD frame is never remote";
  if (frame.fd ? !can::fd_dlc(frame.size).has_value() : frame.size > 8)
    return fmt::format("a frame cannot have {} data bytes", frame.size);
  if (frame.remote) return {};
  if (bytes.size() < 8U + frame.size)
    return fmt::format("only {} of {} data bytes were captured", bytes.size() - 8, frame.size);
  std::memcpy(frame.data.data(), bytes.data() + 8, frame.size);
  return {};
}

}  // namespace

std::uint32_t u32_at(std::string_view bytes, std::size_t at, bool big_endian) noexcept {
  std::uint32_t value = 0;
  for (std::size_t i = 0; i < 4; ++i) value = value << 8U | octet(bytes, at + (big_endian ? i : 3 - i));
  return value;
}

LinkType link_type_of(std::uint32_t number) noexcept {
  constexpr std::uint32_t linux_sll = 113;
  if (number == link_type_can_socketcan) return LinkType::can_socketcan;
  return number == linux_sll ? LinkType::linux_sll : LinkType::other;
}

Captured take_packet(LinkType type, bool big_endian, std::string_view packet, Entry& entry) {
  bool id_is_big = true;
  if (type == LinkType::linux_sll) {
    if (packet.size() < cooked_header) return {false, "a packet of LINUX_SLL has at least 16 bytes"};
    const unsigned protocol = big_u16(packet, 14);
    if (protocol != protocol_can && protocol != protocol_canfd) return {};
    entry.direction = big_u16(packet, 0) == outgoing ? Direction::sent : Direction::received;
    packet.remove_prefix(cooked_header);
    id_is_big = big_endian;
  }
  if (packet.size() < 8) return {false, "a packet of CAN has at least 8 bytes"};
  std::string wrong = take_frame(u32_at(packet, 0, id_is_big), packet, entry);
  return {wrong.empty(), std::move(wrong)};
}

}  // namespace berth::trace
