/// The messages of one bus, as the machine file, the slots' descriptions (`eds =`) and their configurations (`config
/// =`) say: what `analysis` bounds. Nothing is asked on the bus.
///
///     const auto found = command::messages_of(machine, *machine.bus("field"), {});
///     const auto result = analysis::analyze(found.line);
#pragma once

#include <string>
#include <vector>

#include "berth/analysis/response.hpp"
#include "berth/base/finding.hpp"
#include "berth/design/machine.hpp"

namespace berth::command {

/// What the files do not say. All times greater than 0.
struct LinkPlan;  // link_network.hpp
struct Assumptions {
  rt::Duration emcy = std::chrono::seconds(1);  ///< between two EMCYs of a device without an inhibit time (1015h)
  rt::Duration event =
      std::chrono::milliseconds(10);  ///< between two events of a TPDO with neither inhibit time nor timer
  rt::Duration sdo = std::chrono::milliseconds(10);   ///< between two SDO requests on the bus
  rt::Duration nmt = std::chrono::milliseconds(100);  ///< between two NMT commands
  /// Nodes whose frames leave in the order in which they came: slots' names; "all": every node, the master too.
  std::vector<std::string> fifo{};
  bool pdos = true;                 ///< false: TPDOs are left out, and nothing is said of links
  const LinkPlan* links = nullptr;  ///< the PDOs that `berth up` lays, without errors; null: none
};

struct BusMessages {
  analysis::Line line;  ///< senders: the slots in their order, then the master; messages by priority
  Findings notes;       ///< what had to be assumed, and which link is kept by no message
};

/// Heartbeats of slots and master, SYNC, TPDOs, EMCYs, NMT commands and the SDO channel between master and devices. A
/// TPDO's period is its inhibit time, or its event timer where it has none, or its SYNCs'. A message's deadline is its
/// period, or the shortest `[[link]]` deadline of an object that it carries; SDO and EMCY have none. LSS and RAND are
/// the frame that may be on the wire already.
[[nodiscard]] BusMessages messages_of(const design::Machine& machine, const design::Bus& bus,
                                      const Assumptions& assumptions);

}  // namespace berth::command
