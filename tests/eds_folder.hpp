/// Where real device descriptions are, for the tests that read them.
#pragma once

#include <cstdlib>
#include <filesystem>

#include "paths.hpp"

namespace berth::test {

/// BERTH_EDS_DIR, else `shared/eds` beside the repository; need not exist.
inline std::filesystem::path eds_folder() {
  if (const char* named = std::getenv("BERTH_EDS_DIR")) return named;
  return std::filesystem::path(source_dir()) / ".." / "shared" / "eds";
}

}  // namespace berth::test
