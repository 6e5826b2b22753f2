#include "berth/fleet/commands.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <string_view>

#include "berth/od/data_type.hpp"
#include "berth/od/notation.hpp"
#include "berth/text/printable.hpp"
#include "berth/text/quantity.hpp"

namespace berth::fleet {
namespace {

using sparkplug::DataType;
using sparkplug::OwnMetric;

constexpr std::string_view replace_path = "Commands/Replace/";
constexpr std::string_view nmt_path = "Commands/NMT/";
constexpr std::string_view locate_metric = "Commands/Locate";
constexpr std::string_view nmt_metric = "Commands/NMT";
constexpr std::size_t longest = 200;  // bytes of a name or a value from a host

OwnMetric writable(std::string name, DataType type, sparkplug::Utc at) {
  return {.name = std::move(name), .type = type, .value = sparkplug::Null{}, .at = at, .writable = true};
}

std::string place_of(const design::Slot& slot) { return slot.spec.name.bus + "/" + slot.spec.name.name; }

// Control characters, and what is no UTF-8, are written as text; a cell of a table must be UTF-8.
std::string shown(std::string_view text) {
  const bool cut = text.size() > longest;
  std::string out = text::one_line(std::string(text.substr(0, longest)));
  return cut ? out + "…" : out;
}

tl::unexpected<std::string> refuse(std::string why) { return tl::unexpected<std::string>(std::move(why)); }

std::optional<std::string> text_in(const sparkplug::Value& value) {
  const auto* const text = std::get_if<std::string>(&value);
  return text == nullptr || text->size() > longest ? std::nullopt : std::optional(*text);
}

tl::expected<Asked, std::string> replace(const std::string& slot_name, const sparkplug::Value& value,
                                         const design::Machine& machine) {
  const auto* const slot = machine.slot(slot_name);
  const auto device = text_in(value);
  if (slot == nullptr || !device) return refuse("write the LSS address of the new device, or an empty text");
  Asked asked{{"replace", {{"slot", place_of(*slot)}}}};
  if (!device->empty()) asked.request.arguments["device"] = *device;
  return asked;
}

// `bus`: for all its nodes; empty: `node` says it.
tl::expected<Asked, std::string> nmt(const std::string& bus, const std::string& node, const sparkplug::Value& value) {
  const auto word = text_in(value);
  if (!word) return refuse("write start, stop, preop, reset-node or reset-comm");
  Asked asked{{"nmt", {{"command", *word}, {"node", node}}}};
  if (!bus.empty()) asked.request.arguments["bus"] = bus;
  return asked;
}

tl::expected<Asked, std::string> locate(const design::Slot& slot, const sparkplug::Value& value) {
  const auto* const seconds = std::get_if<std::uint64_t>(&value);
  if (seconds == nullptr) return refuse("write the seconds, 1 to 600");
  return Asked{{"locate", {{"target", place_of(slot)}, {"seconds", fmt::format("{}", *seconds)}}}};
}

tl::expected<Asked, std::string> write(const Signal& signal, const design::Slot& slot, const sparkplug::Value& value) {
  const auto text = signal.text_for(value);
  if (!text || text->size() > longest) return refuse("the object cannot have this value");
  Asked asked{{"sdo write", {{"node", place_of(slot)}, {"object", od::write_object(signal.object)}, {"value", *text}}},
              true};
  if (!signal.type_is_described) asked.request.arguments["type"] = std::string(od::name(signal.type));
  return asked;
}

}  // namespace

std::vector<OwnMetric> node_commands(const design::Machine& machine, const design::BusCommands& allowed,
                                     sparkplug::Utc at) {
  std::vector<OwnMetric> metrics;
  if (allowed.allow("replace")) {
    for (const auto& slot : machine.slots)
      metrics.push_back(writable(std::string(replace_path) + slot.spec.name.name, DataType::string, at));
  }
  if (allowed.allow("nmt")) {
    for (const auto& bus : machine.buses)
      metrics.push_back(writable(std::string(nmt_path) + bus.name, DataType::string, at));
  }
  return metrics;
}

std::vector<OwnMetric> device_commands(const design::BusCommands& allowed, sparkplug::Utc at) {
  std::vector<OwnMetric> metrics;
  if (allowed.allow("locate")) metrics.push_back(writable(std::string(locate_metric), DataType::uint32, at));
  if (allowed.allow("nmt")) metrics.push_back(writable(std::string(nmt_metric), DataType::string, at));
  return metrics;
}

tl::expected<Asked, std::string> request_of(const sparkplug::Command& command, const design::Machine& machine,
                                            const std::vector<Signal>& signals) {
  const std::string_view metric = command.metric;
  if (command.device.empty()) {
    if (metric.starts_with(replace_path))
      return replace(std::string(metric.substr(replace_path.size())), command.value, machine);
    if (metric.starts_with(nmt_path)) return nmt(std::string(metric.substr(nmt_path.size())), "all", command.value);
    return refuse("the node has no such command");
  }
  const auto* const slot = machine.slot(command.device);
  if (slot == nullptr) return refuse("the machine has no such slot");
  if (metric == locate_metric) return locate(*slot, command.value);
  if (metric == nmt_metric) return nmt("", place_of(*slot), command.value);
  const auto signal = std::ranges::find_if(signals, [&](const Signal& each) {
    return each.metric == metric && &machine.slots[each.slot] == slot && each.wanted.writable;
  });
  if (signal == signals.end()) return refuse("the device has no such command");
  return write(*signal, *slot, command.value);
}

sparkplug::Value end_of(const std::string& device, const std::string& metric, const std::string& value,
                        const std::string& answer, sparkplug::Utc at) {
  sparkplug::DataSet row;
  row.columns.push_back({"Time", DataType::date_time});
  std::vector<sparkplug::Value> cells{at.ms};
  const auto add = [&](const char* column, const std::string& cell) {
    row.columns.push_back({column, DataType::string});
    cells.emplace_back(shown(cell));
  };
  add("Device", device);
  add("Command", metric);
  add("Value", value);
  add("Answer", answer);
  row.rows.push_back(std::move(cells));
  return sparkplug::Boxed<sparkplug::DataSet>(std::move(row));
}

std::string words_of(const sparkplug::Value& value) {
  if (const auto* text = std::get_if<std::string>(&value)) return shown(*text);
  if (const auto* flag = std::get_if<bool>(&value)) return *flag ? "true" : "false";
  if (const auto* whole = std::get_if<std::int64_t>(&value)) return fmt::format("{}", *whole);
  if (const auto* whole = std::get_if<std::uint64_t>(&value)) return fmt::format("{}", *whole);
  if (const auto* real = std::get_if<float>(&value)) return fmt::format("{}", *real);
  if (const auto* real = std::get_if<double>(&value)) return fmt::format("{}", *real);
  return "";
}

}  // namespace berth::fleet
