/// What Berth may send on a bus: `role` of a machine file's bus, and which frames the gate passes (`gate.hpp`).
#pragma once

#include <cstdint>

namespace berth::live {

enum class Role : std::uint8_t {
  master,        ///< everything
  commissioner,  ///< never NMT start or reset, never SYNC: node-IDs and configuration beside another master
  reader,        ///< segmented SDO uploads only: to look at a machine that others run; not in machine files
  observer       ///< no frame
};

}  // namespace berth::live
