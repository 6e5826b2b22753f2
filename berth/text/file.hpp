/// A whole file's bytes: a person's file is small enough to be read at once.
#pragma once

#include <optional>
#include <string>

#include "berth/base/finding.hpp"

namespace berth::text {

/// Reads `path`. Missing, a folder, not readable, larger than 64 MiB: a finding, and empty.
[[nodiscard]] std::optional<std::string> read_file(const std::string& path, Findings& findings);

/// `name` as seen from the folder in which `file` lies; an absolute name stays.
[[nodiscard]] std::string beside(const std::string& file, const std::string& name);

}  // namespace berth::text
