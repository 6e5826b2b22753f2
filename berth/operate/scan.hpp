/// Which devices are on a bus (`berth scan`).
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "berth/operate/parts.hpp"

namespace berth::operate {

/// What a scan found at one node-ID, or without one.
struct Seen {
  NodeId id;                                 ///< unconfigured: found by RAND, without a node-ID
  std::optional<LssAddress> device;          ///< from 1018h, or from RAND
  std::optional<std::uint32_t> device_type;  ///< 1000h
  std::optional<NmtState> state;             ///< from its error control messages
  bool duplicate = false;                    ///< more than one device answered under this node-ID or address
  std::string slot;                          ///< the slot it belongs to, if any
};

class Scan {
 public:
  explicit Scan(Parts& parts) noexcept : p_(parts) {}
  /// Node-IDs 1..127 by SDO, devices without one by RAND. Changes nothing but the devices' RAND state. Waits for its
  /// turn.
  [[nodiscard]] rt::Task<Result<std::vector<Seen>>> run();

 private:
  rt::Task<void> ask(NodeId id, Seen& seen, co::SdoOptions patience);
  Parts& p_;
};

}  // namespace berth::operate
