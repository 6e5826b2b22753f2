// What the numbers of an object stand for (CiA 311: `unit`, `allowedValues`, enumerated data types of parameters).
#include <fmt/format.h>

#include <algorithm>
#include <charconv>

#include "berth/eds/xdd_reader.hpp"

namespace berth::eds::xml {
namespace {

constexpr int most_exponent = 18;
constexpr std::size_t most_digits = 9;  // so that a product with 64 bits rarely has more

struct Scale {
  std::int64_t number = 1;
  int exponent = 0;
};

// "0.1", "10", "2.5E-3": exactly, as a whole number and a power of ten.
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

}  // namespace

Node ObjectList::allowed_values(Node holder) const {
  const Node own = child(holder, "allowedValues");
  const std::string_view id = attribute(own, "templateIDRef");
  if (id.empty()) return own;
  const auto found = by_id_.find(id);
  return found == by_id_.end() ? own : found->second;
}

Node ObjectList::enumeration(Node holder) const {
  Node at = holder;
  for (unsigned deep = 0; at && deep < deepest_reference; ++deep) {
    if (local(at) == "enum") return at;
    if (local(at) == "array" || local(at) == "struct") return {};
    const auto found = by_id_.find(attribute(child(at, "dataTypeIDRef"), "uniqueIDRef"));
    at = found == by_id_.end() ? Node() : found->second;
  }
  return {};
}

// A parameter that is itself scaled (its `multiplier` and `offset`) has a unit that does not belong to the bare value.
bool ObjectList::unit(const Facts& facts, Node holder, od::Meaning& meaning) {
  const Node given = child(holder, "unit");
  if (!given) return false;
  const std::string_view offset = attribute(holder, "offset");
  const auto scale = scale_of(attribute(given, "multiplier"));
  const bool bare = is_one(attribute(holder, "multiplier")) && (offset.empty() || offset == "0");
  const std::string_view name = label(given);
  if (!scale) {
    warn(facts, given, "multiplier", "this is no multiplier such as 0.1; the unit is left out");
    return false;
  }
  if (name.empty() || !bare) {
    ++left_out_[bare ? "unit without a name" : "unit of a scaled value"];
    return false;
  }
  meaning.unit = name;
  meaning.number = scale->number;
  meaning.exponent = static_cast<std::int8_t>(scale->exponent);
  return true;
}

void ObjectList::named_values(const Facts& facts, Node list, std::string_view element, od::DataType type,
                              od::Meaning& meaning) {
  for (const Node each : list.children()) {
    if (local(each) != element) continue;
    const auto value = literal(facts, {attribute(each, "value"), each, "value"}, type);
    if (!value || value->kind != od::Literal::Kind::number) {
      ++left_out_["allowed value"];
      continue;
    }
    const std::string_view name = label(each);
    if (!afford(each, 0, name.size() + sizeof(od::NamedValue))) return;
    meaning.values.push_back({value->raw, std::string(name)});
  }
  // Of two names of one value the first counts.
  std::ranges::stable_sort(meaning.values, {}, &od::NamedValue::raw);
  const auto rest = std::ranges::unique(meaning.values, {}, &od::NamedValue::raw);
  meaning.values.erase(rest.begin(), rest.end());
}

void ObjectList::meaning(const Facts& facts, const od::SubSpec& spec) {
  if (od::bit_length(spec.type) == 0 || !facts.parameter) return;
  od::Meaning made;
  (void)(unit(facts, facts.parameter, made) || unit(facts, facts.model, made));
  bool range = false;
  for (const Node holder : {facts.parameter, facts.model}) {
    if (!made.values.empty()) break;
    const Node allowed = allowed_values(holder);
    range = static_cast<bool>(child(allowed, "range"));
    named_values(facts, allowed, "value", spec.type, made);
    if (!made.values.empty()) break;
    named_values(facts, enumeration(holder), "enumValue", spec.type, made);
  }
  made.only_these = !made.values.empty() && !range;
  if (!made.unit.empty() || !made.values.empty()) builder_.meaning({facts.index, facts.sub}, std::move(made));
}

}  // namespace berth::eds::xml
