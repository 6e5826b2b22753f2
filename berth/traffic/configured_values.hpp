/// A slot's object dictionary after Berth has configured it: defaults, then the configuration (`config =`), then the
/// links' settings.
#pragma once

#include <memory>

#include "berth/od/values.hpp"
#include "berth/traffic/link_network.hpp"

namespace berth::traffic {

/// Null: the slot's device is unknown. `links`: of a plan without errors, or null. `node`: index in
/// `links->network.nodes`, for a slot its index in the machine. An unusable configuration sets nothing.
[[nodiscard]] std::unique_ptr<od::Values> configured_values(const design::Slot& slot, const LinkPlan* links,
                                                            std::size_t node);

}  // namespace berth::traffic
