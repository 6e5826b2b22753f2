/// A name as a person types it after a command: in quotes where a shell would part or change it.
#pragma once

#include <string>
#include <string_view>

namespace berth {

/// "left", "\"Berth I-O module\"".
[[nodiscard]] std::string shell_word(std::string_view name);

}  // namespace berth
