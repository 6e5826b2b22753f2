/// The files that this process has read, by device and inode. It must not write any of them, whatever name or link is
/// given (docs/security.md). Kept for the whole process; any thread.
#pragma once

#include <string>

namespace berth {

/// Call it where a file is opened for reading, or named for that. Only plain files count.
void note_read(const std::string& path) noexcept;

/// True if it was read.
[[nodiscard]] bool was_read(const std::string& path) noexcept;

}  // namespace berth
