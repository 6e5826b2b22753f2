/// Whether values are as the standard wants those that are sent (Sparkplug 3.0 §6.4.7 to §6.4.12). A reader of others'
/// payloads is more lenient: there such a value is `Unsupported`.
#pragma once

#include <map>
#include <string>

#include "berth/sparkplug/payload.hpp"

namespace berth::sparkplug {

/// The template definitions of an edge node by the name of their metric.
using Definitions = std::map<std::string, Boxed<Template>, std::less<>>;

/// How many of its definition's members an instance must have: every one in births, some in data (§6.4.11).
enum class Members : std::uint8_t { all, some };

/// Properties have keys, types that properties may have and values of that type; "Quality" is an Int32 with one of the
/// three codes. `invalid` with the reason.
[[nodiscard]] Result<void> check(const PropertySet& properties);

/// Columns have basic types, rows the length of the columns, cells values of their column's type.
[[nodiscard]] Result<void> check(const DataSet& set);

/// A definition has no reference; each member has a name of its own and a type, each parameter too.
[[nodiscard]] Result<void> check_definition(const Template& definition);

/// An instance names a definition that is there, has members and parameters of it only, in its types, and with
/// `Members::all` all members.
[[nodiscard]] Result<void> check_instance(const Template& instance, const Definitions& definitions, Members members);

/// A value that is sent as one of `type`: its range, and all of the above. A template must be an instance.
[[nodiscard]] Result<void> check(DataType type, const Value& value, const Definitions& definitions, Members members);

}  // namespace berth::sparkplug
