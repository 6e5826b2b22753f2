/// What hosts get of slots, devices and buses: names, types and values of the metrics (docs/fleet.md §What is
/// published). Pure.
#pragma once

#include <string>
#include <vector>

#include "berth/can/port.hpp"
#include "berth/operate/report.hpp"
#include "berth/sparkplug/own_metric.hpp"

namespace berth::fleet {

/// A metric's value, without its time.
struct Fact {
  std::string name;
  sparkplug::DataType type = sparkplug::DataType::unknown;
  sparkplug::Value value{};
};
using Facts = std::vector<Fact>;

/// The slot's device is there and its identity was checked, so that it is born at the broker. `was`: it is born; a
/// failure of its configuration, of its programs or of its start does not end that.
[[nodiscard]] bool is_there(const operate::SlotReport& slot, bool was) noexcept;

/// What the machine file wants of a slot's device.
struct Wanted {
  bool configuration = false;
  bool programs = false;
};
/// "none": nothing is wanted. Else "as wanted", "configuring", "power cycle needed", "failed", "unknown".
[[nodiscard]] const char* configuration_word(const operate::SlotReport& slot, bool wanted) noexcept;
/// "none", "as wanted", "different", "update failed", "unknown".
[[nodiscard]] const char* program_word(const operate::SlotReport& slot, bool wanted) noexcept;

/// Of a device. The same names in the same order for every report.
[[nodiscard]] Facts facts_of_device(const operate::SlotReport& slot, const Wanted& wanted);
/// Of a slot, as metrics of the node: they hold while no device is there.
[[nodiscard]] Facts facts_of_slot(const operate::SlotReport& slot);

struct BusFigures {
  std::string name;
  can::Status port{};
  double load_percent = 0;  ///< of the last interval
  std::string master{};     ///< for people
};
[[nodiscard]] Facts facts_of_bus(const BusFigures& bus);
/// "up", "down", "bus-off", "error passive".
[[nodiscard]] const char* port_word(const can::Status& port) noexcept;

/// Facts as metrics of one time.
[[nodiscard]] std::vector<sparkplug::OwnMetric> metrics_of(const Facts& facts, sparkplug::Utc at);

}  // namespace berth::fleet
