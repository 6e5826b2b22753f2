#include "berth/device/mandatory.hpp"

#include "berth/device/dictionary.hpp"

namespace berth::device {
namespace {

constexpr ObjectRef vendor_id{0x1018, 1};

void copy(od::DescriptionBuilder& b, const od::Description& from, std::uint16_t index, const od::SubObject& sub) {
  const od::Limits* const limits = from.limits(sub);
  b.sub(index, {.sub = sub.sub,
                .name = from.name(sub),
                .type = sub.type,
                .access = sub.access,
                .mappable = sub.mappable,
                .initial = from.default_of(sub),
                .low = limits != nullptr ? limits->low : od::Literal{},
                .high = limits != nullptr ? limits->high : od::Literal{},
                .obj_flags = sub.obj_flags,
                .capacity = sub.described_length()});
}

void copy(od::DescriptionBuilder& b, const od::Description& from, const od::Object& object) {
  b.object(object.index, object.code, from.name(object), object.type, object.obj_flags);
  for (const auto& sub : from.subs(object)) copy(b, from, object.index, sub);
}

}  // namespace

void add_all(od::DescriptionBuilder& b, const od::Description& from) {
  for (const auto& object : from.objects()) copy(b, from, object);
  std::uint32_t dummies = 0;
  for (std::uint16_t type = 1; type <= 0x1B; ++type) dummies |= from.dummy_mappable(type) ? 1U << type : 0U;
  b.dummies(dummies);
}

std::vector<ObjectRef> mandatory_absent(const od::Description& description) {
  const auto has = [&](std::uint16_t index) { return description.find(index) != nullptr; };
  std::vector<ObjectRef> absent;
  if (!has(0x1000)) absent.push_back({0x1000, 0});
  if (!has(0x1001)) absent.push_back({0x1001, 0});
  if (!has(0x1017) && !(has(0x100C) && has(0x100D))) absent.push_back({0x1017, 0});
  if (!has(vendor_id.index)) {
    absent.push_back({vendor_id.index, 0});
  } else if (description.find(vendor_id) == nullptr) {
    absent.push_back(vendor_id);
  }
  return absent;
}

std::shared_ptr<const od::Description> with_mandatory(const od::Description& description) {
  const od::Description& minimal = *minimal_description();
  od::DescriptionBuilder b;
  add_all(b, description);
  for (const ObjectRef absent : mandatory_absent(description)) {
    if (absent.sub == 0) {
      copy(b, minimal, *minimal.find(absent.index));
    } else {
      copy(b, minimal, absent.index, *minimal.find(absent));
    }
  }
  return b.build();
}

}  // namespace berth::device
