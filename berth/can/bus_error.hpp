/// Errors on a bus in SocketCAN's format (linux/can/error.h): classes in the identifier, details in the data. Trace
/// files contain these reports, a SocketCAN interface delivers them, and a simulated bus makes its own.
#pragma once

#include <cstdint>

#include "berth/can/frame.hpp"

namespace berth::can {

// Classes: bits of the report's identifier, which has no error flag (2000 0000h) here.
inline constexpr std::uint32_t error_protocol = 0x008;     ///< data[2] says which error, data[3] where
inline constexpr std::uint32_t error_acknowledge = 0x020;  ///< no node acknowledged
inline constexpr std::uint32_t error_on_bus = 0x080;
inline constexpr std::uint32_t error_counters = 0x200;  ///< data[6] is TEC, data[7] REC

/// data[2], bits.
enum class ErrorKind : std::uint8_t {
  other = 0,
  form = 0x02,
  stuff = 0x04,
  dominant = 0x08,   ///< the node sent a dominant bit and saw a recessive one
  recessive = 0x10,  ///< ... a recessive bit, and saw a dominant one
};
inline constexpr std::uint8_t error_overload = 0x20;       ///< data[2]: no error at all
inline constexpr std::uint8_t error_while_sending = 0x80;  ///< data[2]: the reporting node was sending

/// data[3]: the bit's place in the frame.
enum class ErrorPlace : std::uint8_t {
  unknown = 0,
  id28_21 = 0x02,
  start = 0x03,
  srr = 0x04,
  ide = 0x05,
  id20_18 = 0x06,
  id17_13 = 0x07,
  crc = 0x08,
  reserved0 = 0x09,
  data = 0x0A,
  dlc = 0x0B,
  rtr = 0x0C,
  reserved1 = 0x0D,
  id4_0 = 0x0E,
  id12_5 = 0x0F,
  intermission = 0x12,
  crc_delimiter = 0x18,
  acknowledge = 0x19,
  end_of_frame = 0x1A,
  acknowledge_delimiter = 0x1B,
};

/// True for an error frame on the bus. Other reports are about a controller's state, an overload frame, lost frames.
[[nodiscard]] constexpr bool is_bus_error(std::uint32_t classes, std::uint8_t protocol) noexcept {
  const bool overload = (classes & error_protocol) != 0 && protocol == error_overload;
  return (classes & (error_on_bus | error_acknowledge)) != 0 || ((classes & error_protocol) != 0 && !overload);
}

/// Reports an error seen by a node with these counters. `unacknowledged`: the error is a missing acknowledge.
[[nodiscard]] inline Frame error_report(ErrorKind kind, ErrorPlace place, bool unacknowledged, bool sending,
                                        unsigned tec, unsigned rec) noexcept {
  Frame report;
  report.id = error_on_bus | error_protocol | error_counters | (unacknowledged ? error_acknowledge : 0U);
  report.size = 8;
  report.data[2] = static_cast<std::uint8_t>(static_cast<unsigned>(kind) | (sending ? error_while_sending : 0U));
  report.data[3] = static_cast<std::uint8_t>(place);
  report.data[6] = static_cast<std::uint8_t>(tec > 255 ? 255 : tec);
  report.data[7] = static_cast<std::uint8_t>(rec > 255 ? 255 : rec);
  return report;
}

}  // namespace berth::can
