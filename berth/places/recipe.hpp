/// How a device without LSS gets its node-ID: objects to write, as its manufacturer describes. A recipe is data of the
/// device library; `RecipeBinding` (`berth/places/recipe_binding.hpp`) carries it out.
///
/// All such devices leave the factory with one node-ID, and are added one at a time: only one may answer there.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "berth/base/ids.hpp"

namespace berth::places {

struct Recipe {
  /// One object to write by SDO.
  struct Write {
    std::uint16_t index = 0;
    std::uint8_t sub = 0;
    std::uint8_t size = 1;    ///< bytes, 1 to 8, little-endian
    std::uint64_t value = 0;  ///< unless `node_id`
    bool node_id = false;     ///< the new node-ID, in place of `value`
    friend bool operator==(const Write&, const Write&) = default;
  };
  /// What activates the new node-ID.
  enum class After : std::uint8_t { reset_node, reset_communication, power_cycle };

  std::string name;           ///< of the device type in the library
  std::vector<NodeId> from;   ///< factory node-IDs of such devices; at least one
  std::vector<Write> writes;  ///< in this order; at least one has `node_id`, the last may be a signature
  After after = After::reset_node;
  friend bool operator==(const Recipe&, const Recipe&) = default;
};

}  // namespace berth::places
