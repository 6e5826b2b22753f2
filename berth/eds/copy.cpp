#include "berth/eds/copy.hpp"

namespace berth::eds {

void copy_object(const od::Description& from, const od::Object& object, od::DescriptionBuilder& to) {
  to.object(object.index, object.code, from.name(object), object.type, object.obj_flags);
  for (const od::SubObject& sub : from.subs(object)) {
    const od::Limits* const limits = from.limits(sub);
    to.sub(object.index, {.sub = sub.sub,
                          .name = from.name(sub),
                          .type = sub.type,
                          .access = sub.access,
                          .mappable = sub.mappable,
                          .initial = from.default_of(sub),
                          .low = limits == nullptr ? od::Literal{} : limits->low,
                          .high = limits == nullptr ? od::Literal{} : limits->high,
                          .obj_flags = sub.obj_flags,
                          .capacity = sub.described_length()});
    if (const auto* const meaning = from.meaning({object.index, sub.sub}))
      to.meaning({object.index, sub.sub}, *meaning);
  }
}

std::uint32_t dummies_of(const od::Description& description) noexcept {
  std::uint32_t mask = 0;
  for (const od::DataType each : od::all_data_types()) {
    const auto index = static_cast<std::uint16_t>(each);
    if (description.dummy_mappable(index)) mask |= 1U << index;
  }
  return mask;
}

void copy_all(const od::Description& from, od::DescriptionBuilder& to) {
  to.dummies(dummies_of(from));
  for (const od::Object& each : from.objects()) copy_object(from, each, to);
}

}  // namespace berth::eds
