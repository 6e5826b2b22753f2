/// Permanent storage for error texts that are composed where the error arises, because `Error::text` needs one.
#pragma once

#include <string>

namespace berth {

/// The same text, stored until the process ends. Each different text is stored once, so use it only for few texts: one
/// for each file, or each slot. Any thread.
[[nodiscard]] const char* kept(std::string text);

}  // namespace berth
