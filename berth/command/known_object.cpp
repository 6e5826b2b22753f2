#include "berth/command/known_object.hpp"

#include "berth/decode/standard_objects.hpp"
#include "berth/od/names.hpp"
#include "berth/od/notation.hpp"

namespace berth::command {

KnownObject known_object(const od::Description* description, ObjectRef ref) {
  KnownObject object;
  object.ref = ref;
  if (description != nullptr) {
    object.described = description->find(ref);
    object.name = od::full_name(*description, ref);
  }
  if (object.described != nullptr) {
    object.type = object.described->type;
    object.limits = description->limits(*object.described);
    object.meaning = description->meaning(ref);
    return object;
  }
  auto standard = decode::standard_object(ref);
  object.type = standard.type;
  if (object.name.empty()) object.name = od::full_name(decode::standard_names(), ref);
  if (object.name.empty()) object.name = std::move(standard.name);
  return object;
}

Checked<KnownObject> find_object(const od::Description* description, const std::string& word) {
  const auto ref = od::find_object(description != nullptr ? *description : decode::standard_names(), word);
  if (ref) return known_object(description, *ref);
  const bool advice = ref.error().kind == od::NoObject::Kind::other && !ref.error().why.ends_with('?');
  return tl::unexpected(ref.error().why +
                        (advice ? "; `berth sdo dump NODE` lists the objects, and an index is written 1018h:04" : ""));
}

}  // namespace berth::command
