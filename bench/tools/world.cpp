#include "bench/tools/world.hpp"

#include <cstdio>
#include <cstdlib>
#include <filesystem>

namespace berth::bench {

plant::PlantFile plant_of(unsigned count, bool configured, plant::Duration response) {
  plant::PlantFile plant;
  plant.buses.push_back({bus_name, 0});
  for (unsigned i = 1; i <= count; ++i) {
    plant::PlantDevice device;
    device.name = "d" + std::to_string(i);
    device.bus = bus_name;
    device.address = {.vendor = 1, .product = 1, .revision = 0, .serial = i};
    device.response = {response, response, 0, plant::Duration(0)};
    if (configured) {
      device.source = plant::NodeIdSource::hard_coded;
      device.node_id = NodeId(static_cast<std::uint8_t>(i));
    }
    plant.devices.push_back(device);
  }
  return plant;
}

design::Machine machine_of(unsigned slots, std::uint32_t bit_rate) {
  design::Machine machine;
  machine.name = "bench";
  design::Bus bus;
  bus.name = bus_name;
  bus.bitrate = bit_rate;
  machine.buses.push_back(bus);
  for (unsigned id = 1; id <= slots; ++id) {
    design::Slot slot;
    slot.spec.name = {machine.name, bus.name, "s" + std::to_string(id)};
    slot.spec.id = NodeId(static_cast<std::uint8_t>(id));
    slot.spec.type = {1, 1};
    slot.spec.when_ambiguous = places::WhenAmbiguous::first_seen;
    machine.slots.push_back(slot);
  }
  return machine;
}

std::unique_ptr<plant::World> start(const plant::PlantFile& plant, std::uint32_t bit_rate) {
  Findings findings;
  const plant::BusRate rate{bus_name, bit_rate};
  auto world = plant::World::make(plant, {&rate, 1}, findings);
  for (const auto& finding : findings) std::fprintf(stderr, "%s\n", to_string(finding).c_str());
  if (!world) std::exit(3);
  world->start();
  return world;
}

bool run(sim::World& world, rt::Task<void> task, rt::Duration limit) {
  rt::Scope scope(world.executor());
  scope.spawn(std::move(task));
  return world.run_until([&] { return scope.running() == 0; }, limit);
}

std::string eds_folder() {
  const char* named = std::getenv("BERTH_EDS_DIR");
  const std::string folder = named != nullptr ? named : BERTH_SOURCE_DIR "/../shared/eds";
  return std::filesystem::is_directory(folder) ? folder : std::string();
}

}  // namespace berth::bench
