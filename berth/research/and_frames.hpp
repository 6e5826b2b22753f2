/// The frames of AND, the automatic node discovery protocol that RAND revises (Cena and Valenzano; paper 1 §I, §IV;
/// S1.44). Its frame formats are not public: these are Berth's own, based on paper 1. docs/and.md has the whole wire
/// format and the reasons for it.
///
/// All are base data frames with 8 bytes, the answers too, as paper 1 counts them.
///
///     IURS     7C2h       80 phase n n n n n n     phase 0..11; n: the first `phase` nibbles of the address, rest 0
///     DIRS     7C2h       80 0C n n n n n n        n: the whole address
///     switch   7C2h       81 state                 global
///     switch   7C2h       82 target n n n n n n    selective
///     inquire  7C2h       83 part                  LSS address of the sender of the last DIS; part 0, 1
///     IUS      7A0h + nibble(phase)                00 x 8
///     DIS      7B0h + nibble(11)                   00 x 8
///     address  7C0h + part              two 32-bit values, big-endian: vendor, product; revision, serial
#pragma once

#include <cstdint>
#include <optional>

#include "berth/base/ids.hpp"
#include "berth/can/frame.hpp"
#include "berth/nodeid/rand_frames.hpp"

namespace berth::research {

inline constexpr std::uint32_t and_ius_id = 0x7A0;
inline constexpr std::uint32_t and_dis_id = 0x7B0;
inline constexpr std::uint32_t and_address_id = 0x7C0;
inline constexpr std::uint32_t and_request_id = 0x7C2;
inline constexpr unsigned and_direct_phase = 12;

/// The identifiers that a slave receives, and a master.
inline constexpr can::IdRange and_requests = can::only(and_request_id);
inline constexpr can::IdRange and_answers{and_ius_id, and_address_id + 1};

/// AND's 48-bit address of a device: the low 16 bits of its product code, then its serial number. Devices that differ
/// only in vendor, the rest of the product code or the revision have one AND address.
class AndAddress {
 public:
  constexpr AndAddress() noexcept = default;
  constexpr explicit AndAddress(std::uint64_t value) noexcept : value_(value & 0xFFFF'FFFF'FFFFULL) {}
  constexpr explicit AndAddress(const LssAddress& address) noexcept
      : value_(static_cast<std::uint64_t>(address.product & 0xFFFFU) << 32 | address.serial) {}
  [[nodiscard]] constexpr std::uint64_t value() const noexcept { return value_; }
  /// 4 bits; nibble 0 is the most significant.
  [[nodiscard]] constexpr std::uint8_t nibble(unsigned phase) const noexcept {
    return static_cast<std::uint8_t>(value_ >> (44 - 4 * phase) & 15U);
  }
  /// The first `phase` nibbles, the rest 0.
  [[nodiscard]] constexpr AndAddress prefix(unsigned phase) const noexcept {
    return AndAddress(phase >= 12 ? value_ : value_ >> (48 - 4 * phase) << (48 - 4 * phase));
  }
  /// With this value as nibble `phase`.
  [[nodiscard]] constexpr AndAddress with(unsigned phase, std::uint8_t nibble) const noexcept {
    const unsigned at = 44 - 4 * phase;
    return AndAddress((value_ & ~(std::uint64_t{15} << at)) | std::uint64_t{nibble} << at);
  }
  friend constexpr auto operator<=>(AndAddress, AndAddress) noexcept = default;

 private:
  std::uint64_t value_ = 0;
};

[[nodiscard]] can::Frame and_iurs(unsigned phase, AndAddress prefix) noexcept;
[[nodiscard]] can::Frame and_dirs(AndAddress address) noexcept;
/// `state`: unknown or identified.
[[nodiscard]] can::Frame and_switch_global(nodeid::Identification state) noexcept;
[[nodiscard]] can::Frame and_switch_selective(AndAddress address, nodeid::Identification target) noexcept;
/// Part 0: vendor and product; 1: revision and serial number.
[[nodiscard]] can::Frame and_inquire(unsigned part) noexcept;
[[nodiscard]] can::Frame and_ius(std::uint8_t nibble) noexcept;
[[nodiscard]] can::Frame and_dis(std::uint8_t nibble) noexcept;
[[nodiscard]] can::Frame and_address(const LssAddress& address, unsigned part) noexcept;

/// A decoded request, for the slave.
struct AndRequest {
  enum class Kind : std::uint8_t { identify, direct, switch_global, switch_selective, inquire };
  Kind kind = Kind::identify;
  std::uint8_t phase = 0;  ///< identify: 0..11; inquire: the part
  AndAddress address{};    ///< identify, direct, switch_selective
  nodeid::Identification target = nodeid::Identification::unknown;
};
/// Empty: no request.
[[nodiscard]] std::optional<AndRequest> decode_and_request(const can::Frame& frame) noexcept;

/// A decoded answer, for the master.
struct AndAnswer {
  enum class Kind : std::uint8_t { ius, dis, address };
  Kind kind = Kind::ius;
  std::uint8_t nibble = 0;              ///< ius, dis; address: the part
  std::uint32_t first = 0, second = 0;  ///< address: the two parts
};
[[nodiscard]] std::optional<AndAnswer> decode_and_answer(const can::Frame& frame) noexcept;

}  // namespace berth::research
