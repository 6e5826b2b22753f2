#include "berth/eds/xdd_words.hpp"

#include <fmt/format.h>

#include <algorithm>

#include "berth/eds/document.hpp"

namespace berth::eds::xml {
namespace {

/// Compares with a pattern: `0` stands for any digit.
bool like(std::string_view text, std::string_view pattern) noexcept {
  return text.size() == pattern.size() &&
         std::ranges::equal(text, pattern, [](char c, char p) { return p == '0' ? c >= '0' && c <= '9' : c == p; });
}

unsigned two(std::string_view text, std::size_t at) noexcept {
  return static_cast<unsigned>(text[at] - '0') * 10 + static_cast<unsigned>(text[at + 1] - '0');
}

}  // namespace

std::string eds_date(std::string_view xml) {
  const std::string_view date = xml.substr(0, 10);
  if (!like(date, "0000-00-00")) return {};
  return fmt::format("{}-{}-{}", date.substr(5, 2), date.substr(8, 2), date.substr(0, 4));
}

std::string xml_date(std::string_view eds) {
  if (!like(eds, "00-00-0000")) return {};
  return fmt::format("{}-{}-{}", eds.substr(6, 4), eds.substr(0, 2), eds.substr(3, 2));
}

std::string eds_time(std::string_view xml) {
  const std::string_view time = xml.substr(0, 5);
  if (!like(time, "00:00") || two(time, 0) > 23 || two(time, 3) > 59) return {};
  const unsigned hour = two(time, 0);
  return fmt::format("{:02}:{}{}", hour % 12 == 0 ? 12 : hour % 12, time.substr(3, 2), hour < 12 ? "AM" : "PM");
}

// Accepts an hour of one digit, too, as many files have it.
std::string xml_time(std::string_view eds) {
  if (eds.size() == 6) return xml_time("0" + std::string(eds));
  const bool afternoon = eds.size() == 7 && same_word(eds.substr(5), "PM");
  const bool morning = eds.size() == 7 && same_word(eds.substr(5), "AM");
  if ((!afternoon && !morning) || !like(eds.substr(0, 5), "00:00")) return {};
  const unsigned hour = two(eds, 0);
  if (hour < 1 || hour > 12 || two(eds, 3) > 59) return {};
  return fmt::format("{:02}:{}:00", hour % 12 + (afternoon ? 12 : 0), eds.substr(3, 2));
}

std::optional<std::uint16_t> kilobits(std::string_view text) {
  std::size_t at = 0;
  std::uint32_t value = 0;
  while (at < text.size() && text[at] >= '0' && text[at] <= '9' && value <= 0xFFFF) {
    value = value * 10 + static_cast<std::uint32_t>(text[at++] - '0');
  }
  if (at == 0 || value == 0 || value > 0xFFFF) return std::nullopt;
  std::string_view unit = text.substr(at);
  while (!unit.empty() && unit.front() == ' ') unit.remove_prefix(1);
  if (!unit.empty() && !same_word(unit, "Kbps") && !same_word(unit, "kbit/s")) return std::nullopt;
  return static_cast<std::uint16_t>(value);
}

}  // namespace berth::eds::xml
