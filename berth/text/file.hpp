/// A whole file's bytes: users' files are small enough to be read at once.
#pragma once

#include <optional>
#include <string>

#include "berth/base/finding.hpp"

namespace berth::text {

/// Reads `path`. If it is missing, a folder, not readable or larger than 64 MiB: a finding, and empty.
[[nodiscard]] std::optional<std::string> read_file(const std::string& path, Findings& findings);

/// `name` relative to the folder of `file`; an absolute name stays.
[[nodiscard]] std::string beside(const std::string& file, const std::string& name);

}  // namespace berth::text
