#include "berth/campaign/seeds.hpp"

#include <charconv>

namespace berth::campaign {
namespace {

std::optional<std::uint64_t> number(std::string_view text) noexcept {
  std::uint64_t value = 0;
  const char* const end = text.data() + text.size();
  const auto [at, bad] = std::from_chars(text.data(), end, value);
  if (text.empty() || bad != std::errc{} || at != end) return std::nullopt;
  return value;
}

}  // namespace

std::optional<Seeds> parse_seeds(std::string_view text) noexcept {
  const auto dots = text.find("..");
  const auto first = number(text.substr(0, dots));
  const auto last = dots == std::string_view::npos ? first : number(text.substr(dots + 2));
  if (!first || !last || *last < *first) return std::nullopt;
  return Seeds{*first, *last};
}

}  // namespace berth::campaign
