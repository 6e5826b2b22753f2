// `berth plant`: a simulated plant in a process of its own, in real time, its buses offered to others.
#include <fmt/format.h>

#include <nlohmann/json.hpp>

#include "berth/io/plant_port.hpp"
#include "drive.hpp"

namespace berth::cli {
namespace {

using namespace std::chrono_literals;

// The buses' bit rates, from the machine file when one is given.
tl::expected<std::vector<plant::BusRate>, Failure> bus_rates(const Options& options) {
  std::vector<plant::BusRate> rates;
  if (options.machine.empty()) return rates;
  const auto machine = design::load_machine(options.machine);
  if (!machine.machine) return tl::unexpected(failure(machine.findings));
  for (const auto& bus : machine.machine->buses) rates.push_back({bus.name, bus.bitrate});
  return rates;
}

tl::expected<std::unique_ptr<plant::World>, Failure> world_of(const Options& options) {
  auto file = plant::load_plant(options.sim);
  if (!file.plant) return tl::unexpected(failure(file.findings));
  if (options.seed) file.plant->seed = *options.seed;
  const auto rates = bus_rates(options);
  if (!rates) return tl::unexpected(rates.error());
  Findings findings;
  auto world = plant::World::make(*file.plant, *rates, findings);
  if (!world) return tl::unexpected(failure(findings));
  if (options.state.empty()) return world;
  const auto kept = world->keep_state(options.state);
  if (kept) return world;
  return tl::unexpected(failure(Exit::failed, fmt::format("{}: {}", options.state, describe(kept.error()))));
}

}  // namespace

int run_plant(const Options& options) {
  auto world = world_of(options);
  if (!world) return tell(world.error(), options.json);
  Interrupt interrupt;
  io::Loop loop((*world)->executor());
  auto server = io::PlantServer::listen(loop, options.control, [&](const std::string& bus, std::string& why) {
    std::unique_ptr<can::Port> port = (*world)->attach_master(bus);
    if (!port) why = fmt::format("the plant has no bus \"{}\"", bus);
    return port;
  });
  if (!server) return tell(failure(Exit::failed, server.error()), options.json);
  (*world)->start();
  print_line(options.json ? nlohmann::ordered_json{{"listening", options.control}}.dump()
                          : fmt::format("plant {} at {}; Ctrl-C ends it", options.sim, options.control));
  while (!interrupt.came()) loop.turn(50ms);
  return Exit::done;
}

}  // namespace berth::cli
