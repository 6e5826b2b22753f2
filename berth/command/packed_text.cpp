#include "berth/command/packed_text.hpp"

#include <fmt/format.h>

#include <cstdint>
#include <vector>

#include "berth/manager/stored_dcf.hpp"

namespace berth::command {
namespace {

tl::unexpected<std::string> no_stream() {
  return tl::unexpected<std::string>("dcf is a zlib stream in hexadecimal digits");
}

int nibble(char c) {
  return c >= '0' && c <= '9'   ? c - '0'
         : c >= 'A' && c <= 'F' ? c - 'A' + 10
         : c >= 'a' && c <= 'f' ? c - 'a' + 10
                                : -1;
}

}  // namespace

std::string digits_of(std::string_view stream) {
  std::string digits;
  digits.reserve(2 * stream.size());
  for (const char byte : stream) digits += fmt::format("{:02X}", static_cast<std::uint8_t>(byte));
  return digits;
}

std::string packed(std::string_view text) {
  const auto stream = manager::pack_stored(text);
  return digits_of({reinterpret_cast<const char*>(stream.data()), stream.size()});
}

Checked<std::string> unpacked(const std::string& digits) {
  std::vector<std::uint8_t> bytes;
  for (std::size_t i = 0; i + 1 < digits.size(); i += 2) {
    const int high = nibble(digits[i]);
    const int low = nibble(digits[i + 1]);
    if (high < 0 || low < 0) return no_stream();
    bytes.push_back(static_cast<std::uint8_t>(high * 16 + low));
  }
  auto text = manager::unpack_stored(manager::stored_format::zlib, bytes);
  if (!text || digits.size() % 2 != 0) return no_stream();
  return std::move(*text);
}

}  // namespace berth::command
