/// Differences between a device and a file, for replies.
#pragma once

#include "berth/command/reply.hpp"
#include "berth/manager/configurator.hpp"

namespace berth::command {

/// {"object", "name", "line", "has", "wants"}: "has" is missing if the value cannot be read.
[[nodiscard]] Json difference_json(const manager::Difference& difference);

}  // namespace berth::command
