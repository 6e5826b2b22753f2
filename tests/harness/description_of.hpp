// Description files of devices that report only a part of 1018h, in the folder for temporary files.
#pragma once

#include <filesystem>
#include <string>

#include "berth/harness/description_of.hpp"

namespace berth::harness {

inline std::string description_of(TypeCode type, unsigned parts) {
  return description_of(std::filesystem::temp_directory_path(), type, parts);
}

}  // namespace berth::harness
