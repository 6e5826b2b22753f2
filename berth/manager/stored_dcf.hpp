/// The content of 1F20h (DCF) and 1F23h (EDS) for a slave in a configuration manager: the text as it is, or compressed.
/// The format is in 1F21h and 1F24h (CiA 302-3): 0 is ASCII, 1 to 127 are reserved, 128 to 255 the manufacturer's.
#pragma once

#include <cstdint>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "berth/base/result.hpp"

namespace berth::manager {

/// The formats that Berth's managers support.
namespace stored_format {
inline constexpr std::uint8_t ascii = 0;
inline constexpr std::uint8_t zlib = 128;  ///< the text as a zlib stream (RFC 1950)
}  // namespace stored_format

/// A text that unpacks to more bytes is refused: a few bytes can expand to any length.
inline constexpr std::size_t longest_stored_text = std::size_t{4} << 20U;

/// For `stored_format::zlib`.
[[nodiscard]] std::vector<std::uint8_t> pack_stored(std::string_view text);

/// Errc::unsupported: unknown format. Errc::invalid: no zlib stream, a damaged or incomplete one, one with bytes after
/// it, or a text longer than `longest_stored_text`.
[[nodiscard]] Result<std::string> unpack_stored(std::uint8_t format, std::span<const std::uint8_t> bytes);

}  // namespace berth::manager
