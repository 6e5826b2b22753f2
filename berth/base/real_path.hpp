/// The real location of a file name, with all links resolved.
#pragma once

#include <filesystem>

namespace berth {

/// Absolute, without links and dots, as far as the path exists; the rest as written. Empty: the system reports an
/// error.
[[nodiscard]] std::filesystem::path real_path(const std::filesystem::path& path);

/// True if `path` is `folder` or anywhere beneath it; both from `real_path`.
[[nodiscard]] bool is_beneath(const std::filesystem::path& path, const std::filesystem::path& folder);

}  // namespace berth
