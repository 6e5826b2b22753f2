/// The image of a program for Berth's own devices (docs/programs.md): a head that names its product and its check
/// values, and the program itself. Little-endian:
///
///     image = head | content
///     head  = "BPRG" | vendor-ID U32 | product code U32 | date U32 (days since 1984-01-01) | time U32 (ms) |
///             length of the content U32 | CRC-32 of the content | CRC-32 of the 28 bytes before
#pragma once

#include <array>
#include <cstdint>
#include <span>
#include <vector>

#include "berth/base/ids.hpp"
#include "berth/base/result.hpp"

namespace berth::device {

struct ProgramHead {
  static constexpr std::size_t size = 32;  ///< bytes
  TypeCode type;                           ///< 0, 0: for any product
  std::uint32_t date = 0;                  ///< 1F52h:01; 0: unknown
  std::uint32_t time = 0;                  ///< 1F52h:02
  std::uint32_t length = 0;                ///< bytes of content
  std::uint32_t crc = 0;                   ///< of the content; also the program's identification (1F56h)

  friend bool operator==(const ProgramHead&, const ProgramHead&) noexcept = default;
};

/// Reads a head. Errc::invalid: fewer than 32 bytes, other first letters, or its own CRC is wrong.
[[nodiscard]] Result<ProgramHead> read_program_head(std::span<const std::uint8_t> bytes) noexcept;
/// The head of a program as bytes, with length and CRC as given.
[[nodiscard]] std::array<std::uint8_t, ProgramHead::size> write_program_head(const ProgramHead& head) noexcept;

/// A whole image.
[[nodiscard]] std::vector<std::uint8_t> make_program_image(ProgramHead head, std::span<const std::uint8_t> content);

}  // namespace berth::device
