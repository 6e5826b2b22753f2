/// Plots the bounds of one or more buses: a row for each message, by priority, times on one logarithmic scale.
#pragma once

#include <span>
#include <string>

#include "berth/analysis/response.hpp"

namespace berth::analysis {

/// One bus of a plot. All members must exist until the plot is made.
struct PlottedBus {
  std::string title;  ///< above it, "field, 250000 bit/s, 31.2 % of the bus"
  const Line* line = nullptr;
  const Result* result = nullptr;  ///< of `line`; the plot leaves out messages that it leaves out
};

/// A complete SVG: each message's worst case as a bar that begins at its frame's length, and its deadline as a stroke.
/// Another colour marks late messages and those without a bound (a bar to the edge).
[[nodiscard]] std::string plot(std::span<const PlottedBus> buses);

}  // namespace berth::analysis
