#include "berth/can/frame.hpp"

#include <fmt/format.h>

#include <charconv>

#include "berth/can/length.hpp"

namespace berth::can {
namespace {

template <class T>
bool read_hex(std::string_view digits, T& value) {
  const auto [end, error] = std::from_chars(digits.data(), digits.data() + digits.size(), value, 16);
  return error == std::errc{} && end == digits.data() + digits.size() && !digits.empty();
}

bool read_data(std::string_view digits, Frame& frame, std::size_t limit) {
  if (digits.size() % 2 != 0 || digits.size() / 2 > limit) return false;
  for (std::size_t i = 0; i < digits.size() / 2; ++i) {
    if (!read_hex(digits.substr(2 * i, 2), frame.data[i])) return false;
  }
  frame.size = static_cast<std::uint8_t>(digits.size() / 2);
  return true;
}

}  // namespace

std::string to_string(const Frame& f) {
  std::string out = f.extended ? fmt::format("{:08X}#", f.id) : fmt::format("{:03X}#", f.id);
  if (f.remote) return out + 'R' + (f.size > 0 ? fmt::format("{}", f.size) : std::string());
  if (f.fd) out += fmt::format("#{:X}", (f.brs ? 1U : 0U) | (f.esi ? 2U : 0U));
  for (const auto byte : f.bytes()) out += fmt::format("{:02X}", byte);
  return out;
}

std::optional<Frame> parse_frame(std::string_view text) {
  const auto hash = text.find('#');
  if (hash > 8) return std::nullopt;  // too long, or none at all (npos)
  Frame f;
  if (!read_hex(text.substr(0, hash), f.id)) return std::nullopt;
  f.extended = hash > 3;
  if (f.id > (f.extended ? extended_mask : base_mask)) return std::nullopt;
  auto rest = text.substr(hash + 1);
  if (rest.starts_with('R')) {
    f.remote = true;
    rest.remove_prefix(1);
    if (rest.empty()) return f;
    if (rest.size() != 1 || rest[0] < '0' || rest[0] > '8') return std::nullopt;
    f.size = static_cast<std::uint8_t>(rest[0] - '0');
    return f;
  }
  if (rest.starts_with('#')) {
    unsigned flags = 0;
    if (rest.size() < 2 || !read_hex(rest.substr(1, 1), flags)) return std::nullopt;
    f.fd = true;
    f.brs = (flags & 1U) != 0;
    f.esi = (flags & 2U) != 0;
    if (!read_data(rest.substr(2), f, 64) || !fd_dlc(f.size)) return std::nullopt;
    return f;
  }
  if (!read_data(rest, f, 8)) return std::nullopt;
  return f;
}

}  // namespace berth::can
