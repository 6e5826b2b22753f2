/// What Berth may send on a bus: `role` of a machine file's bus, and what the gate lets pass (`gate.hpp`).
#pragma once

#include <cstdint>

namespace berth::live {

enum class Role : std::uint8_t {
  master,        ///< all
  commissioner,  ///< never NMT start or reset, never SYNC: node-IDs and configuration beside another master
  reader,        ///< SDO uploads, segmented, and nothing else: a look at a machine that others run; of no machine file
  observer       ///< no frame
};

}  // namespace berth::live
