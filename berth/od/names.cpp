#include "berth/od/names.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cstdint>

#include "berth/base/words.hpp"

namespace berth::od {
namespace {

/// How well a name matches, best first.
enum class Met : std::uint8_t { exactly, in_either_case, as_prefix, not_at_all };

Met met(std::string_view name, std::string_view wanted) noexcept {
  if (wanted.empty() || wanted.size() > name.size()) return Met::not_at_all;
  if (name == wanted) return Met::exactly;
  if (!std::ranges::equal(name.substr(0, wanted.size()), wanted, {}, lower, lower)) return Met::not_at_all;
  return name.size() == wanted.size() ? Met::in_either_case : Met::as_prefix;
}

// An object of one value, whose sub-object has no name of its own.
bool is_plain(const Object& object) noexcept {
  return object.code != ObjectCode::array && object.code != ObjectCode::record && object.count <= 1;
}

class Search {
 public:
  Search(const Description& description, std::string_view name) : description_(description), name_(name) {}

  std::vector<NamedObject> run() {
    for (const Object& object : description_.objects()) {
      take(met(description_.name(object), name_), {object.index, std::nullopt});
      if (is_plain(object)) continue;
      for (const SubObject& sub : description_.subs(object)) look_at(object, sub);
    }
    return std::move(found_);
  }

 private:
  // Compares the sub-object's own name, and its name after the object's name. Names may contain slashes and dots.
  void look_at(const Object& object, const SubObject& sub) {
    Met best = met(description_.name(sub), name_);
    for (auto at = name_.find_first_of("/."); at != std::string_view::npos; at = name_.find_first_of("/.", at + 1)) {
      const Met both = std::max(met(description_.name(object), name_.substr(0, at)),
                                met(description_.name(sub), name_.substr(at + 1)));
      best = std::min(best, both);
    }
    take(best, {object.index, sub.sub});
  }

  void take(Met how, NamedObject object) {
    if (how > best_ || how == Met::not_at_all) return;
    if (how < best_) found_.clear();
    best_ = how;
    found_.push_back(object);
  }

  const Description& description_;
  std::string_view name_;
  Met best_ = Met::not_at_all;
  std::vector<NamedObject> found_;
};

std::string candidate(const Description& description, const NamedObject& object) {
  if (object.sub) return fmt::format("{} {}", write_object(object.ref()), full_name(description, object.ref()));
  const Object* const whole = description.find(object.index);
  return fmt::format("{:04X}h {}", object.index, whole == nullptr ? "" : description.name(*whole));
}

// Names that contain the word, each with its object.
std::vector<std::string> containing(const Description& description, std::string_view word) {
  constexpr std::size_t shortest = 3;
  std::vector<std::string> found;
  if (word.size() < shortest) return found;
  for (const auto& object : description.objects()) {
    const std::string_view name = description.name(object);
    const auto at = std::ranges::search(name, word, {}, lower, lower);
    if (!at.empty()) found.push_back(fmt::format("{:04X}h {}", object.index, name));
  }
  return found;
}

// "Write output 8 bit/1": the object exists, but has no part of this name. Empty: the word is not of this kind.
std::string parts_of(const Description& description, std::string_view word) {
  const auto cut = word.find_last_of("/.");
  if (cut == word.npos || cut == 0) return {};
  const auto found = find_named(description, word.substr(0, cut));
  const Object* const object =
      found.size() == 1 && !found.front().sub ? description.find(found.front().index) : nullptr;
  if (object == nullptr || is_plain(*object)) return {};
  std::vector<std::string> parts;
  for (const auto& sub : description.subs(*object)) {
    if (sub.sub != 0) parts.push_back(fmt::format("{:04X}h:{:02X} {}", object->index, sub.sub, description.name(sub)));
  }
  return fmt::format("{} has no part {}; it has {}", berth::quoted(description.name(*object)),
                     berth::quoted(word.substr(cut + 1)), some_of(parts));
}

NoObject none_called(const Description& description, std::string_view word) {
  if (auto parts = parts_of(description, word); !parts.empty()) return {NoObject::Kind::other, std::move(parts)};
  if (const auto with = containing(description, word); !with.empty()) {
    return {NoObject::Kind::other,
            fmt::format("no object is called {}; names with this word: {}", berth::quoted(word), some_of(with))};
  }
  std::vector<std::string_view> names;
  for (const auto& object : description.objects()) names.push_back(description.name(object));
  const auto meant = closest(word, names);
  return {NoObject::Kind::other,
          fmt::format("no object is called {}{}", berth::quoted(word),
                      meant.empty() ? "" : fmt::format("; did you mean {}?", berth::quoted(meant)))};
}

}  // namespace

tl::expected<ObjectRef, NoObject> find_object(const Description& description, std::string_view word) {
  using Kind = NoObject::Kind;
  auto number = read_object(word);
  if (number) return number->ref();
  if (number.error().kind == Kind::bare) return tl::unexpected(std::move(number.error()));
  const auto found = find_named(description, word);
  if (found.size() == 1) return found.front().ref();
  if (!found.empty()) {
    std::vector<std::string> candidates;
    for (const auto& object : found) candidates.push_back(candidate(description, object));
    return tl::unexpected(NoObject{Kind::several, fmt::format("{} objects are called {}: {}", found.size(),
                                                              berth::quoted(word), some_of(candidates))});
  }
  if (number.error().kind == Kind::unmarked) return tl::unexpected(std::move(number.error()));
  return tl::unexpected(none_called(description, word));
}

std::vector<NamedObject> find_named(const Description& description, std::string_view name) {
  return Search(description, name).run();
}

std::string full_name(const Description& description, ObjectRef ref) {
  const Object* const object = description.find(ref.index);
  const SubObject* const sub = object == nullptr ? nullptr : description.find(*object, ref.sub);
  if (sub == nullptr) return {};
  const std::string name(description.name(*object));
  const std::string_view own = is_plain(*object) ? std::string_view() : description.name(*sub);
  if (is_plain(*object)) return name;
  return name.empty() || own.empty() ? std::string(own) : name + "/" + std::string(own);
}

}  // namespace berth::od
