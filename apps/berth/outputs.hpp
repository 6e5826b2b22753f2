/// Protects files: a command overwrites no file that it reads, and no existing file without consent (docs/security.md).
#pragma once

#include <optional>
#include <string>
#include <string_view>

#include "output.hpp"

namespace berth::cli {

/// Ask before you open a file for writing.
/// - Status 2: this run reads the file (by device and inode, whatever its name), or another of its options writes it.
/// - Status 1: the file exists, is not empty, and `force` is false.
/// - A file that is not a plain one (a terminal, a pipe, /dev/null) may be written.
/// `option`: the option that names it, such as "--record".
[[nodiscard]] std::optional<Failure> may_write(const std::string& path, const char* option, bool force);

/// Writes a file whole or not at all, replacing what is there; ask `may_write` first. A file that is not a plain one is
/// written directly. Status 2: the run has read it since `may_write`. Status 3: the system says why.
[[nodiscard]] std::optional<Failure> write_output(const std::string& path, std::string_view bytes);

/// As `may_write`, for a file that the command keeps from run to run, such as that of `--sim-state`: it may exist.
[[nodiscard]] std::optional<Failure> may_keep(const std::string& path, const char* option);

}  // namespace berth::cli
