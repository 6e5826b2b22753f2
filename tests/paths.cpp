#include <string>

#include "paths.hpp"

namespace berth::test {

std::string source_dir() { return BERTH_SOURCE_DIR; }

std::string binary() { return BERTH_BINARY; }

}  // namespace berth::test
