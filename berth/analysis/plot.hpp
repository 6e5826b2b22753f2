/// The bounds of one or more buses as a picture: a row for each message, by priority, times on one logarithmic scale.
#pragma once

#include <span>
#include <string>

#include "berth/analysis/response.hpp"

namespace berth::analysis {

/// One bus of a plot. All must stay until it is made.
struct PlottedBus {
  std::string title;  ///< above it, "field, 250000 bit/s, 31.2 % of the bus"
  const Line* line = nullptr;
  const Result* result = nullptr;  ///< of `line`; messages that are left out here are left out there
};

/// An SVG, whole: each message's worst case as a bar from the length of its frame on, its deadline as a stroke; what is
/// late, and what has no bound (a bar to the edge), in another colour.
[[nodiscard]] std::string plot(std::span<const PlottedBus> buses);

}  // namespace berth::analysis
