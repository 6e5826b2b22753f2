/// The planner for RAND, as a `Discovery`. Internal to `discovery`: `make` returns it.
#pragma once

#include "berth/discovery/auto.hpp"

namespace berth::discovery {

/// `nodeid::RandWalk`: walks the tree of chunks once.
[[nodiscard]] std::unique_ptr<Discovery> make_planner_rand(const Services& services);

}  // namespace berth::discovery
