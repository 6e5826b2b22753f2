/// What is known of a device beyond the trace.
#pragma once

#include <memory>
#include <string>
#include <utility>
#include <vector>

#include "berth/decode/value_words.hpp"
#include "berth/od/data_type.hpp"
#include "berth/od/description.hpp"

namespace berth::decode {

/// An object that has its name from elsewhere than the device's description: a network variable of a link.
struct NamedObject {
  ObjectRef object;
  std::string name;
  od::DataType type = od::DataType::none;
};

/// What is known of a device beyond the trace.
struct Profile {
  std::string name;                                                         ///< the slot's; may be empty
  std::shared_ptr<const od::Description> description;                       ///< may be null
  std::vector<std::pair<ObjectRef, std::vector<std::uint8_t>>> settings{};  ///< in place of the defaults
  std::shared_ptr<const ValueWords> words{};                                ///< meaning of values; may be null
  std::vector<NamedObject> named{};                                         ///< preferred to the description's names
};

}  // namespace berth::decode
