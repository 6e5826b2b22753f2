/// Which devices are on a bus (`berth scan`).
#pragma once

#include <bitset>
#include <vector>

#include "berth/operate/parts.hpp"
#include "berth/operate/seen.hpp"

namespace berth::operate {

/// Which nodes are asked.
enum class ScanRange : std::uint8_t {
  heard,  ///< nodes that were heard, by SDO upload; nothing else is sent
  all     ///< node-IDs 1..127 by SDO and guarding, devices without one by RAND and LSS
};

class Scan {
 public:
  /// Longer than the heartbeat period of most devices.
  static constexpr rt::Duration listens = std::chrono::seconds(2);

  explicit Scan(NetworkParts& parts) noexcept : p_(parts) {}
  /// `heard`: listens first, and does not ask a node that another SDO client is asking. `all`: changes only the
  /// devices' RAND state; waits for the turn.
  [[nodiscard]] rt::Task<Result<std::vector<Seen>>> run(ScanRange range);

 private:
  rt::Task<Result<std::vector<Seen>>> ask_who_was_heard();
  rt::Task<Result<std::vector<Seen>>> ask_everybody();
  rt::Task<void> ask_nodes(std::vector<Seen>& nodes, std::bitset<128> ids, ScanRange range);
  rt::Task<void> ask(NodeId id, Seen& seen, ScanRange range);
  rt::Task<void> add(discovery::Found d, std::vector<Seen>& nodes);
  void tell_state(Seen& seen, ScanRange range) const;
  void name_slots(std::vector<Seen>& nodes) const;
  NetworkParts& p_;
};

}  // namespace berth::operate
