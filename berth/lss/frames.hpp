/// The frames of the layer setting services (CiA 305): command specifiers, encoding and decoding.
///
/// Every LSS frame is a base data frame with 8 bytes: command specifier, parameters little-endian, the rest 0.
/// Master to slaves 7E5h, slave to master 7E4h, so that an answer outranks the next request.
///
/// Feedback (paper 4; S4.10, S4.11) is not in the standard: frames without data whose identifier contains the next bits
/// of the sender's LSS address. A slave sends one before its 4Fh.
#pragma once

#include <array>
#include <cstdint>
#include <initializer_list>
#include <optional>

#include "berth/base/bytes.hpp"
#include "berth/base/ids.hpp"
#include "berth/can/frame.hpp"

namespace berth::lss {

inline constexpr std::uint32_t master_cob_id = 0x7E5;  ///< requests
inline constexpr std::uint32_t slave_cob_id = 0x7E4;   ///< answers

/// The two LSS states of a slave (called operation and configuration mode in the v1 wording that paper 1 uses). The
/// values are those of the mode byte of switch state global.
enum class State : std::uint8_t { waiting = 0, configuration = 1 };

/// How a slave sends the master the next bits of its LSS address during Fastscan (paper 4; S4.10, S4.11).
enum class Feedback : std::uint8_t {
  none,      ///< CiA 305 unchanged
  extended,  ///< one 29-bit frame: 16 bits
  base,      ///< one of sixteen 11-bit frames: 4 bits
};

/// Command specifiers, byte 0. An answer repeats the request's, except where noted.
enum class Command : std::uint8_t {
  switch_global = 0x04,
  configure_node_id = 0x11,
  configure_bit_timing = 0x13,
  activate_bit_timing = 0x15,
  store = 0x17,
  select_vendor = 0x40,
  select_product = 0x41,
  select_revision = 0x42,
  select_serial = 0x43,
  selected = 0x44,  ///< answer to 43h
  identify_vendor = 0x46,
  identify_product = 0x47,
  identify_revision_low = 0x48,
  identify_revision_high = 0x49,
  identify_serial_low = 0x4A,
  identify_serial_high = 0x4B,
  identify_non_configured = 0x4C,
  identified = 0x4F,      ///< answer to 4Bh
  non_configured = 0x50,  ///< answer to 4Ch
  fastscan = 0x51,        ///< answered with `identified`
  inquire_vendor = 0x5A,
  inquire_product = 0x5B,
  inquire_revision = 0x5C,
  inquire_serial = 0x5D,
  inquire_node_id = 0x5E,
};

/// Index into the CiA bit timing table (table selector 0).
enum class BitRateIndex : std::uint8_t {
  kbit_1000 = 0,
  kbit_800 = 1,
  kbit_500 = 2,
  kbit_250 = 3,
  kbit_125 = 4,
  reserved = 5,  ///< 100 kbit/s in the past; never accepted
  kbit_50 = 6,
  kbit_20 = 7,
  kbit_10 = 8,
  automatic = 9,  ///< automatic bit rate detection
};
/// In bit/s; 0 for automatic detection; empty for the reserved index and beyond the table.
[[nodiscard]] std::optional<std::uint32_t> bit_rate(BitRateIndex index) noexcept;
/// The index of a rate in bit/s; empty when the table has none.
[[nodiscard]] std::optional<BitRateIndex> bit_rate_index(std::uint32_t bits_per_second) noexcept;

/// A set of `BitRateIndex`: bit i stands for index i. 10 to 1000 kbit/s without automatic detection.
using BitRateMask = std::uint16_t;
inline constexpr BitRateMask all_fixed_bit_rates = 0x01DF;
[[nodiscard]] constexpr bool contains(BitRateMask mask, unsigned index) noexcept {
  return index <= 9 && index != 5 && ((mask >> index) & 1U) != 0;
}

/// Services that a device may lack.
enum class Lackable : std::uint8_t {
  select,            ///< 40h to 43h
  inquire_identity,  ///< 5Ah to 5Dh
  inquire_node_id,   ///< 5Eh
  identify,          ///< 46h to 4Bh, 4Ch
  bit_timing,        ///< 13h
  activate,          ///< 15h
};
inline constexpr std::size_t lackable_count = 6;
/// The service of this request that a device may lack; empty: none.
[[nodiscard]] std::optional<Lackable> lackable(Command request) noexcept;

/// A set of `Lackable`.
class LackSet {
 public:
  constexpr LackSet() = default;
  constexpr LackSet(std::initializer_list<Lackable> all) {
    for (const auto each : all) add(each);
  }
  [[nodiscard]] constexpr bool has(Lackable what) const noexcept {
    return (bits_ >> static_cast<unsigned>(what) & 1U) != 0;
  }
  [[nodiscard]] constexpr bool empty() const noexcept { return bits_ == 0; }
  constexpr void add(Lackable what) noexcept {
    bits_ = static_cast<std::uint8_t>(bits_ | 1U << static_cast<unsigned>(what));
  }
  constexpr void remove(Lackable what) noexcept {
    bits_ = static_cast<std::uint8_t>(bits_ & ~(1U << static_cast<unsigned>(what)));
  }
  friend constexpr bool operator==(LackSet, LackSet) = default;

 private:
  std::uint8_t bits_ = 0;
};

/// Error codes in byte 1 of an answer. The meaning of 1 and 2 depends on the service.
namespace error {
inline constexpr std::uint8_t ok = 0;
inline constexpr std::uint8_t out_of_range = 1;   ///< configure node-ID: not 1..127 or 255
inline constexpr std::uint8_t not_supported = 1;  ///< bit timing, store
inline constexpr std::uint8_t storage = 2;        ///< store: the medium cannot be written
inline constexpr std::uint8_t specific = 255;     ///< byte 2 holds a manufacturer's code
}  // namespace error

/// The question of identify remote slave: vendor and product equal, revision and serial number within inclusive ranges.
struct IdentifyRanges {
  std::uint32_t vendor = 0;
  std::uint32_t product = 0;
  std::uint32_t revision_low = 0;
  std::uint32_t revision_high = 0xFFFF'FFFF;
  std::uint32_t serial_low = 0;
  std::uint32_t serial_high = 0xFFFF'FFFF;
  [[nodiscard]] constexpr bool contains(const LssAddress& a) const noexcept {
    return a.vendor == vendor && a.product == product && a.revision >= revision_low && a.revision <= revision_high &&
           a.serial >= serial_low && a.serial <= serial_high;
  }
  /// The six values in sending order, 46h to 4Bh.
  [[nodiscard]] constexpr std::uint32_t value(unsigned i) const noexcept {
    return std::array<std::uint32_t, 6>{vendor, product, revision_low, revision_high, serial_low, serial_high}[i % 6];
  }
};

/// One Fastscan request: "slave at part `sub` whose bits 31 to `bit_checked` equal those of `id`: answer, and go to
/// part `next`". With `start_scan` in place of a bit: "slave without a node-ID: answer, and go to part 0"; the rest is
/// then 0.
struct FastscanRequest {
  static constexpr std::uint8_t start_scan = 0x80;
  static constexpr std::uint8_t after_last = 4;  ///< paper 4's `next` after the serial number (S4.15); the standard: 0
  std::uint32_t id = 0;
  std::uint8_t bit_checked = start_scan;  ///< 31 = bit 31 alone ... 0 = all 32 bits, or `start_scan`
  std::uint8_t sub = 0;                   ///< 0..3: vendor, product, revision, serial
  std::uint8_t next = 0;                  ///< 0..3; the slave accepts all
  [[nodiscard]] constexpr bool starts() const noexcept { return bit_checked == start_scan; }
  /// True when bits 31 to `bit_checked` of `own` equal those of `id`; `bit_checked` must be 0..31.
  [[nodiscard]] constexpr bool matches(std::uint32_t own) const noexcept { return ((id ^ own) >> bit_checked) == 0; }
  friend constexpr bool operator==(const FastscanRequest&, const FastscanRequest&) noexcept = default;
};

/// The content of a feedback frame: bits of the sender's LSS address. Ordered by value within a kind and half.
struct FeedbackValue {
  Feedback kind = Feedback::extended;
  bool toggle = false;      ///< extended: bits 15..0 of the part (true) or 31..16; base: false
  std::uint16_t value = 0;  ///< extended: 16 bits; base: 4 bits
  friend constexpr auto operator<=>(const FeedbackValue&, const FeedbackValue&) noexcept = default;
};
/// Extended: 7E4h in bits 28 to 18, bit 17 reserved (0), bit 16 the toggle bit, bits 15 to 0 the value. The same
/// identifiers as RAND's DIS: never both on one bus at a time (S1.24).
inline constexpr can::IdRange extended_feedback{can::extended_flag | slave_cob_id << 18,
                                                (can::extended_flag | slave_cob_id << 18) + 0x1'FFFFU};
/// Base: sixteen identifiers from a base that is configured in master and slaves. Paper 4 names none. 680h to 6DFh is
/// what CiA 301's table leaves: unused by the predefined connection set (PDOs end at 57Fh, the SDOs are 580h to 67Fh,
/// dynamic SDO and CiA 416 begin at 6E0h, error control at 700h) and not restricted. Berth's default is the upper end
/// of it: it has a lower priority than PDO and SDO, and a higher one than the next LSS request.
inline constexpr std::uint16_t default_feedback_base = 0x6D0;
/// True for 680h to 6D0h.
[[nodiscard]] constexpr bool usable_feedback_base(unsigned id) noexcept { return id >= 0x680 && id <= 0x6D0; }
/// The sixteen identifiers from a usable `base`.
[[nodiscard]] constexpr can::IdRange base_feedback(std::uint16_t base) noexcept { return {base, base + 15U}; }

/// A request of the master. Unused bytes are 0.
[[nodiscard]] can::Frame request(Command command) noexcept;
[[nodiscard]] can::Frame request(Command command, std::uint8_t byte1, std::uint8_t byte2 = 0) noexcept;
[[nodiscard]] can::Frame request32(Command command, std::uint32_t value) noexcept;
/// `15h` with the switch delay in milliseconds.
[[nodiscard]] can::Frame request_activate(std::uint16_t delay_ms) noexcept;
/// Switch state selective, frame 0..3 of 4 (40h to 43h).
[[nodiscard]] can::Frame request_select(const LssAddress& address, unsigned i) noexcept;
/// Identify remote slave, frame 0..5 of 6 (46h to 4Bh).
[[nodiscard]] can::Frame request_identify(const IdentifyRanges& ranges, unsigned i) noexcept;
/// `51h`.
[[nodiscard]] can::Frame request_fastscan(const FastscanRequest& request) noexcept;

/// An answer of a slave.
[[nodiscard]] can::Frame answer(Command command) noexcept;
[[nodiscard]] can::Frame answer(Command command, std::uint8_t byte1, std::uint8_t byte2 = 0) noexcept;
[[nodiscard]] can::Frame answer32(Command command, std::uint32_t value) noexcept;

/// A feedback frame; `base` is the first of the sixteen identifiers (kind `base` only).
[[nodiscard]] can::Frame feedback_frame(const FeedbackValue& feedback,
                                        std::uint16_t base = default_feedback_base) noexcept;
/// Decodes frames of `feedback_frame`. Empty for all others: data, remote, FD. `base` 0: no base frame is feedback.
[[nodiscard]] std::optional<FeedbackValue> decode_feedback(const can::Frame& frame, std::uint16_t base = 0) noexcept;
/// Decodes a Fastscan request. Empty for other frames, and if `bit_checked` is neither 0..31 nor 80h or `sub` is above
/// 3.
[[nodiscard]] std::optional<FastscanRequest> decode_fastscan(const can::Frame& frame) noexcept;

/// True for a base data frame with 8 bytes and this identifier, as CiA 305 requires of an LSS frame
/// (docs/protocols/cia305.md §Frames).
[[nodiscard]] constexpr bool is_lss(const can::Frame& frame, std::uint32_t cob_id) noexcept {
  return frame.id == cob_id && !frame.extended && !frame.remote && !frame.fd && frame.size == 8;
}
/// True for a slave's answer, even if it omits the zeros at its end: the significant bytes must be there.
[[nodiscard]] bool is_answer(const can::Frame& frame) noexcept;
/// The same answer with eight bytes, as in CiA 305; `answer`: `is_answer`.
[[nodiscard]] can::Frame whole_answer(const can::Frame& answer) noexcept;
/// The same answer without the zeros at its end.
[[nodiscard]] can::Frame short_answer(const can::Frame& answer) noexcept;
[[nodiscard]] inline Command command(const can::Frame& frame) noexcept { return static_cast<Command>(frame.data[0]); }
/// Bytes 1..4 as one number.
[[nodiscard]] inline std::uint32_t value32(const can::Frame& frame) noexcept {
  return load_le<std::uint32_t>(frame.data.data() + 1);
}

}  // namespace berth::lss
