// The 120-slave machine (paper 1's emulation; examples/hundred-twenty.toml) from blank devices to operational; then up
// to a hundred of it, each on a bus of its own, to see that the work grows no faster than the number of devices.
#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cstdio>
#include <cstdlib>
#include <vector>

#include "bench/tools/figures.hpp"
#include "bench/tools/many_buses.hpp"
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

/// Commit 1632e8a, where every event copied every slot of the machine: such files by its program, built by g++ 12 -O2,
/// measured in one session with the first new ones (0.07, 0.40, 2.93, 14.65 s).
struct Before {
  unsigned buses;
  double wall;  // seconds
};
constexpr std::array<Before, 4> before{{{1, 0.10}, {5, 0.81}, {20, 9.03}, {60, 70.78}}};

constexpr double most_wall = 10;       // seconds, at 100 buses
constexpr double most_memory = 200;    // MiB
constexpr double most_growth = 1.2;    // instructions a device, 20 buses against 1
constexpr unsigned most_counted = 20;  // buses; valgrind is fifty times slower

std::string old_wall(unsigned buses) {
  const auto* const it = std::ranges::find(before, buses, &Before::buses);
  return it == before.end() ? "-" : fmt::format("{:.2f} s", it->wall);
}

void print_growth(const design::Machine& machine, const plant::PlantFile& plant) {
  std::vector<std::vector<std::string>> rows;
  bench::UpCost last;
  std::vector<double> counted;  // instructions a device
  for (const unsigned buses : {1U, 5U, 20U, 60U, 100U}) {
    const bench::ManyBuses many(machine, plant, buses);
    const auto cost = many.bring_up();
    if (!cost) give_up({}, fmt::format("the program did not bring {} buses up", buses).c_str());
    last = *cost;
    const auto devices = static_cast<double>(buses * plant.devices.size());
    const auto count = buses <= most_counted ? many.count_instructions() : std::nullopt;
    if (count) counted.push_back(static_cast<double>(*count) / devices);
    rows.push_back({std::to_string(buses), bench::grouped(devices), old_wall(buses),
                    fmt::format("{:.2f} s", cost->wall), fmt::format("{:.2f} s", cost->cpu),
                    fmt::format("{:.2f} ms", cost->cpu * 1000 / devices), count ? bench::grouped(counted.back()) : "-",
                    fmt::format("{:.0f} MiB", cost->peak)});
  }
  bench::print_columns(
      "berth up --fast --until operational, 120 devices a bus",
      {"buses", "devices", "wall at 1632e8a", "wall", "CPU", "CPU a device", "instructions a device", "memory"}, rows);
  std::vector<bench::Figure> figures{bench::at_most("wall time of 12,000 devices", last.wall, most_wall, "s"),
                                     bench::at_most("memory of 12,000 devices", last.peak, most_memory, "MiB")};
  if (counted.size() > 1) {
    figures.push_back(bench::at_most("instructions a device, 20 buses against 1", counted.back() / counted.front(),
                                     most_growth, "times"));
  }
  bench::print_figures("Growth", figures);
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
  print_growth(*machine.machine, *plant.plant);
  return 0;
}
