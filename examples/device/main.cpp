// Runs the thermometer. Without arguments on a simulated bus, as fast as possible, with a master that starts it, turns
// its fan and stores its parameters; every frame is printed. With a socket and the name of a bus it joins a bus that
// `berth plant` offers, in real time, as node 42:
//
//     cmake --preset release -DBERTH_EXAMPLES=ON && ninja -C build/release example_device
//     build/release/examples/example_device
//     build/release/examples/example_device /tmp/plant.sock backbone
#include <array>
#include <cstdio>
#include <string>

#include "berth/io/plant_port.hpp"
#include "berth/sim/world.hpp"
#include "thermometer.hpp"

namespace {

using namespace std::chrono_literals;

/// Prints what is on the bus.
struct Print final : berth::can::Tap {
  void frame(const berth::can::Frame& frame, berth::rt::Time at, int) noexcept override {
    const std::chrono::duration<double, std::milli> time = at.time_since_epoch();
    std::printf("%9.3f ms  %s\n", time.count(), berth::can::to_string(frame).c_str());
  }
};

int simulate() {
  berth::sim::World world;
  berth::sim::Bus& bus = world.add_bus("bus", 500'000);
  auto master = bus.attach();
  auto port = bus.attach();
  Print print;
  bus.add_tap(print);
  {
    Thermometer thermometer(world.executor(), *port, berth::NodeId(5));
    const auto master_sends = [&](const char* frame) {
      master->send(*berth::can::parse_frame(frame), 0);
      world.run_for(30ms);
    };
    world.run_for(10ms);
    master_sends("000#0105");              // NMT: start node 5
    master_sends("205#50");                // RPDO 1: the fan at 80 %
    master_sends("605#2B0120005E010000");  // SDO: limit (2001h) = 35.0 degrees
    master_sends("605#2310100173617665");  // SDO: 1010h:01 = "save"
    for (const std::int16_t temperature : std::to_array<std::int16_t>({215, 215, 290, 360, 340})) {
      thermometer.measured(temperature);
      world.run_for(50ms);
    }
    std::printf("fan at %u %%\n", thermometer.fan());
  }
  bus.remove_tap(print);
  return 0;
}

int join(const std::string& socket, const std::string& bus) {
  berth::rt::Executor executor;
  berth::io::Loop loop(executor);
  auto port = berth::io::PlantPort::connect(loop, socket, bus);
  if (!port) {
    std::fprintf(stderr, "%s: %s\n", socket.c_str(), port.error().c_str());
    return 3;
  }
  Thermometer thermometer(executor, **port, berth::NodeId(42));
  std::printf("node 42 on bus %s; Ctrl-C ends it\n", bus.c_str());
  std::fflush(stdout);
  for (std::int16_t temperature = 200; (*port)->status().up; temperature = temperature < 900 ? temperature + 1 : 200) {
    loop.turn(100ms);
    thermometer.measured(temperature);
  }
  std::fprintf(stderr, "%s: the plant has ended\n", socket.c_str());
  return 3;
}

}  // namespace

int main(int count, char** words) {
  if (count == 1) return simulate();
  if (count == 3) return join(words[1], words[2]);
  std::fprintf(stderr, "usage: %s [SOCKET BUS]\n", words[0]);
  return 2;
}
