/// The broker of a machine: `[mqtt]` of its file, and what the command line says instead.
#pragma once

#include <string>
#include <tl/expected.hpp>

#include "berth/design/machine.hpp"
#include "berth/fleet/edge.hpp"

namespace berth::fleet {

/// `broker`: instead of the file's; empty: the file's. `backlog_file`: empty: none. The error is for people, with its
/// place if it is in the file.
[[nodiscard]] tl::expected<EdgeOptions, std::string> edge_options(const design::Machine& machine,
                                                                  const std::string& broker,
                                                                  const std::string& backlog_file);

}  // namespace berth::fleet
