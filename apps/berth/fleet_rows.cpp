#include "fleet_rows.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <nlohmann/json.hpp>

#include "berth/text/columns.hpp"
#include "berth/text/printable.hpp"

namespace berth::cli {
namespace {

using fleet::MachineView;
using fleet::SlotView;
using Json = nlohmann::ordered_json;

// "3 min", the largest unit alone.
std::string age(std::uint64_t now_ms, std::uint64_t then_ms) {
  const std::uint64_t seconds = now_ms > then_ms ? (now_ms - then_ms) / 1000 : 0;
  if (seconds < 60) return fmt::format("{} s", seconds);
  if (seconds < 3600) return fmt::format("{} min", seconds / 60);
  if (seconds < 48 * 3600) return fmt::format("{} h", seconds / 3600);
  return fmt::format("{} d", seconds / 86400);
}

std::string state_of(const MachineView& machine) {
  if (!machine.online) return "offline";
  if (machine.in_doubt) return "in doubt";
  if (!machine.is_berth) return "online";
  return machine.operational ? "operational" : "not operational";
}

struct Widths {
  std::size_t group = 5;
  std::size_t machine = 7;
  std::size_t state = 5;
  std::size_t version = 5;
  std::size_t since = 5;
};

std::string shown(const std::string& name) { return text::one_line(name); }

Widths widths_of(const std::vector<MachineView>& machines, std::size_t columns) {
  Widths widths;
  for (const auto& machine : machines) {
    widths.group = std::max(widths.group, text::columns(shown(machine.id.group)));
    widths.machine = std::max(widths.machine, text::columns(shown(machine.id.node)));
    widths.state = std::max(widths.state, state_of(machine).size());
    widths.version = std::max(widths.version, text::columns(shown(machine.version)));
  }
  const std::size_t others = widths.state + widths.version + widths.since + 8;
  const std::size_t names = columns > others + 16 ? columns - others : 16;
  widths.group = std::min(widths.group, names / 2);
  widths.machine = std::min(widths.machine, names - widths.group);
  return widths;
}

std::string cell(const std::string& word, std::size_t width) {
  return text::padded(text::cut(shown(word), width), width) + "  ";
}

std::string row(const Widths& widths, const std::string& group, const std::string& machine, const std::string& state,
                const std::string& version, const std::string& since) {
  return cell(group, widths.group) + cell(machine, widths.machine) + cell(state, widths.state) +
         cell(version, widths.version) + since;
}

template <class T>
T member(const Json& json, const char* key) {
  const auto found = json.find(key);
  if (found == json.end()) return {};
  if constexpr (std::is_same_v<T, bool>) {
    return found->is_boolean() && found->template get<bool>();
  } else if constexpr (std::is_same_v<T, std::string>) {
    return found->is_string() ? found->template get<std::string>() : std::string();
  } else {
    return found->is_number_unsigned() ? found->template get<T>() : T{};
  }
}

Json slot_json(const SlotView& slot) {
  return {{"name", slot.name},
          {"state", slot.state},
          {"reason", slot.reason},
          {"emcy", slot.emcy},
          {"configuration", slot.configuration},
          {"program", slot.program},
          {"needs_somebody", slot.needs}};
}

}  // namespace

std::string fleet_headline(const std::vector<MachineView>& machines) {
  const auto needing = std::ranges::count_if(machines, &MachineView::needs);
  const char* const s = machines.size() == 1 ? "" : "s";
  if (machines.empty()) return "no machine is known";
  if (needing == 0) return fmt::format("{} machine{}, none needs somebody", machines.size(), s);
  return fmt::format("{} of {} machine{} need{} somebody", needing, machines.size(), s, needing == 1 ? "s" : "");
}

std::vector<BoardLine> fleet_lines(const std::vector<MachineView>& machines, std::uint64_t now_ms,
                                   std::size_t columns) {
  std::vector<const MachineView*> order;
  for (const auto& machine : machines) order.push_back(&machine);
  std::ranges::stable_sort(order, [](const auto* a, const auto* b) { return a->needs() && !b->needs(); });
  const Widths widths = widths_of(machines, columns);
  std::vector<BoardLine> lines{{.text = row(widths, "group", "machine", "state", "Berth", "since")}};
  for (const auto* const machine : order) {
    lines.push_back({.text = text::cut(row(widths, machine->id.group, machine->id.node, state_of(*machine),
                                           machine->version, age(now_ms, machine->since.ms)),
                                       columns),
                     .urgent = machine->needs()});
    if (!machine->online || !machine->needs()) continue;
    constexpr std::size_t indent = 2;
    const auto reasons = text::wrapped(shown(fleet::trouble_of(*machine)), std::max<std::size_t>(columns, 20) - indent);
    for (const auto& reason : reasons) lines.push_back({.text = std::string(indent, ' ') + reason, .urgent = true});
  }
  return lines;
}

std::vector<std::string> machine_lines(const MachineView& machine, std::uint64_t now_ms) {
  std::vector<std::string> lines{fmt::format("{}/{}: {}, since {}{}", machine.id.group, machine.id.node,
                                             state_of(machine), age(now_ms, machine.since.ms),
                                             machine.online ? "" : "; what follows is what it last reported")};
  if (!machine.version.empty()) lines.push_back("Berth " + machine.version);
  if (!machine.studio.empty()) lines.push_back("Studio at " + machine.studio);
  for (const auto& trouble : machine.bus_trouble) lines.push_back(trouble);
  for (const auto& slot : machine.slots) {
    std::string line = fmt::format("slot {}: {}", slot.name, slot.state);
    if (!slot.reason.empty()) line += ", " + slot.reason;
    if (!slot.configuration.empty() && slot.configuration != "none") line += "; configuration " + slot.configuration;
    if (!slot.program.empty() && slot.program != "none") line += "; program " + slot.program;
    if (!slot.emcy.empty()) line += "; EMCY: " + slot.emcy;
    lines.push_back(std::move(line));
  }
  return lines;
}

Json machine_json(const MachineView& machine) {
  Json slots = Json::array();
  for (const auto& slot : machine.slots) slots.push_back(slot_json(slot));
  return {
      {"group", machine.id.group},         {"machine", machine.id.node},           {"online", machine.online},
      {"in_doubt", machine.in_doubt},      {"is_berth", machine.is_berth},         {"operational", machine.operational},
      {"needs_somebody", machine.needs()}, {"reason", fleet::trouble_of(machine)}, {"version", machine.version},
      {"studio", machine.studio},          {"since_ms", machine.since.ms},         {"bus_trouble", machine.bus_trouble},
      {"slots", std::move(slots)}};
}

MachineView machine_of_json(const Json& json) {
  MachineView machine;
  machine.id = {member<std::string>(json, "group"), member<std::string>(json, "machine")};
  machine.online = member<bool>(json, "online");
  machine.in_doubt = member<bool>(json, "in_doubt");
  machine.is_berth = member<bool>(json, "is_berth");
  machine.operational = member<bool>(json, "operational");
  machine.version = member<std::string>(json, "version");
  machine.studio = member<std::string>(json, "studio");
  machine.since.ms = member<std::uint64_t>(json, "since_ms");
  const auto trouble = json.find("bus_trouble");
  if (trouble != json.end() && trouble->is_array()) {
    for (const auto& each : *trouble) {
      if (each.is_string()) machine.bus_trouble.push_back(each.get<std::string>());
    }
  }
  const auto slots = json.find("slots");
  if (slots == json.end() || !slots->is_array()) return machine;
  for (const auto& each : *slots) {
    if (!each.is_object()) continue;
    machine.slots.push_back({.name = member<std::string>(each, "name"),
                             .state = member<std::string>(each, "state"),
                             .reason = member<std::string>(each, "reason"),
                             .emcy = member<std::string>(each, "emcy"),
                             .configuration = member<std::string>(each, "configuration"),
                             .program = member<std::string>(each, "program"),
                             .needs = member<bool>(each, "needs_somebody")});
  }
  return machine;
}

}  // namespace berth::cli
