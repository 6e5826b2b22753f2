#include "berth/design/edit.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <utility>

#include "berth/text/toml.hpp"

namespace berth::design {
namespace {

using text::Member;
using text::Place;
using text::Value;

bool bare_key(std::string_view key) noexcept {
  const auto fits = [](char c) {
    return (c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z') || (c >= '0' && c <= '9') || c == '_' || c == '-';
  };
  return !key.empty() && std::ranges::all_of(key, fits);
}

std::string rendered(const NewValue& value) {
  if (const auto* string = std::get_if<std::string>(&value)) return text::quoted(*string);
  if (const auto* number = std::get_if<std::int64_t>(&value)) return fmt::format("{}", *number);
  if (const auto* flag = std::get_if<bool>(&value)) return *flag ? "true" : "false";
  if (const auto* strings = std::get_if<std::vector<std::string>>(&value)) {
    std::string list;
    for (const auto& each : *strings) list += (list.empty() ? "" : ", ") + text::quoted(each);
    return "[" + list + "]";
  }
  const auto& type = std::get<TypeCode>(value);
  return fmt::format("{{ vendor = 0x{:08X}, product = 0x{:08X} }}", type.vendor, type.product);
}

Value number(std::int64_t n) {
  Value value;
  value.kind = Value::Kind::integer;
  value.integer = n;
  return value;
}

Value as_value(const NewValue& given) {
  Value value;
  if (const auto* string = std::get_if<std::string>(&given)) {
    value.kind = Value::Kind::string;
    value.string = *string;
  } else if (const auto* n = std::get_if<std::int64_t>(&given)) {
    value = number(*n);
  } else if (const auto* flag = std::get_if<bool>(&given)) {
    value.kind = Value::Kind::boolean;
    value.boolean = *flag;
  } else if (const auto* strings = std::get_if<std::vector<std::string>>(&given)) {
    value.kind = Value::Kind::array;
    for (const auto& each : *strings) {
      value.items.emplace_back().kind = Value::Kind::string;
      value.items.back().string = each;
    }
  } else {
    const auto& type = std::get<TypeCode>(given);
    value.members.push_back({"vendor", {}, number(type.vendor)});
    value.members.push_back({"product", {}, number(type.product)});
  }
  return value;
}

Result<Value> parse(std::string_view text) {
  Findings findings;
  auto root = text::parse_toml(text, "", findings);
  if (!root) return fail(Errc::invalid, "the text is not TOML");
  return std::move(*root);
}

std::string text_of(const Value& slot, std::string_view key) {
  const Value* value = slot.find(key);
  return value != nullptr && value->kind == Value::Kind::string ? value->string : std::string();
}

std::vector<unsigned> ids_of(const Value& slot) {
  if (const auto ids = text_of(slot, "ids"); !ids.empty()) {
    return text::parse_ranges(ids, 1, 127).value_or(std::vector<unsigned>{});
  }
  const Value* id = slot.find("id");
  if (id == nullptr || id->kind != Value::Kind::integer || id->integer < 1 || id->integer > 127) return {};
  return {static_cast<unsigned>(id->integer)};
}

bool range_holds(const Value& slot, std::string_view name) {
  const auto pattern = text_of(slot, "name");
  return slot.find("ids") != nullptr && std::ranges::any_of(ids_of(slot), [&](unsigned id) {
           return text::fill(pattern, "id", fmt::format("{}", id)) == name;
         });
}

Value* slots_of(Value& root) noexcept {
  const auto it = std::ranges::find(root.members, std::string_view("slot"), &Member::key);
  return it == root.members.end() ? nullptr : &it->value;
}

Result<Value*> find_slot(Value& root, std::string_view name) {
  Value* slots = slots_of(root);
  Value* found = nullptr;
  bool in_range = false;
  if (slots != nullptr) {
    for (auto& slot : slots->items) {
      const bool named = text_of(slot, "name") == name && slot.find("name") != nullptr;
      in_range = in_range || (!named && range_holds(slot, name));
      if (!named) continue;
      if (found != nullptr) return fail(Errc::duplicate, "two slots have this name");
      found = &slot;
    }
  }
  if (found != nullptr) return found;
  if (in_range) return fail(Errc::unsupported, "the slot is one of a range; give it a [[slot]] of its own first");
  return fail(Errc::not_found, "there is no slot of this name");
}

Result<std::string> checked(std::string text, const Value& expected) {
  const auto again = parse(text);
  if (!again || !text::same(*again, expected)) return fail(Errc::invalid, "the edit would not read back as meant");
  return text;
}

/// The place after the last character of the value and of everything in it.
Place end_of(const Value& value) noexcept {
  Place end = std::max(value.begin, value.end);
  for (const auto& item : value.items) end = std::max(end, end_of(item));
  for (const auto& member : value.members) end = std::max({end, member.place, end_of(member.value)});
  return end;
}

/// The last member in the table's own lines, not under a header of its own.
const Member* last_own_member(const Value& table) noexcept {
  const Member* last = nullptr;
  for (const auto& member : table.members) {
    const auto& v = member.value;
    const bool under_header = (v.kind == Value::Kind::table || v.kind == Value::Kind::array) && !v.in_line;
    if (!under_header) last = &member;
  }
  return last;
}

/// The file's kind of line end.
std::string_view newline_of(std::string_view text) noexcept {
  const auto at = text.find('\n');
  return at != std::string_view::npos && at > 0 && text[at - 1] == '\r' ? "\r\n" : "\n";
}

/// The place after the line break of the line that contains `at`; the end of the text if that line has none.
std::size_t next_line(std::string_view text, std::size_t at) noexcept {
  const auto newline = text.find('\n', at);
  return newline == std::string_view::npos ? text.size() : newline + 1;
}

/// The spaces and tabs before a key; "" if anything else is before it on the line.
std::string indent_of(std::string_view text, std::size_t key) {
  const auto newline = key == 0 ? std::string_view::npos : text.rfind('\n', key - 1);
  const std::size_t line = newline == std::string_view::npos ? 0 : newline + 1;
  const auto before = text.substr(line, key - line);
  return before.find_first_not_of(" \t") == std::string_view::npos ? std::string(before) : std::string();
}

/// Inserts whole lines (each with its line break) before the line after `at`.
std::string with_lines(std::string_view text, std::size_t at, const std::string& lines) {
  const auto place = next_line(text, at);
  std::string out(text.substr(0, place));
  if (!out.empty() && out.back() != '\n') out += newline_of(text);
  out += lines;
  out += text.substr(place);
  return out;
}

std::string insert_key(std::string_view text, const Value& slot, std::string_view key, const std::string& value) {
  const Member* last = last_own_member(slot);
  if (slot.in_line && last != nullptr) {
    const auto at = text::offset_of(text, last->value.end);
    return fmt::format("{}, {} = {}{}", text.substr(0, at), key, value, text.substr(at));
  }
  const auto at = text::offset_of(text, last == nullptr ? slot.begin : last->value.end);
  const auto indent = last == nullptr ? std::string() : indent_of(text, text::offset_of(text, last->place));
  return with_lines(text, at, fmt::format("{}{} = {}{}", indent, key, value, newline_of(text)));
}

/// Sets a key of a table of `root`, whose text is `text`.
Result<std::string> with_key(std::string_view text, const Value& root, Value& table, std::string_view key,
                             const NewValue& value) {
  const auto member = std::ranges::find(table.members, key, &Member::key);
  if (member == table.members.end()) {
    auto changed = insert_key(text, table, key, rendered(value));
    table.members.push_back({std::string(key), {}, as_value(value)});
    return checked(std::move(changed), root);
  }
  const bool own_header = member->value.kind == Value::Kind::table && !member->value.in_line;
  if (own_header) return fail(Errc::unsupported, "the key is a table with a header of its own");
  const auto begin = text::offset_of(text, member->value.begin);
  const auto end = text::offset_of(text, member->value.end);
  auto changed = fmt::format("{}{}{}", text.substr(0, begin), rendered(value), text.substr(end));
  member->value = as_value(value);
  return checked(std::move(changed), root);
}

bool taken(const Value& slot, const NewSlot& wanted) {
  const auto name = text_of(slot, "name");
  if ((slot.find("ids") == nullptr && name == wanted.name) || range_holds(slot, wanted.name)) return true;
  return text_of(slot, "bus") == wanted.bus && std::ranges::count(ids_of(slot), wanted.id.value()) != 0;
}

std::vector<std::pair<std::string, NewValue>> all_keys(const NewSlot& slot) {
  std::vector<std::pair<std::string, NewValue>> keys{
      {"bus", slot.bus}, {"id", static_cast<std::int64_t>(slot.id.value())}, {"name", slot.name}, {"type", slot.type}};
  keys.insert(keys.end(), slot.more.begin(), slot.more.end());
  return keys;
}

}  // namespace

Result<std::string> set_slot_key(std::string_view text, std::string_view slot_name, std::string_view key,
                                 const NewValue& value) {
  if (!bare_key(key)) return fail(Errc::invalid, "this is not a key");
  auto root = parse(text);
  if (!root) return fail(root.error());
  const auto slot = find_slot(*root, slot_name);
  if (!slot) return fail(slot.error());
  return with_key(text, *root, **slot, key, value);
}

Result<std::string> set_mqtt_key(std::string_view text, std::string_view key, const NewValue& value) {
  if (!bare_key(key)) return fail(Errc::invalid, "this is not a key");
  auto root = parse(text);
  if (!root) return fail(root.error());
  const auto table = std::ranges::find(root->members, std::string_view("mqtt"), &Member::key);
  if (table != root->members.end()) {
    if (table->value.kind != Value::Kind::table) return fail(Errc::unsupported, "mqtt is not a table");
    return with_key(text, *root, table->value, key, value);
  }
  const auto newline = newline_of(text);
  root->members.push_back({"mqtt", {}, {}});
  root->members.back().value.members.push_back({std::string(key), {}, as_value(value)});
  const auto lines = fmt::format("{}[mqtt]{}{} = {}{}", newline, newline, key, rendered(value), newline);
  return checked(with_lines(text, text.size(), lines), *root);
}

Result<std::string> remove_slot_key(std::string_view text, std::string_view slot_name, std::string_view key) {
  auto root = parse(text);
  if (!root) return fail(root.error());
  const auto slot = find_slot(*root, slot_name);
  if (!slot) return fail(slot.error());
  const auto member = std::ranges::find((*slot)->members, key, &Member::key);
  if (member == (*slot)->members.end()) return fail(Errc::not_found, "the slot has no such key");
  const bool own_header = member->value.kind == Value::Kind::table && !member->value.in_line;
  if (own_header || (*slot)->in_line) return fail(Errc::unsupported, "the key is not on a line of its own");
  auto begin = text::offset_of(text, member->place);
  auto end = text::offset_of(text, member->value.end);
  const auto rest = text.substr(end, next_line(text, end) - end);
  if (rest.find_first_not_of(" \t\r\n") == std::string_view::npos) {
    begin -= indent_of(text, begin).size();
    end += rest.size();
  }
  auto changed = fmt::format("{}{}", text.substr(0, begin), text.substr(end));
  (*slot)->members.erase(member);
  return checked(std::move(changed), *root);
}

Result<std::string> add_slot(std::string_view text, const NewSlot& slot) {
  auto root = parse(text);
  if (!root) return fail(root.error());
  Value* slots = slots_of(*root);
  if (slots != nullptr && (slots->kind != Value::Kind::array || slots->in_line)) {
    return fail(Errc::unsupported, "the slots are not written as [[slot]]");
  }
  if (slots == nullptr) {
    root->members.push_back({"slot", {}, {}});
    slots = &root->members.back().value;
    slots->kind = Value::Kind::array;
  }
  if (std::ranges::any_of(slots->items, [&](const Value& other) { return taken(other, slot); })) {
    return fail(Errc::duplicate, "the name or the node-ID is taken");
  }
  const auto newline = newline_of(text);
  std::string lines = fmt::format("{}[[slot]]{}", newline, newline);
  Value added;
  for (const auto& [key, value] : all_keys(slot)) {
    if (!bare_key(key)) return fail(Errc::invalid, "this is not a key");
    lines += fmt::format("{} = {}{}", key, rendered(value), newline);
    added.members.push_back({key, {}, as_value(value)});
  }
  const auto at = slots->items.empty() ? text.size() : text::offset_of(text, end_of(slots->items.back()));
  slots->items.push_back(std::move(added));
  return checked(with_lines(text, at, lines), *root);
}

}  // namespace berth::design
