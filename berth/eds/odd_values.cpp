#include "berth/eds/odd_values.hpp"

#include <fmt/format.h>

#include <charconv>
#include <cmath>

#include "berth/base/words.hpp"

namespace berth::eds {
namespace {

using od::DataType;

constexpr std::string_view node_id_word = "$NODEID";

std::string_view without_blanks(std::string_view text) noexcept {
  const auto first = text.find_first_not_of(" \t");
  return first == std::string_view::npos ? std::string_view()
                                         : text.substr(first, text.find_last_not_of(" \t") - first + 1);
}

bool is_suffix(char c) noexcept { return c == 'u' || c == 'U' || c == 'l' || c == 'L'; }

// "0x12ULL", "100L", "08": one number without a sign. Empty: this is no number.
std::optional<std::uint64_t> term(std::string_view text) {
  while (!text.empty() && is_suffix(text.back())) text.remove_suffix(1);
  const bool hex = text.starts_with("0x") || text.starts_with("0X");
  if (hex) text.remove_prefix(2);
  std::uint64_t value = 0;
  const auto [end, bad] = std::from_chars(text.data(), text.data() + text.size(), value, hex ? 16 : 10);
  if (text.empty() || bad != std::errc{} || end != text.data() + text.size()) return std::nullopt;
  return value;
}

// A sum such as "0x180+1", after $NODEID or alone.
std::optional<std::uint64_t> sum_of(std::string_view text) {
  std::uint64_t sum = 0;
  while (!text.empty()) {
    const auto plus = text.find('+');
    const auto value = term(without_blanks(text.substr(0, plus)));
    if (!value || *value > ~std::uint64_t{0} - sum) return std::nullopt;
    sum += *value;
    if (plus == std::string_view::npos) return sum;
    text.remove_prefix(plus + 1);
  }
  return std::nullopt;
}

std::optional<std::string> whole_number(std::string_view text) {
  double value = 0;
  const auto [end, bad] = std::from_chars(text.data(), text.data() + text.size(), value);
  const bool read = bad == std::errc{} && end == text.data() + text.size();
  constexpr double most = 9e15;  // up to here a double holds each whole number exactly
  if (!read || std::trunc(value) != value || std::abs(value) > most) return std::nullopt;
  return fmt::format("{}", static_cast<std::int64_t>(value));
}

}  // namespace

std::optional<std::string> plain_sense(DataType type, std::string_view text) {
  text = without_blanks(text);
  if (!od::is_integer(type) || text.empty()) return std::nullopt;
  if (type == DataType::boolean && same_word(text, "true")) return "1";
  if (type == DataType::boolean && same_word(text, "false")) return "0";
  const bool by_node = same_word(text.substr(0, node_id_word.size()), node_id_word);
  if (by_node) {
    const std::string_view rest = without_blanks(text.substr(node_id_word.size()));
    const auto sum = rest.starts_with('+') ? sum_of(rest.substr(1)) : std::nullopt;
    return sum ? std::optional(fmt::format("$NODEID+0x{:X}", *sum)) : std::nullopt;
  }
  const bool minus = text.starts_with('-');
  if (const auto sum = sum_of(minus ? text.substr(1) : text)) return fmt::format("{}{}", minus ? "-" : "", *sum);
  return whole_number(text);
}

Understood understand(DataType type, std::string_view text) {
  auto parsed = od::parse(type, text);
  auto plain = parsed ? std::nullopt : plain_sense(type, text);
  auto again = plain ? od::parse(type, *plain) : parsed;
  if (!plain || !again) return {std::move(parsed)};
  return {std::move(again), std::move(plain)};
}

}  // namespace berth::eds
