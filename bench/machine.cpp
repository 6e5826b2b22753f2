// The 120-slave machine (paper 1's emulation; examples/hundred-twenty.toml) from blank devices to operational.
#include <fmt/format.h>

#include <cstdio>
#include <cstdlib>
#include <vector>

#include "bench/tools/figures.hpp"
#include "berth/can/port.hpp"
#include "berth/operate/session.hpp"
#include "berth/plant/world.hpp"

using namespace berth;
using namespace std::chrono_literals;

namespace {

constexpr const char* machine_path = BERTH_SOURCE_DIR "/examples/hundred-twenty.toml";
constexpr const char* plant_path = BERTH_SOURCE_DIR "/examples/hundred-twenty.plant.toml";
constexpr auto booted = 200ms;    // the slowest device boots for 150 ms; Berth begins when all are there
constexpr double wall_aim = 1.0;  // seconds

[[noreturn]] void give_up(const Findings& findings, const char* what) {
  for (const auto& finding : findings) std::fprintf(stderr, "%s\n", to_string(finding).c_str());
  std::fprintf(stderr, "bench machine: %s\n", what);
  std::exit(3);
}

/// RAND requests: IURS and DIRS.
struct RandCount final : can::Tap {
  void frame(const can::Frame& frame, rt::Time, int) noexcept override {
    const bool request = frame.extended && frame.id == 0x1F94'0000 && frame.size >= 4 && frame.data[0] == 0x80;
    if (request) ++requests;
  }
  std::uint64_t requests = 0;
};

struct Run {
  double wall = 0;  // seconds, files read beforehand
  rt::Duration bus_time{};
  std::uint64_t frames = 0;
  std::uint64_t rand_requests = 0;
};

Run run(design::Machine machine, const plant::PlantFile& plant, std::uint32_t bit_rate) {
  machine.buses.front().bitrate = bit_rate;
  const bench::Watch watch;
  Findings findings;
  const auto& bus = machine.buses.front();
  const plant::BusRate rate{bus.name, bit_rate};
  const auto world = plant::World::make(plant, {&rate, 1}, findings);
  if (!world) give_up(findings, "no world");
  RandCount count;
  world->bus(bus.name)->add_tap(count);
  world->start();
  world->sim().run_for(booted);
  const auto port = world->attach_master(bus.name);
  places::MemoryStore store;
  operate::Session session(world->executor(), machine, store);
  if (!session.connect(bus.name, *port) || !session.open()) give_up({}, "no session");
  session.start();
  if (!world->sim().run_until([&] { return session.operational(); }, 1h)) give_up({}, "not operational after an hour");
  Run result;
  result.wall = watch.seconds();
  result.bus_time = world->sim().now().time_since_epoch() - booted;
  result.frames = world->bus(bus.name)->statistics().frames;
  result.rand_requests = count.requests;
  session.stop();
  world->bus(bus.name)->remove_tap(count);
  return result;
}

}  // namespace

int main() {
  auto machine = design::load_machine(machine_path);
  if (!machine.machine) give_up(machine.findings, "no machine");
  auto plant = plant::load_plant(plant_path);
  if (!plant.plant) give_up(plant.findings, "no plant");
  std::vector<bench::Figure> figures;
  std::vector<std::vector<std::string>> rows;
  for (const std::uint32_t bit_rate : {50'000U, 125'000U, 500'000U, 1'000'000U}) {
    const auto one = run(*machine.machine, *plant.plant, bit_rate);
    auto figure = bench::at_most(fmt::format("wall time at {} kbit/s", bit_rate / 1000), one.wall, wall_aim, "s");
    figure.aim = "< 1";
    figures.push_back(figure);
    rows.push_back({fmt::format("{} kbit/s", bit_rate / 1000), bench::time_text(one.bus_time),
                    bench::grouped(static_cast<double>(one.frames)),
                    bench::grouped(static_cast<double>(one.rand_requests))});
  }
  bench::print_figures("120 slaves, blank to operational", figures);
  bench::print_columns("The same on the bus", {"bit rate", "bus time", "frames", "RAND requests"}, rows);
  return 0;
}
