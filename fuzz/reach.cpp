// Names of files in a machine file: what is accepted is beneath the file's folder, whatever the name.
#include <algorithm>
#include <cstdint>
#include <cstdlib>
#include <filesystem>
#include <string>

#include "berth/text/reach.hpp"

namespace reach_target {

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  namespace fs = std::filesystem;
  static const fs::path folder = "/nowhere/machines/line";
  static const berth::text::Reach reach((folder / "m.toml").string());
  const std::string name(reinterpret_cast<const char*>(data), size);
  const auto found = reach.path(name);
  if (!found) return 0;
  // As the system reads it: up to the first NUL.
  const auto path = fs::path(found->c_str()).lexically_normal();
  if (std::mismatch(folder.begin(), folder.end(), path.begin(), path.end()).first != folder.end()) std::abort();
  return 0;
}

}  // namespace reach_target
