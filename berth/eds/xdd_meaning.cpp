// The meaning of an object's numbers (CiA 311: `unit`, `allowedValues`, enumerated data types of parameters).
#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <charconv>
#include <span>
#include <utility>

#include "berth/eds/xdd_reader.hpp"

namespace berth::eds::xml {
namespace {

constexpr int most_exponent = 18;
constexpr std::size_t most_digits = 9;  // so that a product with 64 bits rarely has more

struct Scale {
  std::int64_t number = 1;
  int exponent = 0;
};

// Reads "0.1", "10", "2.5E-3" exactly, as a whole number and a power of ten.
std::optional<Scale> scale_of(std::string_view text) {
  Scale scale;
  if (text.empty()) return scale;
  if (const auto e = text.find_first_of("eE"); e != std::string_view::npos) {
    std::string_view power = text.substr(e + 1);
    if (power.starts_with('+')) power.remove_prefix(1);
    const auto [end, error] = std::from_chars(power.data(), power.data() + power.size(), scale.exponent);
    if (error != std::errc() || end != power.data() + power.size()) return std::nullopt;
    text = text.substr(0, e);
  }
  std::string digits;
  bool behind_point = false;
  for (const char c : text) {
    if (c == '.' && !behind_point) {
      behind_point = true;
      continue;
    }
    if (c < '0' || c > '9' || scale.exponent < -1000 || scale.exponent > 1000) return std::nullopt;
    digits += c;
    if (behind_point) --scale.exponent;
  }
  for (; digits.size() > 1 && digits.back() == '0'; ++scale.exponent) digits.pop_back();
  digits.erase(0, std::min(digits.find_first_not_of('0'), digits.size()));
  if (digits.empty() || digits.size() > most_digits) return std::nullopt;
  scale.number = std::stoll(digits);
  const bool in_range = scale.exponent >= -most_exponent && scale.exponent <= most_exponent;
  return in_range ? std::optional(scale) : std::nullopt;
}

bool is_one(std::string_view multiplier) {
  const auto scale = scale_of(multiplier);
  return scale && scale->number == 1 && scale->exponent == 0;
}

// The enumerated type of a parameter, also after references; an empty node when it has none.
Node enumeration(Node holder, const NodesById& by_id) {
  Node at = holder;
  for (unsigned deep = 0; at && deep < deepest_reference; ++deep) {
    if (local(at) == "enum") return at;
    if (local(at) == "array" || local(at) == "struct") return {};
    const auto found = by_id.find(attribute(child(at, "dataTypeIDRef"), "uniqueIDRef"));
    at = found == by_id.end() ? Node() : found->second;
  }
  return {};
}

constexpr std::size_t longest_text = 1000;  // bytes of the text about an object

// Joins the lines of a text.
std::string one_line(std::string_view text) {
  std::string line;
  bool gap = false;
  for (const char c : text) {
    const auto byte = static_cast<unsigned char>(c);
    if (byte <= ' ' || byte == 0x7F) {
      gap = !line.empty();
      continue;
    }
    if (std::exchange(gap, false)) line += ' ';
    line += c;
    if (line.size() < longest_text) continue;
    while (!line.empty() && (static_cast<unsigned char>(line.back()) & 0xC0U) == 0x80U) line.pop_back();
    line.pop_back();  // the character that is cut
    break;
  }
  return line;
}

// The description of the parameter or of its template; else a label that says more than the object's own name.
std::string text_of(std::span<const Node> holders, std::string_view name) {
  for (const Node holder : holders) {
    std::string text = one_line(words_in_english(holder, "description"));
    if (!text.empty()) return text;
  }
  for (const Node holder : holders) {
    std::string text = one_line(label(holder));
    if (!text.empty() && text != one_line(name)) return text;
  }
  return {};
}

enum class UnitIs : std::uint8_t { absent, taken, without_a_name, of_a_scaled_value, unreadable };

// If the parameter itself is scaled (its `multiplier` and `offset`), its unit does not apply to the bare value.
UnitIs read_unit(Node holder, od::Meaning& meaning) {
  const Node given = child(holder, "unit");
  if (!given) return UnitIs::absent;
  const auto scale = scale_of(attribute(given, "multiplier"));
  if (!scale) return UnitIs::unreadable;
  const std::string_view offset = attribute(holder, "offset");
  const bool bare = is_one(attribute(holder, "multiplier")) && (offset.empty() || offset == "0");
  if (!bare) return UnitIs::of_a_scaled_value;
  meaning.unit = label(given);
  if (meaning.unit.empty()) return UnitIs::without_a_name;
  meaning.number = scale->number;
  meaning.exponent = static_cast<std::int8_t>(scale->exponent);
  return UnitIs::taken;
}

}  // namespace

Node allowed_values(Node holder, const NodesById& by_id) {
  const Node own = child(holder, "allowedValues");
  const std::string_view id = attribute(own, "templateIDRef");
  if (id.empty()) return own;
  const auto found = by_id.find(id);
  return found == by_id.end() ? own : found->second;
}

void ObjectList::meaning(const Facts& facts, const od::SubSpec& spec) {
  if (!facts.parameter) return;
  od::Meaning made;
  const std::array<Node, 2> holders{facts.parameter, facts.model};
  made.text = text_of(holders, attribute(facts.own, "name"));
  if (!made.text.empty() && !afford(facts.parameter, 0, made.text.size())) made.text.clear();
  if (od::bit_length(spec.type) == 0) {
    if (!made.text.empty()) builder_.meaning({facts.index, facts.sub}, std::move(made));
    return;
  }
  UnitIs unit = UnitIs::absent;
  for (const Node holder : {facts.parameter, facts.model}) {
    if (unit == UnitIs::absent) unit = read_unit(holder, made);
  }
  if (unit == UnitIs::without_a_name) ++left_out_["unit without a name"];
  if (unit == UnitIs::of_a_scaled_value) ++left_out_["unit of a scaled value"];
  if (unit == UnitIs::unreadable) {
    const Node given = child(facts.parameter, "unit") ? child(facts.parameter, "unit") : child(facts.model, "unit");
    warn(facts, given, "multiplier", "this is not a multiplier such as 0.1; the unit is left out");
  }
  const auto take = [&](Node list, std::string_view element) {
    for (const Node each : list.children()) {
      if (local(each) != element) continue;
      const auto value = literal(facts, {attribute(each, "value"), each, "value"}, spec.type);
      const std::string_view name = label(each);
      if (!value || value->kind != od::Literal::Kind::number) {
        ++left_out_["allowed value"];
      } else if (afford(each, 0, name.size() + sizeof(od::NamedValue))) {
        made.values.push_back({value->raw, std::string(name)});
      }
    }
  };
  bool range = false;
  for (const Node holder : {facts.parameter, facts.model}) {
    if (!made.values.empty()) break;
    const Node allowed = allowed_values(holder, by_id_);
    range = static_cast<bool>(child(allowed, "range"));
    take(allowed, "value");
    if (made.values.empty()) take(enumeration(holder, by_id_), "enumValue");
  }
  // If one value has two names, the first counts.
  std::ranges::stable_sort(made.values, {}, &od::NamedValue::raw);
  const auto rest = std::ranges::unique(made.values, {}, &od::NamedValue::raw);
  made.values.erase(rest.begin(), rest.end());
  made.only_these = !made.values.empty() && !range;
  if (!made.text.empty() || !made.unit.empty() || !made.values.empty())
    builder_.meaning({facts.index, facts.sub}, std::move(made));
}

}  // namespace berth::eds::xml
