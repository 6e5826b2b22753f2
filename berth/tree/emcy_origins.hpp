/// The slots of a machine that a forwarded EMCY may be about. Its bytes name the node-IDs on the way, but no port of a
/// gateway; a layout has room for a limited number, and the deepest are lost; a gateway without a layout reports EMCYs
/// from beneath as its own. Pure.
#pragma once

#include <string>
#include <vector>

#include "berth/design/machine.hpp"
#include "berth/multilevel/emcy_layout.hpp"

namespace berth::tree {

struct EmcyOrigins {
  /// Slots on buses beneath gateways, without a port of Berth's, with exactly these node-IDs on the way, whatever the
  /// ports: none, one, or several.
  std::vector<const design::Slot*> named;
  /// Slots beneath the last node named.
  std::vector<const design::Slot*> beneath;
  /// The message may have lost node-IDs: it is about one of `beneath` or of `named`.
  bool may_be_deeper = false;
};

/// `top`: the bus on which it was heard, where Berth has a port.
[[nodiscard]] EmcyOrigins origins_of(const design::Machine& machine, const std::string& top,
                                     multilevel::EmcyLayout layout, const multilevel::EmcyReading& reading);

}  // namespace berth::tree
