#include "berth/base/ids.hpp"

#include <fmt/format.h>

#include <charconv>

namespace berth {

std::string to_string(const LssAddress& a) {
  return fmt::format("{:08X}-{:08X}-{:08X}-{:08X}", a.vendor, a.product, a.revision, a.serial);
}

std::string to_string(const TypeCode& type) { return fmt::format("{:08X}-{:08X}", type.vendor, type.product); }

std::optional<LssAddress> parse_lss_address(std::string_view text) {
  std::array<std::uint32_t, 4> parts{};
  for (std::size_t i = 0; i < parts.size(); ++i) {
    const auto dash = text.find('-');
    if ((dash == std::string_view::npos) != (i == 3)) return std::nullopt;
    auto digits = text.substr(0, dash);
    if (digits.starts_with("0x") || digits.starts_with("0X")) digits.remove_prefix(2);
    if (digits.empty() || digits.size() > 8) return std::nullopt;
    const auto [end, error] = std::from_chars(digits.data(), digits.data() + digits.size(), parts[i], 16);
    if (error != std::errc{} || end != digits.data() + digits.size()) return std::nullopt;
    if (i < 3) text.remove_prefix(dash + 1);
  }
  return LssAddress{parts[0], parts[1], parts[2], parts[3]};
}

const char* name(NmtState state) noexcept {
  switch (state) {
    case NmtState::initialising: return "initialising";
    case NmtState::stopped: return "stopped";
    case NmtState::operational: return "operational";
    case NmtState::pre_operational: return "pre-operational";
  }
  return "unknown";
}

}  // namespace berth
