/// Packs many objects into few PDOs. Internal to room `linker`.
#pragma once

#include <optional>
#include <vector>

#include "berth/linker/resolve_parts.hpp"

namespace berth::linker {

/// An entry of a mapping: a signal, or an object of a fixed mapping that no link uses.
struct Item {
  co::PdoEntry entry{};  ///< of the producer
  std::optional<std::size_t> signal = {};
};

/// A planned PDO.
struct Bin {
  std::size_t producer = 0;
  TransmissionType transmission = at_change;
  bool mpdo = false;
  bool fixed = false;      ///< its mapping cannot be changed
  bool earlier = false;    ///< from the earlier plan
  std::uint16_t tpdo = 0;  ///< 0: not yet known
  std::uint16_t can_id = 0;
  std::vector<Item> items = {};
};

struct Packed {
  std::vector<Bin> bins;
  std::vector<std::size_t> left;  ///< signals without a PDO, ascending
};

[[nodiscard]] Packed pack(const LinkNetwork& network, const std::vector<DevicePdos>& devices,
                          const std::vector<Signal>& signals, const Earlier& earlier);

/// Nodes that receive it, ascending.
[[nodiscard]] std::vector<std::size_t> receivers_of(const Bin& bin, const std::vector<Signal>& signals);
[[nodiscard]] std::optional<rt::Duration> deadline_of(const Bin& bin, const std::vector<Signal>& signals);

/// The mapping of one receiver's RPDO: its objects, and dummies for the others up to the PDO's end, so that the lengths
/// match. Empty if its dummies cannot do that.
[[nodiscard]] std::optional<std::vector<co::PdoEntry>> rpdo_mapping(const Bin& bin, const std::vector<Signal>& signals,
                                                                    std::size_t node, const DevicePdos& device);

}  // namespace berth::linker
