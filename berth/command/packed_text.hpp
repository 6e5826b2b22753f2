/// Files within requests and answers: a zlib stream (RFC 1950) in hexadecimal digits.
#pragma once

#include <string>
#include <string_view>

#include "berth/command/checked.hpp"

namespace berth::command {

[[nodiscard]] std::string packed(std::string_view text);
/// Of a stream: its bytes in hexadecimal digits.
[[nodiscard]] std::string digits_of(std::string_view stream);
/// Refuses more than 4 MiB of text.
[[nodiscard]] Checked<std::string> unpacked(const std::string& digits);

}  // namespace berth::command
