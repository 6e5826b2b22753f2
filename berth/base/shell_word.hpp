/// A name as typed after a command: in quotes if a shell would split or change it.
#pragma once

#include <string>
#include <string_view>

namespace berth {

/// "left", "\"Berth I-O module\"".
[[nodiscard]] std::string shell_word(std::string_view name);

}  // namespace berth
