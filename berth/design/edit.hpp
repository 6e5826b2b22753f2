/// Edits to a machine file as text. The file is a person's source code: an edit changes the bytes of the one value,
/// line or table it is about, and comments, order, units and line ends stay. After every edit the text is read again
/// and compared with what the edit should give; when they differ nothing is changed.
///
/// Errors: `invalid` the text is not TOML, or the edit would not read back; `not_found` no such slot; `duplicate` the
/// slot is there already, or the name is not unique; `unsupported` the slot is one of a range (`ids = …`), or the key
/// holds a table of its own.
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
using NewValue = std::variant<std::string, std::int64_t, bool, TypeCode>;

/// Sets `key` of the slot `slot` (its name in the file), adding the key when it is absent. Gives the new text.
[[nodiscard]] Result<std::string> set_slot_key(std::string_view text, std::string_view slot, std::string_view key,
                                               const NewValue& value);

/// Removes `key` of a slot, with its line when it stands alone on it.
[[nodiscard]] Result<std::string> remove_slot_key(std::string_view text, std::string_view slot, std::string_view key);

/// A slot to add.
struct NewSlot {
  std::string bus;
  NodeId id;
  std::string name;
  TypeCode type;
  std::vector<std::pair<std::string, NewValue>> more;  ///< further keys, in this order
};

/// Adds a slot after the last one, or at the end of a file without slots.
[[nodiscard]] Result<std::string> add_slot(std::string_view text, const NewSlot& slot);

}  // namespace berth::design
