#include "berth/client/names.hpp"

#include <fmt/format.h>

#include "berth/od/names.hpp"

namespace berth::client {

namespace {

bool is_plain(const od::Object& object) noexcept {
  return object.code != od::ObjectCode::array && object.code != od::ObjectCode::record && object.count <= 1;
}

}  // namespace

Names::Names(std::shared_ptr<const od::Description> description) : description_(std::move(description)) {
  objects_.reserve(description_->subs().size() * 3);
  for (const auto& object : description_->objects()) {
    const std::string own(description_->name(object));
    add(own, {object.index, 0});
    if (is_plain(object)) continue;
    for (const auto& sub : description_->subs(object)) {
      const std::string_view name = description_->name(sub);
      add(std::string(name), {object.index, sub.sub});
      for (const char between : {'/', '.'}) add(fmt::format("{}{}{}", own, between, name), {object.index, sub.sub});
    }
  }
}

// A name that several objects have leads to none of them: `od::find_object` reports which objects have it.
void Names::add(std::string name, ObjectRef ref) {
  if (od::read_object(name) || od::read_object(name).error().kind == od::NoObject::Kind::bare) return;
  const auto [it, fresh] = objects_.emplace(std::move(name), ref);
  if (!fresh) it->second = std::nullopt;
}

tl::expected<ObjectRef, od::NoObject> Names::find(Selector selector) const {
  if (!selector.by_text()) return selector.ref();
  const auto it = objects_.find(selector.text());
  if (it != objects_.end() && it->second) return *it->second;
  return od::find_object(*description_, selector.text());
}

std::string Names::name(ObjectRef ref) const { return od::full_name(*description_, ref); }

std::string Names::label(ObjectRef ref) const {
  const std::string known = name(ref);
  const std::string number = "object " + od::write_object(ref);
  return known.empty() ? number : fmt::format("{} \"{}\"", number, known);
}

}  // namespace berth::client
