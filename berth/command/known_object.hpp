/// An object of a node, with the knowledge of a description.
#pragma once

#include <string>

#include "berth/command/checked.hpp"
#include "berth/od/description.hpp"

namespace berth::command {

/// One object of a node, with what is known of it.
struct KnownObject {
  ObjectRef ref;
  std::string name;                          ///< "Identity object/Serial number"; empty: not known
  od::DataType type = od::DataType::none;    ///< none: not known
  const od::SubObject* described = nullptr;  ///< of the node's description; null: it has none, or not this object
  const od::Limits* limits = nullptr;        ///< null: the description gives none
  const od::Meaning* meaning = nullptr;      ///< unit and names of values; null: the description has none (an EDS)
  bool type_given = false;                   ///< by the user, not by a description
  /// Limits and meanings apply to the described type only.
  [[nodiscard]] bool type_is_described() const noexcept { return described != nullptr && type == described->type; }
};
/// `word`: "1018h:04", "Identity object/Serial number", "serial".
[[nodiscard]] Checked<KnownObject> find_object(const od::Description* description, const std::string& word);
/// What is known of an object.
[[nodiscard]] KnownObject known_object(const od::Description* description, ObjectRef ref);

}  // namespace berth::command
