#include "berth/design/differences.hpp"

#include <fmt/format.h>

#include <algorithm>

namespace berth::design {
namespace {

using text::Value;

bool is_of_tables(const Value& value) noexcept {
  return value.kind == Value::Kind::array && !value.items.empty() &&
         std::ranges::all_of(value.items, [](const Value& each) { return each.kind == Value::Kind::table; });
}

// "s5", or "[2]" for the third one without a name.
std::string name_of(const Value& table, std::size_t number) {
  const Value* const name = table.find("name");
  const bool named = name != nullptr && name->kind == Value::Kind::string;
  return named ? name->string : fmt::format("[{}]", number);
}

class Comparison {
 public:
  std::vector<Difference> found;

  void compare(const Value& before, const Value& now, const std::string& table) {
    for (const auto& member : now.members) {
      const Value* const old = before.find(member.key);
      if (old == nullptr) {
        came(table, member);
      } else if (!same(*old, member.value)) {
        changed(table, member, *old);
      }
    }
    for (const auto& member : before.members) {
      if (now.find(member.key) != nullptr) continue;
      const bool tables = member.value.kind == Value::Kind::table && !member.value.in_line;
      if (is_of_tables(member.value)) {
        const Value none;
        compare_tables(member.value, none, member.key, now.begin);
      } else if (tables) {
        found.push_back({.table = within(table, member.key), .key = {}, .place = now.begin, .went = true});
      } else {
        found.push_back({.table = table, .key = member.key, .place = now.begin, .went = true});
      }
    }
  }

 private:
  static std::string within(const std::string& table, const std::string& key) {
    return table.empty() ? key : table + "." + key;
  }

  void came(const std::string& table, const text::Member& member) {
    const bool is_table = member.value.kind == Value::Kind::table && !member.value.in_line;
    if (is_of_tables(member.value) && !member.value.in_line) {
      const Value none;
      return compare_tables(none, member.value, member.key, member.place);
    }
    found.push_back({.table = is_table ? within(table, member.key) : table,
                     .key = is_table ? std::string() : member.key,
                     .place = member.place,
                     .came = true});
  }

  void changed(const std::string& table, const text::Member& member, const Value& old) {
    const Value& value = member.value;
    const bool both_tables = value.kind == Value::Kind::table && old.kind == Value::Kind::table && !value.in_line;
    if (both_tables) return compare(old, value, within(table, member.key));
    const bool lists = is_of_tables(value) && is_of_tables(old) && !value.in_line;
    if (lists) return compare_tables(old, value, member.key, member.place);
    found.push_back({.table = table, .key = member.key, .place = member.place});
  }

  void compare_tables(const Value& before, const Value& now, const std::string& kind, text::Place place) {
    const auto named = [](const Value& list, const std::string& name) -> const Value* {
      for (std::size_t i = 0; i < list.items.size(); ++i) {
        if (name_of(list.items[i], i) == name) return &list.items[i];
      }
      return nullptr;
    };
    for (std::size_t i = 0; i < now.items.size(); ++i) {
      const std::string name = name_of(now.items[i], i);
      const std::string table = kind + " " + name;
      const Value* const old = named(before, name);
      if (old != nullptr) {
        compare(*old, now.items[i], table);
      } else {
        found.push_back({.table = table, .key = {}, .place = now.items[i].begin, .came = true});
      }
    }
    for (std::size_t i = 0; i < before.items.size(); ++i) {
      const std::string name = name_of(before.items[i], i);
      if (named(now, name) == nullptr)
        found.push_back({.table = kind + " " + name, .key = {}, .place = place, .went = true});
    }
  }
};

}  // namespace

std::string to_string(const Difference& difference) {
  const std::string where = difference.key.empty()     ? difference.table
                            : difference.table.empty() ? difference.key
                                                       : difference.table + ": " + difference.key;
  return where + (difference.came ? " is new" : difference.went ? " is gone" : "");
}

std::vector<Difference> differences(const Value& before, const Value& now) {
  Comparison comparison;
  comparison.compare(before, now, {});
  return std::move(comparison.found);
}

}  // namespace berth::design
