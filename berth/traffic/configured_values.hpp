/// A slot's object dictionary as it is when Berth has configured it: defaults, then the configuration (`config =`),
/// then what the links set.
#pragma once

#include <memory>

#include "berth/od/values.hpp"
#include "berth/traffic/link_network.hpp"

namespace berth::traffic {

/// Null: nothing is known of the slot's device. `links`: of a plan without errors, or null. `node`: index in
/// `links->network.nodes`, of a slot its index in the machine. A configuration that cannot be used sets nothing.
[[nodiscard]] std::unique_ptr<od::Values> configured_values(const design::Slot& slot, const LinkPlan* links,
                                                            std::size_t node);

}  // namespace berth::traffic
