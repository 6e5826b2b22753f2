/// A fleet as people ask about it: which machines are there, and which of their slots need somebody. Reads what
/// machines publish (facts.hpp; docs/fleet.md §What is published). Pure.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "berth/sparkplug/fleet.hpp"

namespace berth::fleet {

struct SlotView {
  std::string name{};
  std::string state{};  ///< "operational"
  std::string reason{};
  std::string emcy{};           ///< the error that its device reports now, in words; empty: none
  std::string configuration{};  ///< "as wanted"; empty: no device is there
  std::string program{};
  bool needs = false;  ///< somebody: the machine is not operational because of it
  friend bool operator==(const SlotView&, const SlotView&) = default;
};

struct MachineView {
  sparkplug::EdgeNodeId id{};
  bool online = false;
  bool in_doubt = false;  ///< something was missed: the values are older ones
  bool is_berth = false;  ///< another maker's edge node has only `id`, `online` and `since`
  bool operational = false;
  std::string version{};                   ///< of Berth
  std::string studio{};                    ///< address of its Studio; empty: it has none
  sparkplug::Utc since{};                  ///< of its birth or its death
  std::vector<SlotView> slots{};           ///< by name
  std::vector<std::string> bus_trouble{};  ///< "bus line is bus-off"
  friend bool operator==(const MachineView&, const MachineView&) = default;

  /// Somebody has to look: it is offline, a slot or a bus needs somebody, or it is not operational.
  [[nodiscard]] bool needs() const noexcept { return !online || (is_berth && (!operational || !bus_trouble.empty())); }
};

/// By group and name.
[[nodiscard]] std::vector<MachineView> machines_of(const sparkplug::Fleet& fleet);

/// What somebody should look at, in one line: "offline", "slot left: absent, ...", "bus line is bus-off". Empty:
/// nothing.
[[nodiscard]] std::string trouble_of(const MachineView& machine);

/// What differs between two looks at one machine, a line each: "slot left: operational → absent".
[[nodiscard]] std::vector<std::string> changes_between(const MachineView& before, const MachineView& now);

}  // namespace berth::fleet
