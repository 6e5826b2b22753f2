/// Which slots of a machine an emergency may be about that came up through gateways. Its bytes name the node-IDs on the
/// way and no port of a gateway; a layout has room for so many of them, and the deepest are lost; a gateway without a
/// layout tells what is beneath it as its own. Pure.
#pragma once

#include <string>
#include <vector>

#include "berth/design/machine.hpp"
#include "berth/multilevel/emcy_layout.hpp"

namespace berth::tree {

struct EmcyOrigins {
  /// On buses beneath gateways without a port of Berth's, with just these node-IDs on the way, whatever the ports:
  /// none, one, or several.
  std::vector<const design::Slot*> named;
  /// Beneath the last node named.
  std::vector<const design::Slot*> beneath;
  /// The message may have lost node-IDs: it is about one of `beneath` as well as of `named`.
  bool may_be_deeper = false;
};

/// `top`: the bus on which it was heard, where Berth has a port.
[[nodiscard]] EmcyOrigins origins_of(const design::Machine& machine, const std::string& top,
                                     multilevel::EmcyLayout layout, const multilevel::EmcyReading& reading);

}  // namespace berth::tree
