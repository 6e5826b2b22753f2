/// Texts of errors that are put together where the error arises: `Error::text` points to what stays.
#pragma once

#include <string>

namespace berth {

/// The same text, for as long as the process. Each different one takes its memory once, so only for texts of which
/// there are few: of each file, or each slot, one. Any thread.
[[nodiscard]] const char* kept(std::string text);

}  // namespace berth
