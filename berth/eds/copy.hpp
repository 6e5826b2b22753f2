/// Copies a description, for additions. Internal to room `eds`.
#pragma once

#include "berth/od/description.hpp"

namespace berth::eds {

void copy_object(const od::Description& from, const od::Object& object, od::DescriptionBuilder& to);
/// Copies all objects, and which types may be mapped as a dummy.
void copy_all(const od::Description& from, od::DescriptionBuilder& to);
[[nodiscard]] std::uint32_t dummies_of(const od::Description& description) noexcept;

}  // namespace berth::eds
