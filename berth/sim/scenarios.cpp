#include "berth/sim/scenarios.hpp"

#include <fmt/format.h>

#include <memory>
#include <utility>

#include "berth/sim/world.hpp"

namespace berth::sim {
namespace {

using namespace std::chrono_literals;
constexpr auto bit_time = 1us;  // 1 Mbit/s: a microsecond is a bit

/// Watches a world and writes down each step that is worth it.
class Narrator {
 public:
  explicit Narrator(World& world) : world_(world) {}
  void watch(const Controller& node) { nodes_.push_back({&node, node.statistics(), node.errors().state()}); }

  /// Runs until nothing is left to send, or `attempts` frames have begun, or `limit` bits are over.
  void run(Bus& bus, unsigned attempts, unsigned limit) {
    const rt::Time end = world_.now() + limit * bit_time;
    while (world_.now() < end && bus.statistics().starts <= attempts && world_.step(end)) look();
  }
  void say(std::string event) {
    Step step{static_cast<std::uint64_t>(world_.now().time_since_epoch() / bit_time), std::move(event), {}};
    for (const auto& seen : nodes_) {
      const Controller& node = *seen.node;
      step.nodes.push_back({node.name(), node.errors().tec(), node.errors().rec(), node.errors().state()});
    }
    steps_.push_back(std::move(step));
  }
  [[nodiscard]] std::vector<Step> take() { return std::move(steps_); }

 private:
  struct Seen {
    const Controller* node;
    NodeStatistics before;
    ErrorState state;
  };
  void look() {
    for (auto& seen : nodes_) {
      const Controller& node = *seen.node;
      const NodeStatistics now = node.statistics();
      const NodeStatistics before = std::exchange(seen.before, now);
      const ErrorState state = std::exchange(seen.state, node.errors().state());
      if (now.transmit_errors > before.transmit_errors) {
        const char* flag = state == ErrorState::active ? "active" : "passive";
        say(fmt::format("{}: attempt {} fails, {} error flag", node.name(), now.attempts, flag));
      }
      if (now.receive_errors > before.receive_errors) say(fmt::format("{}: error as receiver", node.name()));
      if (now.sent > before.sent) say(fmt::format("{}: attempt {} is acknowledged", node.name(), now.attempts));
      if (state != node.errors().state()) say(fmt::format("{}: error {}", node.name(), name(node.errors().state())));
    }
  }
  World& world_;
  std::vector<Seen> nodes_;
  std::vector<Step> steps_;
};

}  // namespace

const char* name(ErrorState state) noexcept {
  switch (state) {
    case ErrorState::active: return "active";
    case ErrorState::passive: return "passive";
    case ErrorState::bus_off: break;
  }
  return "bus-off";
}

std::vector<Step> two_with_one_id(unsigned coincidences) {
  World world;
  Bus& bus = world.add_bus("bus", 1'000'000);
  const auto a = bus.attach({.name = "a"});
  const auto b = bus.attach({.name = "b"});
  const auto ear = bus.attach({.name = "listener"});
  Narrator narrator(world);
  for (const auto* node : {a.get(), b.get(), ear.get()}) narrator.watch(*node);
  for (unsigned i = 0; i < coincidences && b->errors().state() != ErrorState::bus_off; ++i) {
    a->send(can::Frame::base(0x181, {0x55, 0x00}), 1);
    b->send(can::Frame::base(0x181, {0x55, 0x01}), 1);
    narrator.say(i == 0 ? "a and b start 181h together, a with 55 00, b with 55 01"
                        : fmt::format("a and b start together again, coincidence {}", i + 1));
    narrator.run(bus, 30 + 10 * i, 10'000);
    world.run_for(20 * bit_time);  // after suspend transmission, so that both may start at the next instant
  }
  narrator.say("nothing left to send");
  return narrator.take();
}

std::vector<Step> wrong_bit_rate(std::uint32_t stranger_rate) {
  World world;
  Bus& bus = world.add_bus("bus", 1'000'000);
  const auto a = bus.attach({.name = "a"});
  const auto b = bus.attach({.name = "b"});
  const auto stranger = bus.attach({.name = "stranger", .bit_rate = stranger_rate});
  Narrator narrator(world);
  for (const auto* node : {a.get(), b.get(), stranger.get()}) narrator.watch(*node);
  world.run_for(1000 * bit_time);  // each node has seen eleven recessive bits of its own
  a->send(can::Frame::base(0x181, {0, 0, 0, 0, 0, 0, 0, 0}), 1);
  narrator.say(fmt::format("a sends 181h to b; the stranger listens at {} bit/s", stranger_rate));
  narrator.run(bus, 1000, 100'000);
  narrator.say("nothing left to send");
  return narrator.take();
}

std::vector<Step> lone_node(unsigned attempts) {
  World world;
  Bus& bus = world.add_bus("bus", 1'000'000);
  const auto a = bus.attach({.name = "a"});
  Narrator narrator(world);
  narrator.watch(*a);
  a->send(can::Frame::base(0x701, {0x00}), 1);
  narrator.say("a sends its boot-up 701h, and no other node is there");
  narrator.run(bus, attempts, attempts * 200);
  return narrator.take();
}

}  // namespace berth::sim
