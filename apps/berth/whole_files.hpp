/// Writes files whole or not at all, also several together.
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

/// Writes each file under another name beside its place, then renames all, in this order; if one fails, the earlier
/// ones are undone. Status 1: a file exists, unless `replace`. Status 3: any other error. A process that dies meanwhile
/// leaves `PATH.PID.part` and no half file.
[[nodiscard]] std::optional<Failure> write_whole(const std::vector<WholeFile>& files, bool replace);

/// Makes the folder for them if it does not exist. Status 3: the system says why.
[[nodiscard]] std::optional<Failure> make_folder(const std::string& path);

}  // namespace berth::cli
