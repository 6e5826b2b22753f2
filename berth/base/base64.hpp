/// Base64 (RFC 4648 §4), without line breaks.
#pragma once

#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

namespace berth {

[[nodiscard]] std::string to_base64(std::span<const std::uint8_t> bytes);
/// Empty: not Base64. Padding and unused bits are checked.
[[nodiscard]] std::optional<std::vector<std::uint8_t>> from_base64(std::string_view text);

}  // namespace berth
