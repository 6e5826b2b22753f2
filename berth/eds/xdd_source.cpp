// Elements, attributes and their places in the text.
#include <fmt/format.h>

#include <algorithm>

#include "berth/eds/xdd_reader.hpp"

namespace berth::eds::xml {
namespace {

constexpr bool blank(char c) noexcept { return c == ' ' || c == '\t' || c == '\r' || c == '\n'; }

}  // namespace

std::string_view local(Node node) noexcept {
  const std::string_view name = node.name();
  const auto colon = name.rfind(':');
  return colon == std::string_view::npos ? name : name.substr(colon + 1);
}

Node child(Node node, std::string_view name) noexcept {
  for (const Node each : node.children()) {
    if (local(each) == name) return each;
  }
  return {};
}

std::string_view untrimmed(Node node, std::string_view name) noexcept {
  for (const pugi::xml_attribute each : node.attributes()) {
    if (same_word(each.name(), name)) return each.value();
  }
  return {};
}

std::string_view attribute(Node node, std::string_view name) noexcept { return trimmed(untrimmed(node, name)); }

std::string_view trimmed(std::string_view text) noexcept {
  while (!text.empty() && blank(text.front())) text.remove_prefix(1);
  while (!text.empty() && blank(text.back())) text.remove_suffix(1);
  return text;
}

std::string_view text(Node node) noexcept { return trimmed(node.child_value()); }

std::string_view words_in_english(Node node, std::string_view kind) noexcept {
  for (const Node each : node.children()) {
    if (local(each) == kind && attribute(each, "lang").starts_with("en")) return text(each);
  }
  return words(node, kind);
}

std::string_view words(Node node, std::string_view kind) noexcept { return text(child(node, kind)); }

Source::Source(std::string_view text, bool places, Report& report) : text_(text), places_(places), report_(report) {
  lines_.push_back(0);
  for (std::size_t at = text_.find('\n'); at != std::string_view::npos; at = text_.find('\n', at + 1)) {
    lines_.push_back(at + 1);
  }
}

/// The parser keeps the place of an element, but not of its attributes: those are looked up in the tag.
std::size_t Source::offset(Node node, std::string_view wanted) const noexcept {
  if (!places_ || !node) return std::string_view::npos;
  const std::ptrdiff_t found = node.offset_debug();
  if (found < 0 || static_cast<std::size_t>(found) >= text_.size()) return std::string_view::npos;
  const auto begin = static_cast<std::size_t>(found);
  if (wanted.empty()) return begin;
  std::size_t at = begin;
  while (at < text_.size() && !blank(text_[at]) && text_[at] != '>' && text_[at] != '/') ++at;
  while (at < text_.size() && text_[at] != '>') {
    while (at < text_.size() && (blank(text_[at]) || text_[at] == '/')) ++at;
    const std::size_t name = at;
    while (at < text_.size() && !blank(text_[at]) && text_[at] != '=' && text_[at] != '>') ++at;
    const std::string_view word = text_.substr(name, at - name);
    while (at < text_.size() && (blank(text_[at]) || text_[at] == '=')) ++at;
    if (at >= text_.size() || (text_[at] != '"' && text_[at] != '\'')) return begin;
    const char quote = text_[at++];
    if (same_word(word, wanted)) return at;
    while (at < text_.size() && text_[at] != quote) ++at;
    ++at;
  }
  return begin;
}

Source::Place Source::place(std::size_t offset) const noexcept {
  if (offset == std::string_view::npos) return {};
  const auto after = std::ranges::upper_bound(lines_, offset);
  const auto line = static_cast<std::size_t>(after - lines_.begin());
  return {static_cast<std::uint32_t>(line), static_cast<std::uint32_t>(offset - lines_[line - 1] + 1)};
}

void Source::tell(Severity severity, Node node, std::string_view attribute, std::string key, std::string message,
                  std::string fix) {
  const Place at = place(offset(node, attribute));
  if (!attribute.empty()) key += fmt::format("{}{}", key.empty() ? "" : " ", attribute);
  report_.add(severity, at.line, at.column, std::move(key), std::move(message), std::move(fix));
}

std::optional<std::uint64_t> Source::number(Node node, std::string_view name, std::uint64_t most, bool hex,
                                            const std::string& key, Severity severity) {
  const std::string_view value = attribute(node, name);
  if (value.empty()) return std::nullopt;
  const bool prefixed = value.size() > 1 && value[0] == '0' && (value[1] == 'x' || value[1] == 'X');
  std::string digits(value);
  if (hex && !prefixed) digits.insert(0, "0x");
  // xsd numbers have no octal form: 010 is ten.
  if (!hex && !prefixed) digits.erase(0, std::min(digits.find_first_not_of('0'), digits.size() - 1));
  const auto parsed = od::parse_number(digits);
  if (!parsed || parsed->node_id || parsed->negative || parsed->magnitude > most) {
    const std::string range =
        hex ? fmt::format("a hex number from 0 to {:X}", most) : fmt::format("a number from 0 to {}", most);
    tell(severity, node, name, key, fmt::format("\"{}\" is not {}", value.substr(0, 40), range));
    return std::nullopt;
  }
  return parsed->magnitude;
}

bool Source::flag(Node node, std::string_view name, const std::string& key) {
  const std::string_view value = attribute(node, name);
  if (value.empty() || value == "0" || same_word(value, "false")) return false;
  if (value != "1" && !same_word(value, "true")) {
    tell(Severity::warning, node, name, key,
         fmt::format("\"{}\" is neither true nor false; taken as true", value.substr(0, 20)));
  }
  return true;
}

}  // namespace berth::eds::xml
