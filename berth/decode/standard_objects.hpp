/// Names and types of CiA 301's communication objects, for devices without a description.
#pragma once

#include <memory>
#include <string>

#include "berth/base/ids.hpp"
#include "berth/od/data_type.hpp"
#include "berth/od/description.hpp"

namespace berth::decode {

struct StandardObject {
  std::string name;  ///< empty: none of CiA 301's
  od::DataType type = od::DataType::none;
};
/// CiA 301 §7.5.2, §7.5.1.
[[nodiscard]] StandardObject standard_object(ObjectRef ref);

/// The same objects up to 1029h as a description, for looking up their names. It does not say which of them a device
/// has, nor access, defaults or limits.
[[nodiscard]] const od::Description& standard_names();

}  // namespace berth::decode
