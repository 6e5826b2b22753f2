#include "berth/base/ids.hpp"

#include <fmt/format.h>

#include <algorithm>
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

bool Identity::agrees(const Identity& other) const noexcept {
  for (unsigned i = 0; i < 4; ++i) {
    if (knows(i) && other.knows(i) && address.part(i) != other.address.part(i)) return false;
  }
  return true;
}

std::string to_string(const Identity& identity) {
  std::string text = to_string(identity.address);
  for (unsigned i = 0; i < 4; ++i) {
    if (!identity.knows(i)) text.replace(std::size_t{9} * i, 8, "xxxxxxxx");
  }
  if (identity.at.configured()) text += fmt::format("@{}", identity.at.value());
  return text;
}

std::optional<Identity> parse_identity(std::string_view text) {
  constexpr std::string_view unsaid = "xxxxxxxx";
  const auto behind = text.find('@');
  std::string_view parts = text.substr(0, behind);
  std::string numbers;
  Identity identity;
  for (unsigned i = 0; i < 4; ++i) {
    const auto dash = i < 3 ? parts.find('-') : parts.size();
    if (dash == std::string_view::npos) return std::nullopt;
    const bool unknown = parts.substr(0, dash) == unsaid;
    if (unknown) identity.unknown = static_cast<std::uint8_t>(identity.unknown | 1U << i);
    numbers += unknown ? "0" : parts.substr(0, dash);
    if (i < 3) numbers += '-';
    parts.remove_prefix(std::min(dash + 1, parts.size()));
  }
  const auto address = parse_lss_address(numbers);
  if (!address) return std::nullopt;
  identity.address = *address;
  if (behind == std::string_view::npos) return identity;
  unsigned id = 0;
  const auto digits = text.substr(behind + 1);
  const auto [end, error] = std::from_chars(digits.data(), digits.data() + digits.size(), id);
  const bool good = error == std::errc{} && end == digits.data() + digits.size() && id >= 1 && id <= 127;
  if (!good || identity.has_serial()) return std::nullopt;
  identity.at = NodeId(static_cast<std::uint8_t>(id));
  return identity;
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
