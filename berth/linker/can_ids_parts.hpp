/// CAN-IDs and numbers of the PDOs made for links. Internal to room `linker`.
#pragma once

#include <vector>

#include "berth/linker/packing_parts.hpp"

namespace berth::linker {

struct Numbered {
  std::vector<Pdo> pdos;          ///< ascending by bus, producer and TPDO
  std::vector<std::size_t> left;  ///< signals of PDOs without a free number or CAN-ID, ascending
};

/// `by_deadline`: orders the CAN-IDs of new PDOs by their deadlines, whatever the predefined connection set says.
[[nodiscard]] Numbered number(const LinkNetwork& network, const std::vector<DevicePdos>& devices,
                              const std::vector<Signal>& signals, const std::vector<bool>& linked, const Packed& packed,
                              const Earlier& earlier, bool by_deadline);

}  // namespace berth::linker
