/// Objects by the names of their description, as commands, filters and programs (`client::Selector`) write them.
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

/// An object that a name means.
struct NamedObject {
  std::uint16_t index = 0;
  std::optional<std::uint8_t> sub;  ///< empty: the name is that of a whole object
  [[nodiscard]] ObjectRef ref() const noexcept { return {index, sub.value_or(0)}; }
  friend constexpr auto operator<=>(const NamedObject&, const NamedObject&) noexcept = default;
};

/// The objects that a name means, ascending; one of them is what a person hopes for. A name is that of an object
/// ("Producer heartbeat time"), of a sub-object ("Serial number"), or both with a slash or a dot between ("Identity
/// object/Serial number"). Only the best matches count: the exact name, else the name in either case, else names that
/// begin so.
[[nodiscard]] std::vector<NamedObject> find_named(const Description& description, std::string_view name);

/// The one object that a word means: in numbers (berth/od/notation.hpp; it need not be in the description), else by
/// name. What is wrong is for people, with the candidates or the name that is most like it.
[[nodiscard]] tl::expected<ObjectRef, NoObject> find_object(const Description& description, std::string_view word);

/// "Identity object/Serial number", "Producer heartbeat time"; empty when the description has no such object, or no
/// name for it. `find_named` finds it under that name.
[[nodiscard]] std::string full_name(const Description& description, ObjectRef object);

}  // namespace berth::od
