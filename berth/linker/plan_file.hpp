/// The file that keeps a plan for the next one (`plan.toml`): which objects are in which PDO. It is readable; users
/// need not write it.
///
///     format = 1
///     [[variable]]
///     slot = "press"
///     name = "speed"
///     type = "UNSIGNED16"
///     direction = "input"
///     object = "A100h:01"
///     [[pdo]]
///     producer = "press"
///     tpdo = 1
///     can_id = 385
///     transmission = 255
///     objects = ["A100h:01"]
///     receivers = ["belt"]
///     rpdos = [1]
#pragma once

#include <optional>
#include <string>
#include <string_view>

#include "berth/base/finding.hpp"
#include "berth/linker/plan.hpp"

namespace berth::linker {

[[nodiscard]] std::string write(const Earlier& plan);

/// Empty when a finding is an error; each has its place.
[[nodiscard]] std::optional<Earlier> read_plan(std::string_view text, const std::string& file, Findings& findings);

}  // namespace berth::linker
