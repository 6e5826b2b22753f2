/// Inside of room `decode`: names and types of CiA 301's communication objects, for devices of which no description is
/// at hand.
#pragma once

#include <string>

#include "berth/base/ids.hpp"
#include "berth/od/data_type.hpp"

namespace berth::decode {

struct StandardObject {
  std::string name;  ///< empty: none of CiA 301's
  od::DataType type = od::DataType::none;
};
/// CiA 301 §7.5.2, §7.5.1.
[[nodiscard]] StandardObject standard_object(ObjectRef ref);

}  // namespace berth::decode
