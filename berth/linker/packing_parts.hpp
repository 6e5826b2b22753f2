/// Many objects in few PDOs. Between the sources of room `linker`.
#pragma once

#include <optional>
#include <vector>

#include "berth/linker/resolve_parts.hpp"

namespace berth::linker {

/// Something in a mapping: a signal, or an object of a fixed mapping that no link wants.
struct Item {
  co::PdoEntry entry{};  ///< of the producer
  std::optional<std::size_t> signal = {};
};

/// A PDO to be.
struct Bin {
  std::size_t producer = 0;
  TransmissionType transmission = at_change;
  bool mpdo = false;
  bool fixed = false;      ///< its mapping cannot be changed
  bool earlier = false;    ///< it was there in the earlier plan
  std::uint16_t tpdo = 0;  ///< 0: not yet known
  std::uint16_t can_id = 0;
  std::vector<Item> items = {};
};

struct Packed {
  std::vector<Bin> bins;
  std::vector<std::size_t> left;  ///< signals for which there is no PDO, ascending
};

[[nodiscard]] Packed pack(const LinkNetwork& network, const std::vector<DevicePdos>& devices,
                          const std::vector<Signal>& signals, const Earlier& earlier);

/// Nodes that receive it, ascending.
[[nodiscard]] std::vector<std::size_t> receivers_of(const Bin& bin, const std::vector<Signal>& signals);
[[nodiscard]] std::optional<rt::Duration> deadline_of(const Bin& bin, const std::vector<Signal>& signals);

/// What stands in the RPDO of one receiver: its objects, and dummies for what it does not want up to the PDO's end, so
/// that it is as long as what comes. Empty when its dummies cannot do that.
[[nodiscard]] std::optional<std::vector<co::PdoEntry>> rpdo_mapping(const Bin& bin, const std::vector<Signal>& signals,
                                                                    std::size_t node, const DevicePdos& device);

}  // namespace berth::linker
