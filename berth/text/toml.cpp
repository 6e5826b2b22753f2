#include "berth/text/toml.hpp"

#include <fmt/format.h>

#include <toml++/toml.h>
#include <algorithm>

namespace berth::text {
namespace {

Place place(const toml::source_position& p) noexcept { return {static_cast<int>(p.line), static_cast<int>(p.column)}; }

void fill_place(Value& value, const toml::node& node) {
  value.begin = place(node.source().begin);
  value.end = place(node.source().end);
}

Value convert(const toml::node& node);

Value convert_array(const toml::array& array) {
  Value value;
  value.kind = Value::Kind::array;
  for (const auto& item : array) value.items.push_back(convert(item));
  const bool headers =
      !value.items.empty() && value.items.front().kind == Value::Kind::table && !value.items.front().in_line;
  value.in_line = !headers;
  return value;
}

Value convert_table(const toml::table& table) {
  Value value;
  value.kind = Value::Kind::table;
  value.in_line = table.is_inline();
  for (const auto& [key, item] : table) {
    value.members.push_back({std::string(key.str()), place(key.source().begin), convert(item)});
  }
  std::ranges::stable_sort(value.members, {}, &Member::place);
  return value;
}

Value convert(const toml::node& node) {
  Value value;
  if (const auto* table = node.as_table()) {
    value = convert_table(*table);
  } else if (const auto* array = node.as_array()) {
    value = convert_array(*array);
  } else if (const auto* string = node.as_string()) {
    value.kind = Value::Kind::string;
    value.string = string->get();
  } else if (const auto* integer = node.as_integer()) {
    value.kind = Value::Kind::integer;
    value.integer = integer->get();
  } else if (const auto* real = node.as_floating_point()) {
    value.kind = Value::Kind::real;
    value.real = real->get();
  } else if (const auto* boolean = node.as_boolean()) {
    value.kind = Value::Kind::boolean;
    value.boolean = boolean->get();
  } else {
    value.kind = Value::Kind::date;
  }
  fill_place(value, node);
  return value;
}

// The place of a key with more parts than any file of ours has. The parser and its tables are recursive and would use
// up the stack; the parser's own limit covers nested values only.
std::optional<Place> too_deep(std::string_view text) noexcept {
  constexpr std::size_t most = 256;
  Place at{1, 0};
  std::size_t dots = 0;
  bool comment = false;
  for (const char c : text) {
    if (c == '\n') {
      at = {at.line + 1, 0};
      dots = 0;
      comment = false;
      continue;
    }
    ++at.column;
    if (c == '#') comment = true;
    if (c == '=' || c == ',' || comment) dots = 0;
    if (c == '.' && !comment && ++dots > most) return at;
  }
  return std::nullopt;
}

// Each value and each line costs the parser some hundred bytes.
std::optional<Place> too_long(std::string_view text) noexcept {
  constexpr std::size_t most = 80'000;
  Place at{1, 0};
  std::size_t seen = 0;
  for (const char c : text) {
    ++at.column;
    if (c != '\n' && c != ',') continue;
    if (++seen > most) return at;
    if (c == '\n') at = {at.line + 1, 0};
  }
  return std::nullopt;
}

}  // namespace

const Value* Value::find(std::string_view key) const noexcept {
  const auto it = std::ranges::find(members, key, &Member::key);
  return it == members.end() ? nullptr : &it->value;
}

bool same(const Value& a, const Value& b) noexcept {
  if (a.kind != b.kind) return false;
  switch (a.kind) {
    case Value::Kind::string: return a.string == b.string;
    case Value::Kind::integer: return a.integer == b.integer;
    case Value::Kind::real: return a.real == b.real || (a.real != a.real && b.real != b.real);
    case Value::Kind::boolean: return a.boolean == b.boolean;
    case Value::Kind::date: return true;
    case Value::Kind::array: return std::ranges::equal(a.items, b.items, same);
    case Value::Kind::table: break;
  }
  return a.members.size() == b.members.size() && std::ranges::all_of(a.members, [&](const Member& member) {
           const Value* other = b.find(member.key);
           return other != nullptr && same(member.value, *other);
         });
}

const char* name(Value::Kind kind) noexcept {
  switch (kind) {
    case Value::Kind::string: return "a string";
    case Value::Kind::integer: return "an integer";
    case Value::Kind::real: return "a decimal number";
    case Value::Kind::boolean: return "true or false";
    case Value::Kind::date: return "a date or time";
    case Value::Kind::array: return "an array";
    case Value::Kind::table: return "a table";
  }
  return "a value";
}

std::optional<Value> parse_toml(std::string_view text, const std::string& file, Findings& findings) {
  if (const auto deep = too_deep(text)) {
    findings.push_back({Finding::Severity::error, file, deep->line, deep->column, "", "a row of more than 256 dots",
                        "tables are not nested so deep here"});
    return std::nullopt;
  }
  if (const auto end = too_long(text)) {
    findings.push_back({Finding::Severity::error, file, end->line, end->column, "",
                        "more than 80,000 lines and values up to here", "no file of a machine or plant is so long"});
    return std::nullopt;
  }
  try {
    return convert(toml::parse(text, file));
  } catch (const toml::parse_error& error) {
    const Place at = place(error.source().begin);
    std::string what(error.description());
    // A string without its closing quote goes on to the end of its line, which no string may contain.
    const std::size_t where = offset_of(text, at);
    const bool at_line_end = where >= text.size() || text[where] == '\n' || text[where] == '\r';
    if (at_line_end && what.find("unescaped control character") != std::string::npos) {
      findings.push_back({Finding::Severity::error, file, at.line, at.column, "", "closing quote missing",
                          "end the text with a quote on this line"});
      return std::nullopt;
    }
    const bool twice = what.find("cannot redefine existing table") != std::string::npos;
    findings.push_back(
        {Finding::Severity::error, file, at.line, at.column, "", what,
         twice ? "what comes several times has two brackets, such as [[slot]]" : "correct the TOML syntax here"});
    return std::nullopt;
  }
}

std::size_t offset_of(std::string_view text, Place place) noexcept {
  std::size_t at = text.starts_with("\xEF\xBB\xBF") ? 3 : 0;
  for (int line = 1; line < place.line; ++line) {
    const auto newline = text.find('\n', at);
    if (newline == std::string_view::npos) return text.size();
    at = newline + 1;
  }
  for (int column = 1; column < place.column && at < text.size(); ++column) {
    ++at;
    while (at < text.size() && (static_cast<unsigned char>(text[at]) & 0xC0U) == 0x80U) ++at;
  }
  return at;
}

}  // namespace berth::text
