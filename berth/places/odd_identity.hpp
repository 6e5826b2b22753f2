/// A device whose 1018h is not what it was, or not what LSS tells: is it another device, or one that does not know
/// itself?
#pragma once

#include <string>

#include "berth/base/ids.hpp"
#include "berth/places/binder.hpp"
#include "berth/places/identity.hpp"

namespace berth::places {

/// `who` answered alone under `node`, where `expected` should. What excuses the difference; nothing: it is another
/// device. Asks 1018h again, and LSS with `asks_lss`: the device that LSS knows as `expected` must use this node-ID.
/// `turn`: of LSS, if it is not this task's.
[[nodiscard]] rt::Task<Uncompared> excuse(Binder::Services services, NodeId node, Identity who, Identity expected,
                                          bool asks_lss, rt::Turn* turn);

/// For people: which parts are not compared, and why.
[[nodiscard]] std::string words_of(const Uncompared& parts);

}  // namespace berth::places
