/// Names of things on a CANopen network, as distinct types.
#pragma once

#include <array>
#include <compare>
#include <cstdint>
#include <optional>
#include <string>
#include <string_view>

namespace berth {

/// A CANopen node-ID, 1..127 (CiA 301 §7.3.5), or 255 = unconfigured (CiA 305).
class NodeId {
 public:
  static constexpr std::uint8_t unconfigured_value = 0xFF;

  constexpr NodeId() noexcept = default;  ///< unconfigured
  /// `value` must be 1..127 or 255; check input from outside with `make`.
  constexpr explicit NodeId(std::uint8_t value) noexcept : value_(value) {}
  [[nodiscard]] static constexpr std::optional<NodeId> make(unsigned value) noexcept {
    if ((value >= 1 && value <= 127) || value == unconfigured_value) return NodeId(static_cast<std::uint8_t>(value));
    return std::nullopt;
  }
  [[nodiscard]] constexpr std::uint8_t value() const noexcept { return value_; }
  [[nodiscard]] constexpr bool configured() const noexcept { return value_ != unconfigured_value; }
  friend constexpr auto operator<=>(NodeId, NodeId) noexcept = default;

 private:
  std::uint8_t value_ = unconfigured_value;
};

/// Vendor-ID and product code joined: devices with the same type code are equal in function
/// (paper 1 §III; S1.3).
struct TypeCode {
  std::uint32_t vendor = 0;
  std::uint32_t product = 0;
  friend constexpr auto operator<=>(const TypeCode&, const TypeCode&) noexcept = default;
};

/// The paper's R_SN: revision number (upper half) and serial number joined (paper 1 §III).
struct R_SN {
  std::uint32_t revision = 0;
  std::uint32_t serial = 0;
  [[nodiscard]] constexpr std::uint64_t value() const noexcept {
    return (static_cast<std::uint64_t>(revision) << 32) | serial;
  }
  friend constexpr auto operator<=>(const R_SN&, const R_SN&) noexcept = default;
};

/// The 128-bit LSS address = identity object 1018h:01..04 (docs/protocols/cia305.md §Frames). Ordered as RAND and
/// Fastscan find devices: vendor, product, revision, serial, most significant bit first.
struct LssAddress {
  std::uint32_t vendor = 0;
  std::uint32_t product = 0;
  std::uint32_t revision = 0;
  std::uint32_t serial = 0;

  [[nodiscard]] constexpr TypeCode type() const noexcept { return {vendor, product}; }
  [[nodiscard]] constexpr R_SN r_sn() const noexcept { return {revision, serial}; }
  /// Part 0..3: vendor, product, revision, serial.
  [[nodiscard]] constexpr std::uint32_t part(unsigned i) const noexcept {
    return std::array<std::uint32_t, 4>{vendor, product, revision, serial}[i & 3U];
  }
  /// The paper's chunk 0..7: 16 bits, big-endian over the whole address (paper 1 fig. 1; S1.11).
  [[nodiscard]] constexpr std::uint16_t chunk(unsigned i) const noexcept {
    return static_cast<std::uint16_t>(part(i / 2) >> ((i % 2 == 0) ? 16U : 0U));
  }
  friend constexpr auto operator<=>(const LssAddress&, const LssAddress&) noexcept = default;
};

/// "01000001-00000001-00000000-0000000A": vendor-product-revision-serial, eight hex digits each.
[[nodiscard]] std::string to_string(const LssAddress& address);
[[nodiscard]] std::string to_string(const TypeCode& type);  ///< "01000001-00000001"
/// Parses the output of `to_string`; upper and lower case, with or without 0x before each part.
[[nodiscard]] std::optional<LssAddress> parse_lss_address(std::string_view text);

/// Which device it is, on its bus: what it says of itself in 1018h. CiA 301 makes only the vendor-ID mandatory
/// (§7.5.2.18); a part that a device does not say is unknown, which is not 0. A serial number other than 0
/// distinguishes a device from all others; a device without one (unknown, or 0, which CiA 301 reserves) is also
/// identified by its node-ID.
///
/// A master that asks by LSS or RAND receives whole addresses: an address is an identity without unknown parts.
struct Identity {
  static constexpr std::uint8_t all_unknown = 0xF;

  constexpr Identity() noexcept = default;
  // NOLINTNEXTLINE(google-explicit-constructor): each whole address is the identity of a device
  constexpr Identity(const LssAddress& whole) noexcept : address(whole) {}
  constexpr Identity(std::uint32_t vendor, std::uint32_t product, std::uint32_t revision, std::uint32_t serial) noexcept
      : address{vendor, product, revision, serial} {}

  LssAddress address{};      ///< 0 in the parts that are unknown
  std::uint8_t unknown = 0;  ///< parts that the device does not say: bit 0 vendor-ID to bit 3 serial number
  NodeId at;  ///< for one without a serial number: the node-ID that distinguishes it from equal devices; unconfigured
              ///< while it has none, and always with a serial number

  /// True if part 0..3 (`LssAddress::part`) is known.
  [[nodiscard]] constexpr bool knows(unsigned part) const noexcept { return (unknown >> part & 1U) == 0; }
  [[nodiscard]] constexpr bool has_serial() const noexcept { return knows(3) && address.serial != 0; }
  [[nodiscard]] constexpr TypeCode type() const noexcept { return address.type(); }
  [[nodiscard]] constexpr R_SN r_sn() const noexcept { return address.r_sn(); }
  /// The same device with `id` as the node-ID in use (unconfigured: none).
  [[nodiscard]] constexpr Identity with(NodeId id) const noexcept {
    Identity moved = *this;
    moved.at = has_serial() ? NodeId() : id;
    return moved;
  }
  /// True if all parts known in both are equal. Also true for two devices of one kind without serial numbers: `at` is
  /// ignored.
  [[nodiscard]] bool agrees(const Identity& other) const noexcept;
  friend constexpr auto operator<=>(const Identity&, const Identity&) noexcept = default;
};

/// As an LSS address; "xxxxxxxx" is an unknown part, and "@5" follows if the device is identified by its node-ID:
/// "00000001-00000002-xxxxxxxx-xxxxxxxx@5".
[[nodiscard]] std::string to_string(const Identity& identity);
/// Parses the output of `to_string`, as tolerantly as `parse_lss_address`.
[[nodiscard]] std::optional<Identity> parse_identity(std::string_view text);

/// Index and sub-index of an object.
struct ObjectRef {
  std::uint16_t index = 0;
  std::uint8_t sub = 0;
  friend constexpr auto operator<=>(const ObjectRef&, const ObjectRef&) noexcept = default;
};

/// NMT states in the error control protocol (CiA 301 §7.2.8.3.2).
enum class NmtState : std::uint8_t {
  initialising = 0x00,
  stopped = 0x04,
  operational = 0x05,
  pre_operational = 0x7F,
};
[[nodiscard]] const char* name(NmtState state) noexcept;

}  // namespace berth
