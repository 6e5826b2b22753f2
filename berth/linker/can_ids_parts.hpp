/// CAN-IDs and numbers of the PDOs that are made for links. Between the sources of room `linker`.
#pragma once

#include <vector>

#include "berth/linker/packing_parts.hpp"

namespace berth::linker {

struct Numbered {
  std::vector<Pdo> pdos;          ///< ascending by bus, producer and TPDO
  std::vector<std::size_t> left;  ///< signals of PDOs for which no number or CAN-ID is left, ascending
};

/// `by_deadline`: the CAN-IDs of new PDOs are in the order of their deadlines, whatever the predefined connection set
/// says.
[[nodiscard]] Numbered number(const LinkNetwork& network, const std::vector<DevicePdos>& devices,
                              const std::vector<Signal>& signals, const std::vector<bool>& linked, const Packed& packed,
                              const Earlier& earlier, bool by_deadline);

}  // namespace berth::linker
