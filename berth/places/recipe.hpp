/// How a device without LSS gets its node-ID: objects to write, as its maker describes it. A recipe is data of the
/// device library; `RecipeBinding` (`berth/places/recipe_binding.hpp`) walks it.
///
/// Such a device leaves the factory with one node-ID for all, and is taken in one at a time: it must be the only one
/// that answers there.
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
    bool node_id = false;     ///< the new node-ID is written here
    friend bool operator==(const Write&, const Write&) = default;
  };
  /// What brings the new node-ID into use.
  enum class After : std::uint8_t { reset_node, reset_communication, power_cycle };

  std::string name;           ///< of the device type in the library
  std::vector<NodeId> from;   ///< node-IDs that such devices leave the factory with; at least one
  std::vector<Write> writes;  ///< in this order; one of them at least has `node_id`, the last may be a signature
  After after = After::reset_node;
  friend bool operator==(const Recipe&, const Recipe&) = default;
};

}  // namespace berth::places
