/// Which files this process has read, by device and inode: what it writes must be none of them, whatever name or link
/// it is given by (docs/security.md). Kept for the whole process; any thread.
#pragma once

#include <string>

namespace berth {

/// To be called where a file is opened for reading, or named to be. One that is no plain file counts for nothing.
void note_read(const std::string& path) noexcept;

/// It is one of them.
[[nodiscard]] bool was_read(const std::string& path) noexcept;

}  // namespace berth
