/// What a command writes destroys nothing that it reads, and nothing that is there unasked (docs/security.md).
#pragma once

#include <optional>
#include <string>
#include <string_view>

#include "output.hpp"

namespace berth::cli {

/// To be asked before a file is opened for writing. Status 2: this run reads it (by device and inode, whatever its name
/// here), or writes it for another of its options already. Status 1: it is there, has bytes in it, and `force` is
/// false. What is no plain file (a terminal, a pipe, /dev/null) may be written. `option`: what names it, such as
/// "--record".
[[nodiscard]] std::optional<Failure> may_write(const std::string& path, const char* option, bool force);

/// Writes it whole or not at all, over what is there: `may_write` was asked. Into what is no plain file it is written
/// as it goes. Status 2: it has been read since `may_write` was asked. Status 3: the system says why.
[[nodiscard]] std::optional<Failure> write_output(const std::string& path, std::string_view bytes);

/// The same as `may_write` for a file that the command keeps for itself from run to run, such as that of `--sim-state`:
/// it may be there.
[[nodiscard]] std::optional<Failure> may_keep(const std::string& path, const char* option);

}  // namespace berth::cli
