#include <cstdlib>
#include <string>

#include "paths.hpp"

namespace berth::test {

std::string source_dir() { return BERTH_SOURCE_DIR; }

std::string binary() {
  const char* const other = std::getenv("BERTH_TEST_BINARY");
  return other != nullptr ? other : BERTH_BINARY;
}

}  // namespace berth::test
