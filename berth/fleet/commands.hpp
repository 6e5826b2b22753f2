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

/// The property (Boolean) of a command that a user has confirmed it: it may disturb operational devices.
constexpr const char* confirmed_key = "confirmed";
/// Of a device (Bytes): a DCF, an XDC or a concise DCF becomes its slot's configuration, and the device is restarted to
/// take it (`berth configure SLOT --from FILE --restart`). May be a zlib stream of that.
constexpr const char* configure_metric = "Commands/Configure";
/// Of a device (Bytes): an image, which becomes its slot's program 1 and is downloaded (`berth program download SLOT
/// --file IMAGE --keep`). May be a zlib stream of that.
constexpr const char* program_metric = "Commands/Program";

/// "Commands/Replace/SLOT" and "Commands/NMT/BUS", as far as `allowed` lists them.
[[nodiscard]] std::vector<sparkplug::OwnMetric> node_commands(const design::Machine& machine,
                                                              const design::BusCommands& allowed, sparkplug::Utc at);
/// Of each device: "Commands/Locate", "Commands/NMT", `configure_metric` and `program_metric`.
[[nodiscard]] std::vector<sparkplug::OwnMetric> device_commands(const design::BusCommands& allowed, sparkplug::Utc at);

struct Asked {
  command::Request request;
  bool writes_signal = false;  ///< allowed by `writable = true`, not by `commands`
  bool takes_yes = false;      ///< `confirmed_key` counts: its permission says that devices are disturbed
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
/// A value of a command in words: "left", "10", "2048 bytes, CRC-32 1A2B3C4D".
[[nodiscard]] std::string words_of(const sparkplug::Value& value);

}  // namespace berth::fleet
