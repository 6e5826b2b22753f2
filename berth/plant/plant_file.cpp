#include "berth/plant/plant_file.hpp"

#include <algorithm>

#include "berth/plant/plant_words.hpp"

namespace berth::plant {

const char* name(NodeIdSource source) noexcept { return source_words[static_cast<std::size_t>(source)].data(); }
const char* name(Habit habit) noexcept { return habit_words[static_cast<std::size_t>(habit)].data(); }
const char* name(After after) noexcept { return after_words[static_cast<std::size_t>(after)].data(); }
const char* name(Action action) noexcept { return action_words[static_cast<std::size_t>(action)].data(); }

bool operator==(const PlantDevice& a, const PlantDevice& b) noexcept {
  return a.name == b.name && a.bus == b.bus && a.eds == b.eds && a.does.script.file == b.does.script.file &&
         a.does.variables == b.does.variables && a.address == b.address && a.address_of_eds == b.address_of_eds &&
         a.source == b.source && a.node_id == b.node_id && a.node_id_object == b.node_id_object &&
         a.bitrate == b.bitrate && a.speaks == b.speaks && a.lss == b.lss && a.response == b.response &&
         a.boot == b.boot && a.reset == b.reset && a.storing == b.storing && a.controller == b.controller &&
         a.heartbeat == b.heartbeat && a.does.odd == b.does.odd && a.plugged == b.plugged &&
         a.does.master == b.does.master;
}

const PlantBus* PlantFile::bus(std::string_view bus_name) const noexcept {
  const auto it = std::ranges::find(buses, bus_name, &PlantBus::name);
  return it == buses.end() ? nullptr : &*it;
}

const PlantDevice* PlantFile::device(std::string_view device_name) const noexcept {
  const auto it = std::ranges::find(devices, device_name, &PlantDevice::name);
  return it == devices.end() ? nullptr : &*it;
}

GatewayPart PlantFile::gateway_part(std::string_view device_name) const noexcept {
  for (const auto& each : gateways) {
    if (each.above == device_name) return {static_cast<unsigned>(each.beneath.size()), each.signals, true};
    if (std::ranges::find(each.beneath, device_name) != each.beneath.end()) return {0, each.signals, true};
  }
  return {};
}

}  // namespace berth::plant
