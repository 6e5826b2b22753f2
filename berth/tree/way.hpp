/// How a bus of a machine is reached from a bus on which Berth has a port.
#pragma once

#include <string>
#include <vector>

#include "berth/design/machine.hpp"
#include "berth/multilevel/path.hpp"

namespace berth::tree {

struct Way {
  std::string bus;                             ///< on which Berth has a port
  std::vector<multilevel::Hop> gateways = {};  ///< from there down, topmost first
  friend bool operator==(const Way&, const Way&) = default;
};
[[nodiscard]] Way way_to(const design::Machine& machine, const std::string& bus);
/// The bus to which a way leads, whether Berth has a port there or not; null: the machine has none there.
[[nodiscard]] const design::Bus* bus_at(const design::Machine& machine, const Way& way) noexcept;

}  // namespace berth::tree
