/// The messages of one bus for `analysis`, from the machine file, the slots' descriptions (`eds =`) and their
/// configurations (`config =`). Asks nothing on the bus.
///
///     const auto found = traffic::messages_of(machine, *machine.bus("field"), {});
///     const auto result = analysis::analyze(found.line);
#pragma once

#include <string>
#include <vector>

#include "berth/analysis/response.hpp"
#include "berth/base/finding.hpp"
#include "berth/design/machine.hpp"

namespace berth::traffic {

struct LinkPlan;  // link_network.hpp

/// Assumptions about what the files do not say. All times greater than 0.
struct Assumptions {
  rt::Duration emcy = std::chrono::seconds(1);  ///< between two EMCYs of a device without an inhibit time (1015h)
  /// Between two frames of a TPDO that is sent at a change, has no inhibit time and no interval in its slot; 0:
  /// unknown, and so neither it nor any message of lower priority has a bound.
  rt::Duration event{0};
  rt::Duration sdo = std::chrono::milliseconds(10);   ///< between two SDO requests on the bus
  rt::Duration nmt = std::chrono::milliseconds(100);  ///< between two NMT commands
  /// Nodes that send frames in queue order, whatever their slots say: slots' names; "all": every node, the master too.
  std::vector<std::string> fifo{};
  bool pdos = true;                 ///< false: leaves out TPDOs, and reports nothing about links
  const LinkPlan* links = nullptr;  ///< the PDOs that `berth up` makes; null: none
};

struct BusMessages {
  analysis::Line line;  ///< senders: the slots in their order, then the master; messages by priority
  Findings notes;       ///< assumptions made, and links that no message keeps
};

/// Heartbeats of slots and master, SYNC, TPDOs, EMCYs, NMT commands and the SDO channel between master and devices. A
/// TPDO's period is its inhibit time, or the interval of its links or its slot, or its SYNCs'. A heartbeat's deadline
/// is its period, a TPDO's the shortest `[[link]]` deadline of an object that it carries, from the change to its
/// arrival; all others have none. LSS and RAND count as the frame that may already be on the wire.
[[nodiscard]] BusMessages messages_of(const design::Machine& machine, const design::Bus& bus,
                                      const Assumptions& assumptions);

}  // namespace berth::traffic
