/// One node that `berth scan` found.
#pragma once

#include <cstdint>
#include <optional>
#include <string>

#include "berth/base/ids.hpp"
#include "berth/co/nmt.hpp"

namespace berth::operate {

/// What a scan found at one node-ID, or of a device without one.
struct Seen {
  NodeId id;                                 ///< unconfigured: found by RAND, without a node-ID
  std::optional<Identity> device;            ///< from 1018h, or from RAND
  std::optional<std::uint32_t> device_type;  ///< 1000h
  std::optional<NmtState> state;             ///< from its error control messages
  bool left_alone = false;                   ///< not asked: another SDO client talks to it
  bool duplicate = false;                    ///< more than one device answered under this node-ID or address
  std::string slot;                          ///< the slot it belongs to, if any
};

}  // namespace berth::operate
