/// Where a name of a file leads, whatever links are on the way.
#pragma once

#include <filesystem>

namespace berth {

/// Absolute, without links, `.` and `..`, as far as it is there; the rest as it is written. Empty: the system cannot
/// say.
[[nodiscard]] std::filesystem::path real_path(const std::filesystem::path& path);

/// `path` is `folder` or in it or beneath it; both by `real_path`.
[[nodiscard]] bool is_beneath(const std::filesystem::path& path, const std::filesystem::path& folder);

}  // namespace berth
