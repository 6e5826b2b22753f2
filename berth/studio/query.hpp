/// The part of an address after the '?'. Internal to room `studio`.
#pragma once

#include <optional>
#include <string>
#include <string_view>

namespace berth::studio {

/// "sdo 605#" from "sdo%20605%23" or "sdo+605%23"; empty: a percent sign without its two digits.
[[nodiscard]] std::optional<std::string> decoded(std::string_view text);

}  // namespace berth::studio
