/// For a device whose 1018h differs from its last one, or from LSS: decides whether it is another device, or one that
/// reports its identity wrongly.
#pragma once

#include <string>

#include "berth/base/ids.hpp"
#include "berth/places/binder.hpp"
#include "berth/places/identity.hpp"

namespace berth::places {

/// Only `who` answered under `node`, where `expected` should. Returns what excuses the difference; nothing: it is
/// another device. Asks 1018h again, and with `asks_lss` also LSS: the device that LSS knows as `expected` must use
/// this node-ID. `turn`: of LSS, if it is not this task's.
[[nodiscard]] rt::Task<Uncompared> excuse(Binder::Services services, NodeId node, Identity who, Identity expected,
                                          bool asks_lss, rt::Turn* turn);

/// For users: which parts are not compared, and why.
[[nodiscard]] std::string words_of(const Uncompared& parts);

}  // namespace berth::places
