// The 120-slave machine (paper 1's emulation; examples/hundred-twenty.toml) from blank devices to operational, second
// by second, and 30 devices of one type; then up to a hundred of the first, each on a bus of its own, to see that the
// work grows no faster than the number of devices.
#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cstdio>
#include <cstdlib>
#include <string>
#include <utility>
#include <vector>

#include "bench/tools/figures.hpp"
#include "bench/tools/many_buses.hpp"
#include "berth/can/port.hpp"
#include "berth/plant/world.hpp"
#include "berth/tree/session.hpp"

using namespace berth;
using namespace std::chrono_literals;

namespace {

constexpr const char* machine_path = BERTH_SOURCE_DIR "/examples/hundred-twenty.toml";
constexpr const char* plant_path = BERTH_SOURCE_DIR "/examples/hundred-twenty.plant.toml";
constexpr auto all_booted = 200ms;  // the slowest device boots for 150 ms; Berth begins when all are there
constexpr double wall_aim = 1.0;    // seconds
constexpr double bus_aim = 5.0;     // seconds, at 500 kbit/s
constexpr double thirty_aim = 1.2;  // seconds, 30 devices at 125 kbit/s
// Bus time at 500 kbit/s by the planner before bindings ran side by side, and before a proof's questions shared a
// window.
constexpr std::array<double, 2> bus_before{11.7, 6.78};

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
  std::vector<double> idle;  // share of each second of bus time; the last one may be shorter
};

// How long the bus was busy, second by second.
class Seconds {
 public:
  explicit Seconds(const sim::Bus& bus) : bus_(bus), since_(now()), before_(bus.statistics().busy) {}
  void look() {
    if (now() - since_ >= 1s) close();
  }
  std::vector<double> end() {
    if (now() > since_) close();
    return idle_;
  }

 private:
  [[nodiscard]] rt::Time now() const { return bus_.executor().now(); }
  void close() {
    const rt::Duration busy = bus_.statistics().busy - std::exchange(before_, bus_.statistics().busy);
    const rt::Duration time = now() - std::exchange(since_, now());
    idle_.push_back(1 - static_cast<double>(busy.count()) / static_cast<double>(time.count()));
  }
  const sim::Bus& bus_;
  rt::Time since_;
  rt::Duration before_;
  std::vector<double> idle_;
};

Run run(design::Machine machine, const plant::PlantFile& plant, std::uint32_t bit_rate, rt::Duration booted) {
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
  tree::Session session(world->executor(), machine, store);
  if (!session.connect(bus.name, *port) || !session.open()) give_up({}, "no session");
  session.start();
  Seconds seconds(*world->bus(bus.name));
  const auto operational = [&] {
    seconds.look();
    return session.operational();
  };
  if (!world->sim().run_until(operational, 1h)) give_up({}, "not operational after an hour");
  Run result;
  result.idle = seconds.end();
  result.wall = watch.seconds();
  result.bus_time = world->sim().now().time_since_epoch() - booted;
  result.frames = world->bus(bus.name)->statistics().frames;
  result.rand_requests = count.requests;
  session.stop();
  world->bus(bus.name)->remove_tap(count);
  return result;
}

// 30 RAND devices of one type that boot in 50 ms, from the end of their boot to operational.
Run run_thirty() {
  constexpr std::uint32_t bit_rate = 125'000;
  const char* const machine_text = R"([machine]
name = "thirty"
[bus.field]
port = "sim"
bitrate = 125_000
master_id = 127
[[slot]]
bus = "field"
ids = "1..30"
name = "s{id}"
type = { vendor = 1, product = 1 }
when_ambiguous = "ascending"
)";
  const char* const plant_text = R"([plant]
seed = 1
[bus.field]
[[device]]
bus = "field"
name = "d{n}"
type = { vendor = 1, product = 1 }
count = 30
serial_first = 0x10
boot = "50 ms"
response = { min = "0.5 ms", max = "2 ms" }
)";
  const auto machine = design::read_machine(machine_text, "thirty.toml", {});
  if (!machine.machine) give_up(machine.findings, "no machine");
  const auto plant = plant::read_plant(plant_text, "thirty.plant.toml");
  if (!plant.plant) give_up(plant.findings, "no plant");
  return run(*machine.machine, *plant.plant, bit_rate, 50ms);
}

// Where the time is: seconds in which the bus is idle are those in which one device is waited for.
void print_idle(const Run& at_500, const Run& thirty) {
  std::vector<std::vector<std::string>> rows;
  for (std::size_t second = 0; second < std::max(at_500.idle.size(), thirty.idle.size()); ++second) {
    const auto share = [&](const Run& r) {
      return second < r.idle.size() ? fmt::format("{:.0f} %", 100 * r.idle[second]) : std::string("-");
    };
    rows.push_back({std::to_string(second + 1), share(at_500), share(thirty)});
  }
  bench::print_columns("Idle share of each second of bus time (the last one up to operational)",
                       {"second", "120 slaves, 500 kbit/s", "30 devices, 125 kbit/s"}, rows);
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
  Run at_500;
  for (const std::uint32_t bit_rate : {50'000U, 125'000U, 500'000U, 1'000'000U}) {
    const auto one = run(*machine.machine, *plant.plant, bit_rate, all_booted);
    if (bit_rate == 500'000) at_500 = one;
    auto figure = bench::at_most(fmt::format("wall time at {} kbit/s", bit_rate / 1000), one.wall, wall_aim, "s");
    figure.aim = "< 1";
    figures.push_back(figure);
    rows.push_back({fmt::format("{} kbit/s", bit_rate / 1000), bench::time_text(one.bus_time),
                    bench::grouped(static_cast<double>(one.frames)),
                    bench::grouped(static_cast<double>(one.rand_requests))});
  }
  const auto in_seconds = [](const Run& r) { return std::chrono::duration<double>(r.bus_time).count(); };
  figures.push_back(
      bench::at_most(fmt::format("bus time at 500 kbit/s ({} s, {} s before)", bus_before[0], bus_before[1]),
                     in_seconds(at_500), bus_aim, "s"));
  const Run thirty = run_thirty();
  figures.push_back(bench::at_most("30 devices of one type, consecutive serials, 125 kbit/s: bus time",
                                   in_seconds(thirty), thirty_aim, "s"));
  bench::print_figures("120 slaves, blank to operational", figures);
  print_idle(at_500, thirty);
  bench::print_columns("The same on the bus", {"bit rate", "bus time", "frames", "RAND requests"}, rows);
  print_growth(*machine.machine, *plant.plant);
  return 0;
}
