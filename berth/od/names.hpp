/// Objects by the names in their description, as used in commands, filters and programs (`client::Selector`).
#pragma once

#include <optional>
#include <string>
#include <string_view>
#include <tl/expected.hpp>
#include <vector>

#include "berth/base/ids.hpp"
#include "berth/od/description.hpp"
#include "berth/od/notation.hpp"

namespace berth::od {

/// An object found by name.
struct NamedObject {
  std::uint16_t index = 0;
  std::optional<std::uint8_t> sub;  ///< empty: the whole object has the name
  [[nodiscard]] ObjectRef ref() const noexcept { return {index, sub.value_or(0)}; }
  friend constexpr auto operator<=>(const NamedObject&, const NamedObject&) noexcept = default;
};

/// The objects with this name, ascending; usually there should be one. A name is that of an object ("Producer heartbeat
/// time"), of a sub-object ("Serial number"), or both with a slash or a dot between ("Identity object/Serial number").
/// Only the best matches count: the exact name, else the name in either case, else names that begin with it.
[[nodiscard]] std::vector<NamedObject> find_named(const Description& description, std::string_view name);

/// The one object that a word names: in numbers (berth/od/notation.hpp; it need not be in the description), else by
/// name. The error text is for users and gives the candidates or the most similar name.
[[nodiscard]] tl::expected<ObjectRef, NoObject> find_object(const Description& description, std::string_view word);

/// "Identity object/Serial number", "Producer heartbeat time"; empty when the description has no such object, or no
/// name for it. `find_named` finds the object by this name.
[[nodiscard]] std::string full_name(const Description& description, ObjectRef object);

}  // namespace berth::od
