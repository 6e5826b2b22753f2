/// What hosts may command, as metrics, and what a written one asks of Berth (docs/fleet.md §Commands). Pure.
#pragma once

#include <string>
#include <tl/expected.hpp>
#include <vector>

#include "berth/command/request.hpp"
#include "berth/design/machine.hpp"
#include "berth/fleet/signals.hpp"
#include "berth/sparkplug/edge_node.hpp"

namespace berth::fleet {

/// "Commands/Replace/SLOT" and "Commands/NMT/BUS", as far as `allowed` lists them.
[[nodiscard]] std::vector<sparkplug::OwnMetric> node_commands(const design::Machine& machine,
                                                              const design::BusCommands& allowed, sparkplug::Utc at);
/// Of each device: "Commands/Locate" and "Commands/NMT".
[[nodiscard]] std::vector<sparkplug::OwnMetric> device_commands(const design::BusCommands& allowed, sparkplug::Utc at);

struct Asked {
  command::Request request;
  bool writes_signal = false;  ///< allowed by `writable = true`, not by `commands`
};
/// The request of a command whose metric the node has. The error says, for people, why it is none.
[[nodiscard]] tl::expected<Asked, std::string> request_of(const sparkplug::Command& command,
                                                          const design::Machine& machine,
                                                          const std::vector<Signal>& signals);

/// The last command that was carried out, and the last that was not: data sets of one row.
constexpr const char* done_metric = "Commands/Done";
constexpr const char* refused_metric = "Commands/Refused";
/// A command's end, as that row: Time, Device, Command, Value, Answer.
[[nodiscard]] sparkplug::Value end_of(const std::string& device, const std::string& metric, const std::string& value,
                                      const std::string& answer, sparkplug::Utc at);
/// A value of a command in words: "left", "10".
[[nodiscard]] std::string words_of(const sparkplug::Value& value);

}  // namespace berth::fleet
