// The simulator, one core, full load: whole devices with heartbeat, and a master that reads an object of every one of
// them again and again, two at a time. A frame counts once, however many nodes hear it. SDO outranks heartbeats: with
// three reads at a time the bus would be full of it and no heartbeat would come through.
#include <fmt/format.h>

#include <charconv>
#include <cstring>
#include <vector>

#include "bench/tools/figures.hpp"
#include "bench/tools/world.hpp"
#include "berth/co/heartbeat.hpp"
#include "berth/co/nmt_master.hpp"
#include "berth/co/sdo_client.hpp"

using namespace berth;
using namespace std::chrono_literals;

namespace {

/// A master and `nodes - 1` devices at 1 Mbit/s.
class Load final : private co::HeartbeatConsumer::Observer {
 public:
  explicit Load(unsigned nodes) : world_(bench::start(plant(nodes), 1'000'000)) {
    for (unsigned id = 1; id < nodes; ++id) consumer_.supervise(node(id), 1s);
    reading_.spawn(read(nodes, 0));
    if (nodes > 2) reading_.spawn(read(nodes, nodes / 2));
    world_->sim().run_for(200ms);  // all have booted
    static_cast<void>(dispatcher_.send(can::Frame::base(0, {0x01, 0x00})));
    world_->sim().run_for(200ms);
  }

  /// Simulates at least so many frames; how many it were.
  std::uint64_t run(std::uint64_t frames) {
    const auto& statistics = world_->bus(bench::bus_name)->statistics();
    const auto began = statistics.frames;
    while (statistics.frames - began < frames) world_->sim().run_for(1ms);
    return statistics.frames - began;
  }
  [[nodiscard]] double load() {
    auto& bus = *world_->bus(bench::bus_name);
    bus.reset_statistics();
    world_->sim().run_for(1s);
    return bus.load();
  }
  [[nodiscard]] std::uint64_t reads() const noexcept { return reads_; }
  [[nodiscard]] unsigned beating() const noexcept { return beating_; }

 private:
  static NodeId node(unsigned id) { return NodeId(static_cast<std::uint8_t>(id)); }
  static plant::PlantFile plant(unsigned nodes) {
    auto plant = bench::plant_of(nodes - 1, true, 200us);
    for (auto& device : plant.devices) device.heartbeat = 100ms;
    return plant;
  }
  // Reads every device's serial number, in turn, from the one after `from` on.
  rt::Task<void> read(unsigned nodes, unsigned from) {
    co_await rt::sleep_for(150ms);
    for (unsigned turn = from;; ++turn) {
      const auto id = node(1 + turn % (nodes - 1));
      const auto value = co_await sdo_.read<std::uint32_t>(id, 0x1018, 4);
      if (value.has_value() && *value == id.value()) ++reads_;
    }
  }
  void heartbeat(const co::HeartbeatEvent& event, rt::Time) noexcept override {
    if (event.kind == co::HeartbeatEvent::Kind::started) ++beating_;
  }

  std::unique_ptr<plant::World> world_;
  std::unique_ptr<sim::Controller> port_ = world_->attach_master(bench::bus_name, {.queue_depth = 128});
  can::Dispatcher dispatcher_{world_->executor(), *port_};
  co::SdoClient sdo_{dispatcher_};
  co::HeartbeatConsumer consumer_{dispatcher_, *this};
  std::uint64_t reads_ = 0;
  unsigned beating_ = 0;
  rt::Scope reading_{world_->executor()};
};

constexpr double frames_aim = 1'000'000;
constexpr double instructions_aim = 2000;
constexpr unsigned counted_frames = 20'000;

bench::Rounds frames_per_second(Load& load) {
  bench::Rounds measured;
  for (int round = 0; round < 5; ++round) {
    const bench::Watch watch;
    const auto frames = load.run(400'000);
    measured.add(static_cast<double>(frames) / watch.seconds());
  }
  return measured;
}

bench::Figure instructions_a_frame(unsigned nodes) {
  const auto count = [&](unsigned frames) {
    return bench::instructions({"--frames", std::to_string(frames), std::to_string(nodes)});
  };
  const auto name = fmt::format("instructions a frame, {} nodes", nodes);
  const auto none = count(0);
  const auto all = count(counted_frames);
  if (!none || !all) return {name, bench::no_valgrind};
  const double each = static_cast<double>(*all - *none) / counted_frames;
  return nodes == 127 ? bench::at_most(name, each, instructions_aim, "")
                      : bench::Figure{name, bench::grouped(each), {}, {}};
}

/// One operational device with a heartbeat every second, a master's silent controller beside it, and nothing else.
class Idle {
 public:
  Idle() {
    world_->sim().run_for(200ms);
    static_cast<void>(port_->send(can::Frame::base(0, {0x01, 0x00}), 0));
    world_->sim().run_for(200ms);
  }
  void run(std::chrono::seconds time) { world_->sim().run_for(time); }

 private:
  static plant::PlantFile plant() {
    auto plant = bench::plant_of(1, true, 200us);
    plant.devices.front().heartbeat = 1s;
    return plant;
  }
  std::unique_ptr<plant::World> world_ = bench::start(plant(), 1'000'000);
  std::unique_ptr<sim::Controller> port_ = world_->attach_master(bench::bus_name, {});
};

constexpr unsigned idle_seconds = 10'000;

void add_idle(std::vector<bench::Figure>& figures) {
  Idle idle;
  const bench::Watch watch;
  idle.run(std::chrono::seconds(idle_seconds));
  const auto each = watch.seconds() / idle_seconds * 1e9;
  figures.push_back({"one idle device, CPU per simulated second", fmt::format("{:.0f} ns", each), {}, {}});
  const auto none = bench::instructions({"--idle", "0"});
  const auto all = bench::instructions({"--idle", std::to_string(idle_seconds)});
  if (!none || !all) return;
  figures.push_back({"one idle device, instructions per simulated second",
                     bench::grouped(static_cast<double>(*all - *none) / idle_seconds),
                     {},
                     {}});
}

unsigned number(const char* text) {
  unsigned value = 0;
  std::from_chars(text, text + std::strlen(text), value);
  return value;
}

}  // namespace

int main(int argc, char** argv) {
  if (argc == 4 && std::strcmp(argv[1], "--frames") == 0) {  // under callgrind
    Load load(number(argv[3]));
    if (const auto frames = number(argv[2]); frames > 0) load.run(frames);
    return 0;
  }
  if (argc == 3 && std::strcmp(argv[1], "--idle") == 0) {
    Idle().run(std::chrono::seconds(number(argv[2])));
    return 0;
  }
  std::vector<bench::Figure> figures;
  for (const unsigned nodes : {2U, 30U, 127U}) {
    Load load(nodes);
    const auto busy = load.load();
    const auto name = fmt::format("frames/s, {} nodes ({:.0f} % bus load, 1 Mbit/s)", nodes, busy * 100);
    const auto measured = frames_per_second(load);
    if (load.reads() == 0 || load.beating() != nodes - 1) {
      fmt::print("{} nodes: {} SDO reads, {} heartbeats seen: no traffic to measure\n", nodes, load.reads(),
                 load.beating());
      return 1;
    }
    figures.push_back(nodes == 2 ? bench::Figure{name, measured.text() + " /s", {}, {}}
                                 : bench::at_least(name, measured, frames_aim, "/s"));
  }
  for (const unsigned nodes : {2U, 30U, 127U}) figures.push_back(instructions_a_frame(nodes));
  add_idle(figures);
  bench::print_figures(
      "Simulator, one core: whole devices with all receive entries, heartbeat every 100 ms and its supervision, SDO "
      "reads "
      "without pause; median (minimum to maximum) of 5",
      figures);
  return 0;
}
