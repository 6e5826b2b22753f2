/// The ASCII protocol of serial CAN adapters (LAWICEL CAN232/CANUSB manual; CANable, USBtin, candleLight's slcan): a
/// letter, hexadecimal digits, CR. Only the encoding; slcan_port.hpp has the line.
///
///     tiiildd..   TiiiiiiiiLdd..   data frame, base and extended; l: length, one digit
///     riiil       Riiiiiiiil       remote frame
///     d D b B                      FD frame, without and with bit rate switch (CANable 2); l: DLC, 0 to F
///     z  Z                         the adapter has taken a base or extended frame
///     CR alone                     done;   BEL: refused
///     zt..  ZT..                   a frame of ours was acknowledged on the bus (CANable 2 with transmit events)
///     Fxx  Vhhss  Nxxxx            status flags, version, serial number
///
/// Frames may carry a time after their data: four digits, milliseconds up to 60,000, or eight, microseconds.
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <string_view>

#include "berth/can/frame.hpp"

namespace berth::io {

/// Bits of `F`, as defined by LAWICEL. Reading clears them.
namespace slcan_flag {
inline constexpr std::uint8_t receive_full = 0x01;   ///< frames were lost
inline constexpr std::uint8_t transmit_full = 0x02;  ///< CANable 2: frames were lost, too
inline constexpr std::uint8_t warning = 0x04;
inline constexpr std::uint8_t overrun = 0x08;  ///< frames were lost
inline constexpr std::uint8_t error_passive = 0x20;
inline constexpr std::uint8_t arbitration_lost = 0x40;
inline constexpr std::uint8_t bus_error = 0x80;
}  // namespace slcan_flag

struct SlcanLine {
  enum class Kind : std::uint8_t {
    frame,      ///< `frame`, and `time` if the adapter adds it
    confirmed,  ///< our own `frame` was acknowledged on the bus
    done,       ///< CR alone
    taken,      ///< z or Z
    refused,    ///< BEL
    flags,      ///< `number`
    version,    ///< `text`
    serial,     ///< `text`
    text,       ///< readable text that is none of these: a version in words, an answer to `f`
    garbage,    ///< not this protocol: bytes were lost, or it is not such an adapter
  };
  Kind kind = Kind::garbage;
  can::Frame frame{};
  std::optional<std::uint32_t> time{};  ///< as received: four or eight digits
  std::uint8_t number = 0;
  std::string text{};
};
/// Parses a line without its CR. A frame with too few or too many digits, a wrong length or identifier is garbage.
[[nodiscard]] SlcanLine parse_slcan(std::string_view line);

/// The line for a frame, with its CR. An FD frame whose size has no DLC is cut to the next smaller size.
[[nodiscard]] std::string write_slcan(const can::Frame& frame);

/// S0 to S8 for the rates that have one; `sxxyy` (BTR0, BTR1 of an SJA1000 at 16 MHz, sample point near 87.5 %) for
/// others that divide 8 MHz to within a thousandth; with its CR. Empty: neither. S7 is LAWICEL's 800 kbit/s; early
/// CANables use it for 750.
[[nodiscard]] std::string slcan_rate(std::uint32_t bit_rate);

/// Splits a stream of bytes into lines. BEL is a separate line. A line that is too long, or contains invalid bytes, is
/// one garbage line up to the next CR.
class SlcanReader {
 public:
  /// FD frame of 64 bytes with prefix, time and error state.
  static constexpr std::size_t longest = 160;
  struct Line {
    std::string_view text;  ///< without CR; "\a" for BEL; valid until the next call of `add` or `next`
    bool broken = false;    ///< too long, or with invalid bytes: do not parse
    std::uint64_t at = 0;   ///< offset of its first byte since the beginning
  };
  void add(std::string_view bytes) { buffer_.append(bytes); }
  [[nodiscard]] std::optional<Line> next();
  /// Forgets all input, as after reopening the line.
  void reset();
  [[nodiscard]] std::size_t kept() const noexcept { return buffer_.size() - head_; }

 private:
  std::string buffer_;
  std::size_t head_ = 0;
  std::uint64_t before_ = 0;
  std::optional<std::uint64_t> broken_at_;  // of a line that was too long to keep
};

}  // namespace berth::io
