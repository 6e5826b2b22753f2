#include "berth/client/names.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <charconv>

namespace berth::client {

namespace {

bool is_plain(const od::Object& object) noexcept {
  return object.code != od::ObjectCode::array && object.code != od::ObjectCode::record && object.count <= 1;
}

char lower(char c) noexcept { return c >= 'A' && c <= 'Z' ? static_cast<char>(c - 'A' + 'a') : c; }

bool equal_but_for_case(std::string_view a, std::string_view b) noexcept {
  return std::ranges::equal(a, b, {}, lower, lower);
}

/// "0x1018", "1018h", "1018": the number; empty when it is none of `most` or fewer digits.
std::optional<std::uint32_t> hexadecimal(std::string_view text, std::size_t most) noexcept {
  if (text.starts_with("0x") || text.starts_with("0X")) {
    text.remove_prefix(2);
  } else if (text.ends_with('h') || text.ends_with('H')) {
    text.remove_suffix(1);
  }
  if (text.empty() || text.size() > most) return std::nullopt;
  std::uint32_t value = 0;
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), value, 16);
  if (error != std::errc() || end != text.data() + text.size()) return std::nullopt;
  return value;
}

std::optional<ObjectRef> reference(std::string_view text) noexcept {
  const auto colon = text.find(':');
  const auto index = hexadecimal(text.substr(0, colon), 4);
  const auto sub = colon == std::string_view::npos ? 0U : hexadecimal(text.substr(colon + 1), 2);
  if (!index || !sub) return std::nullopt;
  return ObjectRef{static_cast<std::uint16_t>(*index), static_cast<std::uint8_t>(*sub)};
}

}  // namespace

Names::Names(std::shared_ptr<const od::Description> description) : description_(std::move(description)) {
  objects_.reserve(description_->subs().size() * 2);
  for (const auto& object : description_->objects()) {
    const std::string own(description_->name(object));
    if (is_plain(object)) {
      add(own, {object.index, 0});
      continue;
    }
    for (const auto& sub : description_->subs(object)) {
      const std::string_view name = description_->name(sub);
      add(name, {object.index, sub.sub});
      add(fmt::format("{}.{}", own, name), {object.index, sub.sub});
    }
  }
}

void Names::add(std::string_view name, ObjectRef ref) {
  if (!name.empty()) objects_[std::string(name)].push_back(ref);
}

tl::expected<ObjectRef, Names::Problem> Names::find(Selector selector) const {
  if (!selector.by_text()) return selector.ref();
  const auto it = objects_.find(std::string(selector.text()));
  if (it != objects_.end() && it->second.size() == 1) return it->second.front();
  if (it == objects_.end()) {
    if (const auto ref = reference(selector.text())) return *ref;
  }
  return tl::unexpected(problem(selector.text()));
}

Names::Problem Names::problem(std::string_view text) const {
  constexpr std::size_t most_shown = 3;
  const auto it = objects_.find(std::string(text));
  if (it == objects_.end()) {
    std::string what = fmt::format("no object is called \"{}\"", text);
    const auto like = std::ranges::find_if(objects_, [&](const auto& o) { return equal_but_for_case(o.first, text); });
    if (like != objects_.end()) what += fmt::format("; there is \"{}\"", like->first);
    return {.ambiguous = false, .what = what};
  }
  const auto& refs = it->second;
  std::string what = fmt::format("{} objects are called \"{}\":", refs.size(), text);
  for (std::size_t i = 0; i < std::min(refs.size(), most_shown); ++i) {
    what += fmt::format("{} {:04X}h:{:02X} \"{}\"", i == 0 ? "" : ",", refs[i].index, refs[i].sub, name(refs[i]));
  }
  if (refs.size() > most_shown) what += ", ...";
  return {.ambiguous = true, .what = what + "; use one of these"};
}

std::string Names::name(ObjectRef ref) const {
  const auto* object = description_->find(ref.index);
  const auto* sub = object == nullptr ? nullptr : description_->find(*object, ref.sub);
  if (sub == nullptr) return {};
  if (is_plain(*object)) return std::string(description_->name(*object));
  return fmt::format("{}.{}", description_->name(*object), description_->name(*sub));
}

std::string Names::label(ObjectRef ref) const {
  const std::string known = name(ref);
  const std::string number = fmt::format("object {:04X}h:{:02X}", ref.index, ref.sub);
  return known.empty() ? number : fmt::format("{} \"{}\"", number, known);
}

}  // namespace berth::client
