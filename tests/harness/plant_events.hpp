// Events of a plant whose bus is "backbone".
#pragma once

#include <string>

#include "berth/plant/plant_file.hpp"

namespace berth::harness {

inline plant::PlantEvent event(plant::Action action, rt::Duration at, const std::string& device = {}) {
  plant::PlantEvent e;
  e.action = action;
  e.delay = at;
  e.device = device;
  e.bus = "backbone";
  return e;
}

// For `time` from `at` on.
inline void cut(plant::PlantFile& p, const std::string& device, rt::Duration at, rt::Duration time) {
  auto cable = event(plant::Action::cut_cable, at);
  cable.nodes = {device};
  p.events.push_back(cable);
  p.events.push_back(event(plant::Action::join, at + time));
}

}  // namespace berth::harness
