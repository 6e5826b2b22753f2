/// The way to a bus of a machine from a bus on which Berth has a port.
#pragma once

#include <string>
#include <vector>

#include "berth/design/machine.hpp"
#include "berth/multilevel/path.hpp"

namespace berth::tree {

struct Way {
  std::string bus;                             ///< the bus on which Berth has a port
  std::vector<multilevel::Hop> gateways = {};  ///< from there down, topmost first
  friend bool operator==(const Way&, const Way&) = default;
};
[[nodiscard]] Way way_to(const design::Machine& machine, const std::string& bus);
/// The bus at the end of a way, with or without a port of Berth's; null: the machine has none there.
[[nodiscard]] const design::Bus* bus_at(const design::Machine& machine, const Way& way) noexcept;

}  // namespace berth::tree
