#include <fmt/format.h>

#include <algorithm>
#include <bit>

#include "berth/text/toml.hpp"

namespace berth::text {
namespace {

bool is_table(const Value& value) noexcept { return value.kind == Value::Kind::table; }

std::string listed(std::span<const std::string_view> words) {
  std::string out;
  for (std::size_t i = 0; i < words.size(); ++i) {
    if (i > 0) out += i + 1 == words.size() ? " or " : ", ";
    out += text::quoted(words[i]);
  }
  return out;
}

std::string range(Limits limits) {
  const auto shown = [](std::int64_t n) {
    return n > 0xFFFF && std::has_single_bit(static_cast<std::uint64_t>(n) + 1) ? fmt::format("0x{:X}", n)
                                                                                : fmt::format("{}", n);
  };
  return fmt::format("use {} to {}", shown(limits.low), shown(limits.high));
}

}  // namespace

std::string Table::full(std::string_view key) const {
  if (path_.empty() || key.empty()) return path_.empty() ? std::string(key) : path_;
  return fmt::format("{}.{}", path_, key);
}

void Table::add(Finding::Severity severity, Place place, std::string_view key, std::string message, std::string fix) {
  findings_.push_back({severity, file_, place.line, place.column, full(key), std::move(message), std::move(fix)});
}

Place Table::place_of(std::string_view key) const noexcept {
  const Value* value = key.empty() ? nullptr : table_.find(key);
  return value == nullptr ? table_.begin : value->begin;
}

void Table::error(std::string_view key, std::string message, std::string fix) {
  add(Finding::Severity::error, place_of(key), key, std::move(message), std::move(fix));
}

void Table::warning(std::string_view key, std::string message, std::string fix) {
  add(Finding::Severity::warning, place_of(key), key, std::move(message), std::move(fix));
}

void Table::wrong_type(std::string_view key, const Value& value, std::string_view wanted) {
  error(key, fmt::format("this is {}", name(value.kind)), fmt::format("it must be {}", wanted));
}

const Value* Table::get(std::string_view key) {
  if (std::ranges::find(known_, key) == known_.end()) known_.emplace_back(key);
  return table_.find(key);
}

bool Table::has(std::string_view key) { return get(key) != nullptr; }

const Value* Table::typed(std::string_view key, Value::Kind kind) {
  const Value* value = get(key);
  if (value == nullptr || value->kind == kind) return value;
  wrong_type(key, *value, name(kind));
  return nullptr;
}

std::optional<std::string> Table::string(std::string_view key) {
  const Value* value = typed(key, Value::Kind::string);
  if (value == nullptr) return std::nullopt;
  return value->string;
}

std::optional<std::int64_t> Table::integer(std::string_view key, Limits limits) {
  const Value* value = typed(key, Value::Kind::integer);
  if (value == nullptr) return std::nullopt;
  if (value->integer < limits.low || value->integer > limits.high) {
    error(key, fmt::format("{} is out of range", value->integer), range(limits));
    return std::nullopt;
  }
  return value->integer;
}

std::optional<std::uint32_t> Table::u32(std::string_view key, Limits limits) {
  const auto value = integer(key, {std::max(limits.low, any_u32.low), std::min(limits.high, any_u32.high)});
  if (!value) return std::nullopt;
  return static_cast<std::uint32_t>(*value);
}

std::optional<bool> Table::boolean(std::string_view key) {
  const Value* value = typed(key, Value::Kind::boolean);
  if (value == nullptr) return std::nullopt;
  return value->boolean;
}

std::optional<Duration> Table::duration(std::string_view key, Duration low, Duration high) {
  const Value* value = get(key);
  if (value == nullptr) return std::nullopt;
  if (value->kind != Value::Kind::string) {
    wrong_type(key, *value, "a string with a unit, such as \"4 ms\"");
    return std::nullopt;
  }
  const auto duration = parse_duration(value->string);
  if (!duration) {
    error(key, fmt::format("{} is not a duration", text::quoted(value->string)),
          "write a number and a unit (ns, us, ms, s, min, h), such as \"4 ms\"");
    return std::nullopt;
  }
  if (*duration < low || *duration > high) {
    error(key, fmt::format("{} is out of range", value->string),
          fmt::format("use {} to {}", write_duration(low), write_duration(high)));
    return std::nullopt;
  }
  return duration;
}

std::optional<std::size_t> Table::word(std::string_view key, std::span<const std::string_view> words) {
  const auto text = string(key);
  if (!text) return std::nullopt;
  const auto it = std::ranges::find(words, *text);
  if (it != words.end()) return static_cast<std::size_t>(it - words.begin());
  const auto near = closest(*text, words);
  error(key, fmt::format("{} is not known here", text::quoted(*text)),
        near.empty() ? "use " + listed(words)
                     : fmt::format("did you mean {}? Use {}", text::quoted(near), listed(words)));
  return std::nullopt;
}

std::optional<std::vector<std::string>> Table::strings(std::string_view key) {
  const Value* array = typed(key, Value::Kind::array);
  if (array == nullptr) return std::nullopt;
  std::vector<std::string> out;
  for (const auto& item : array->items) {
    if (item.kind != Value::Kind::string) {
      add(Finding::Severity::error, item.begin, key, fmt::format("this is {}", name(item.kind)),
          "every item must be a string");
      return std::nullopt;
    }
    out.push_back(item.string);
  }
  return out;
}

std::optional<std::vector<std::int64_t>> Table::integers(std::string_view key, Limits limits) {
  const Value* array = typed(key, Value::Kind::array);
  if (array == nullptr) return std::nullopt;
  std::vector<std::int64_t> out;
  for (const auto& item : array->items) {
    if (item.kind != Value::Kind::integer || item.integer < limits.low || item.integer > limits.high) {
      add(Finding::Severity::error, item.begin, key, "this is not a whole number in range",
          "every item must be an integer: " + range(limits));
      return std::nullopt;
    }
    out.push_back(item.integer);
  }
  return out;
}

std::optional<Table> Table::table(std::string_view key) {
  const Value* value = typed(key, Value::Kind::table);
  if (value == nullptr) return std::nullopt;
  return Table(*value, full(key), file_, findings_);
}

std::vector<Table> Table::tables(std::string_view key) {
  std::vector<Table> out;
  const Value* value = get(key);
  if (value == nullptr) return out;
  if (value->kind != Value::Kind::array || !std::ranges::all_of(value->items, is_table)) {
    wrong_type(key, *value, fmt::format("a list of tables: write [[{}]]", full(key)));
    return out;
  }
  for (const auto& item : value->items) {
    out.emplace_back(item, fmt::format("{}[{}]", full(key), out.size() + 1), file_, findings_);
  }
  return out;
}

std::vector<Table::Item> Table::strings_or_tables(std::string_view key) {
  std::vector<Item> out;
  const Value* array = typed(key, Value::Kind::array);
  if (array == nullptr) return out;
  for (std::size_t i = 0; i < array->items.size(); ++i) {
    const Value& item = array->items[i];
    if (item.kind == Value::Kind::string) {
      out.push_back({item.begin, item.string, std::nullopt});
    } else if (is_table(item)) {
      out.push_back({item.begin, {}, Table(item, fmt::format("{}[{}]", full(key), i + 1), file_, findings_)});
    } else {
      add(Finding::Severity::error, item.begin, key, fmt::format("this is {}", name(item.kind)),
          "every item must be a string or a table");
    }
  }
  return out;
}

std::vector<std::pair<std::string, Table>> Table::named_tables(std::string_view key) {
  std::vector<std::pair<std::string, Table>> out;
  const Value* value = typed(key, Value::Kind::table);
  if (value == nullptr) return out;
  for (const auto& member : value->members) {
    const auto path = fmt::format("{}.{}", full(key), member.key);
    if (is_table(member.value)) {
      out.emplace_back(member.key, Table(member.value, path, file_, findings_));
    } else {
      findings_.push_back({Finding::Severity::error, file_, member.place.line, member.place.column, path,
                           fmt::format("this is {}", name(member.value.kind)),
                           fmt::format("write a table: [{}.NAME]", full(key))});
    }
  }
  return out;
}

bool Table::require(std::string_view key, std::string_view fix) {
  if (has(key)) return true;
  add(Finding::Severity::error, table_.begin, key, "this key is missing", std::string(fix));
  return false;
}

void Table::finish() {
  const std::vector<std::string_view> words(known_.begin(), known_.end());
  for (const auto& member : table_.members) {
    if (std::ranges::find(known_, member.key) != known_.end()) continue;
    const auto near = closest(member.key, words);
    add(Finding::Severity::error, member.place, member.key, "unknown key",
        near.empty() ? "remove it; known here: " + listed(words) : fmt::format("did you mean {}?", text::quoted(near)));
  }
}

}  // namespace berth::text
