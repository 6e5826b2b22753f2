/// Edits to a machine file as text. The file belongs to a user: an edit changes only the bytes of its value, line or
/// table; comments, order, units and line ends stay. After every edit the text is read again and compared with the
/// intended result; if they differ nothing is changed.
///
/// Errors: `invalid` the text is not TOML, or the result would differ; `not_found` no such slot; `duplicate` the slot
/// already exists, or the name is not unique; `unsupported` the slot is one of a range (`ids = …`), or the key holds
/// a table of its own.
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <string_view>
#include <utility>
#include <variant>
#include <vector>

#include "berth/base/ids.hpp"
#include "berth/base/result.hpp"

namespace berth::design {

/// A value to write. A `TypeCode` becomes `{ vendor = 0x…, product = 0x… }`; numbers are written as decimals.
using NewValue = std::variant<std::string, std::int64_t, bool, TypeCode, std::vector<std::string>>;

/// Sets `key` of the slot `slot` (its name in the file), or adds it. Returns the new text.
[[nodiscard]] Result<std::string> set_slot_key(std::string_view text, std::string_view slot, std::string_view key,
                                               const NewValue& value);

/// Removes `key` of a slot, and its line if it is alone on it.
[[nodiscard]] Result<std::string> remove_slot_key(std::string_view text, std::string_view slot, std::string_view key);

/// Sets `key` of `[mqtt]`, or adds it; a file without the table gets it at its end.
[[nodiscard]] Result<std::string> set_mqtt_key(std::string_view text, std::string_view key, const NewValue& value);

/// A slot to add.
struct NewSlot {
  std::string bus;
  NodeId id;
  std::string name;
  TypeCode type;
  std::vector<std::pair<std::string, NewValue>> more;  ///< more keys, in this order
};

/// Adds a slot after the last one, or at the end of a file without slots.
[[nodiscard]] Result<std::string> add_slot(std::string_view text, const NewSlot& slot);

}  // namespace berth::design
