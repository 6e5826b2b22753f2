#include "berth/fleet/machines_json.hpp"

#include <nlohmann/json.hpp>
#include <string>
#include <type_traits>

namespace berth::fleet {

using Json = nlohmann::ordered_json;

namespace {

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

Json json_of_slot(const SlotView& slot) {
  return {{"name", slot.name},
          {"state", slot.state},
          {"reason", slot.reason},
          {"emcy", slot.emcy},
          {"configuration", slot.configuration},
          {"program", slot.program},
          {"needs_somebody", slot.needs}};
}

}  // namespace

Json machine_json(const MachineView& machine) {
  Json slots = Json::array();
  for (const auto& slot : machine.slots) slots.push_back(json_of_slot(slot));
  return {{"group", machine.id.group},         {"machine", machine.id.node},    {"online", machine.online},
          {"in_doubt", machine.in_doubt},      {"is_berth", machine.is_berth},  {"operational", machine.operational},
          {"needs_somebody", machine.needs()}, {"reason", trouble_of(machine)}, {"version", machine.version},
          {"studio", machine.studio},          {"since_ms", machine.since.ms},  {"bus_trouble", machine.bus_trouble},
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

}  // namespace berth::fleet
