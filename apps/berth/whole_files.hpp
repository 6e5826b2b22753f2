/// Files that are written whole or not at all, several of them together.
#pragma once

#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "output.hpp"

namespace berth::cli {

struct WholeFile {
  std::string path;
  std::string_view bytes;
};

/// Each is written beside its place under another name, then all are put in place, in this order; when one cannot be,
/// those before it are taken back. What is there already is status 1, unless `replace`; anything else that goes wrong
/// is status 3. A process that dies meanwhile leaves `PATH.PID.part` and no half file.
[[nodiscard]] std::optional<Failure> write_whole(const std::vector<WholeFile>& files, bool replace);

/// A folder to write them in, where it is not there yet. Status 3: the system says why.
[[nodiscard]] std::optional<Failure> make_folder(const std::string& path);

}  // namespace berth::cli
