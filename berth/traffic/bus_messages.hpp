/// The messages of one bus, as the machine file, the slots' descriptions (`eds =`) and their configurations (`config
/// =`) say: what `analysis` bounds. Nothing is asked on the bus.
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

/// What the files do not say. All times greater than 0.
struct Assumptions {
  rt::Duration emcy = std::chrono::seconds(1);  ///< between two EMCYs of a device without an inhibit time (1015h)
  /// Between two frames of a TPDO that is sent at a change, has no inhibit time and whose slot says none; 0: not known,
  /// and so neither it nor what gives way to it has a bound.
  rt::Duration event{0};
  rt::Duration sdo = std::chrono::milliseconds(10);   ///< between two SDO requests on the bus
  rt::Duration nmt = std::chrono::milliseconds(100);  ///< between two NMT commands
  /// Nodes whose frames leave in the order in which they came, whatever their slots say: slots' names; "all": every
  /// node, the master too.
  std::vector<std::string> fifo{};
  bool pdos = true;                 ///< false: TPDOs are left out, and nothing is said of links
  const LinkPlan* links = nullptr;  ///< the PDOs that `berth up` lays; null: none
};

struct BusMessages {
  analysis::Line line;  ///< senders: the slots in their order, then the master; messages by priority
  Findings notes;       ///< what had to be assumed, and which link is kept by no message
};

/// Heartbeats of slots and master, SYNC, TPDOs, EMCYs, NMT commands and the SDO channel between master and devices. A
/// TPDO's period is its inhibit time, or what its links or its slot say of it, or its SYNCs'. A heartbeat's deadline is
/// its period, a TPDO's the shortest `[[link]]` deadline of an object that it carries, from the change to its arrival;
/// all others have none. LSS and RAND are the frame that may be on the wire already.
[[nodiscard]] BusMessages messages_of(const design::Machine& machine, const design::Bus& bus,
                                      const Assumptions& assumptions);

}  // namespace berth::traffic
