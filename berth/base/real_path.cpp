#include "berth/base/real_path.hpp"

#include <algorithm>
#include <system_error>

namespace berth {

namespace fs = std::filesystem;

fs::path real_path(const fs::path& path) {
  std::error_code error;
  auto real = fs::weakly_canonical(fs::absolute(path, error), error);
  return error ? fs::path() : real;
}

bool is_beneath(const fs::path& path, const fs::path& folder) {
  return std::mismatch(folder.begin(), folder.end(), path.begin(), path.end()).first == folder.end();
}

}  // namespace berth
