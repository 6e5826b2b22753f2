/// Files of this user: slot tables, locks, records. Other users must not read them, nor lock them (their lock would
/// stop Berth's next start).
#pragma once

#include <sys/types.h>

#include <string>

namespace berth {

/// The mode of such a file: 0600; in a folder with the set-group-ID bit, whose files belong to the folder's group,
/// 0640.
[[nodiscard]] mode_t private_mode(const std::string& path) noexcept;

/// Makes an empty file of that mode if there is none; an existing file stays unchanged. False: see errno.
bool make_private(const std::string& path) noexcept;

}  // namespace berth
