// How often a running machine looks for new devices, what that costs the bus, and how soon a new device runs (S4.20):
// 29 running devices and one that comes, by RAND and by LSS alone.
#include <fmt/format.h>

#include <cstdio>
#include <cstdlib>
#include <vector>

#include "bench/tools/figures.hpp"
#include "bench/tools/world.hpp"
#include "berth/tree/session.hpp"

using namespace berth;
using namespace std::chrono_literals;

namespace {

using bench::bus_name;
constexpr unsigned devices = 30;

design::Machine machine_of(std::uint32_t bit_rate, rt::Duration period) {
  auto machine = bench::machine_of(devices, bit_rate);
  machine.buses.front().timing.probe_period = period;
  machine.slots.back().spec.optional = true;  // the one that comes
  return machine;
}

plant::PlantFile plant_of(plant::Speaks speaks) {
  auto plant = bench::plant_of(devices, false, 500us);
  for (auto& device : plant.devices) {
    device.response.max = 2ms;
    device.speaks = {plant::Speaks::lss};
    device.speaks.add(speaks);
  }
  plant.devices.back().plugged = false;
  return plant;
}

struct Measured {
  double load = 0;        // of the bus, 0..1, while nobody comes
  rt::Duration waited{};  // from power-on to operational
};

[[noreturn]] void give_up(const char* what) {
  std::fprintf(stderr, "bench poll: %s\n", what);
  std::exit(3);
}

Measured measure(std::uint32_t bit_rate, rt::Duration period, plant::Speaks speaks) {
  const auto machine = machine_of(bit_rate, period);
  const auto world = bench::start(plant_of(speaks), bit_rate);
  world->sim().run_for(200ms);
  const auto port = world->attach_master(bus_name);
  places::MemoryStore store;
  tree::Session session(world->executor(), machine, store);
  if (!session.connect(bus_name, *port) || !session.open()) give_up("no session");
  session.start();
  const auto all = [&] { return session.operational() && session.idle(); };
  if (!world->sim().run_until(all, 120s)) give_up("it does not become operational");
  world->sim().run_for(1s);
  const auto before = world->bus(bus_name)->statistics().busy;
  world->sim().run_for(20s);
  Measured result;
  const auto busy = world->bus(bus_name)->statistics().busy - before;
  result.load = static_cast<double>(busy.count()) / 20e9;
  const auto last = fmt::format("d{}", devices);
  const rt::Time plugged = world->executor().now();
  world->find(last)->plug();
  const auto runs = [&] { return world->find(last)->truth().state == NmtState::operational; };
  if (!world->sim().run_until(runs, 120s)) give_up("the new device was not started");
  result.waited = world->executor().now() - plugged;
  return result;
}

}  // namespace

int main() {
  std::vector<std::vector<std::string>> rows;
  for (const std::uint32_t bit_rate : {50'000U, 125'000U, 500'000U}) {
    const double idle = measure(bit_rate, 60s, plant::Speaks::rand).load;
    for (const rt::Duration period : {50ms, 100ms, 250ms, 1000ms, 4000ms}) {
      const auto rand = measure(bit_rate, period, plant::Speaks::rand);
      const auto lss = measure(bit_rate, period, plant::Speaks::fastscan);
      rows.push_back({fmt::format("{}", bit_rate / 1000), bench::time_text(period), fmt::format("{:.2f} %", 100 * idle),
                      fmt::format("{:+.3f} %", 100 * (rand.load - idle)), bench::time_text(rand.waited),
                      bench::time_text(lss.waited)});
    }
  }
  bench::print_columns(
      "Looking for new devices: 29 running, one comes",
      {"kbit/s", "probe_period", "load without", "looking adds", "RAND, to operational", "Fastscan, to operational"},
      rows);
  return 0;
}
