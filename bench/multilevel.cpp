// Machines of many buses (paper 3; docs/multilevel.md): what an access through gateways costs, the paper's way, CiA
// 302-7's and without any; how late a signal is behind one to three gateways, beside the bound that the analysis gives
// and what the buses need at least; what a gateway's processor has to do for a signal and for an emergency; how the
// harvester boots beside its buses one after the other; the load of a backbone with levels beneath it and without.
#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cstdio>
#include <cstdlib>
#include <map>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "bench/tools/figures.hpp"
#include "berth/analysis/response.hpp"
#include "berth/base/bytes.hpp"
#include "berth/base/random.hpp"
#include "berth/multilevel/gateway_access.hpp"
#include "berth/multilevel/gateway_device.hpp"
#include "berth/multilevel/remote_sdo.hpp"
#include "berth/rt/scope.hpp"
#include "berth/sim/world.hpp"
#include "tests/harvester/harvester.hpp"

using namespace berth;
using namespace std::chrono_literals;

namespace {

constexpr std::uint32_t bit_rate = 500'000;
constexpr std::uint16_t far_network = 9;

struct Count final : can::Tap {
  explicit Count(sim::Bus& line) : bus(&line) { line.add_tap(*this); }
  ~Count() { bus->remove_tap(*this); }
  void frame(const can::Frame& frame, rt::Time at, int) noexcept override {
    ++frames;
    last = at;
    // A download that is confirmed, an upload that is answered at once (CiA 301 §7.2.4.3).
    const unsigned answer = frame.data[0] >> 5U;
    accesses += frame.id > 0x580 && frame.id < 0x600 && (answer == 3 || answer == 2);
  }
  sim::Bus* bus;
  unsigned frames = 0;
  unsigned accesses = 0;
  rt::Time last{};
};

// A bus, and one more beneath each gateway; each gateway hands 2000h of the bus above on to that beneath.
struct Tower {
  explicit Tower(unsigned depth) {
    for (unsigned level = 0; level <= depth; ++level) world.add_bus(fmt::format("level {}", level), bit_rate);
    for (unsigned level = 0; level < depth; ++level) add_gateway(level, depth);
    path.node = NodeId(50);
    auto& leaf_dispatcher = dispatcher(depth);
    leaf.emplace(leaf_dispatcher, device::minimal_description(), nullptr, device::Options{.node_id = NodeId(50)});
    leaf->power_on();
    auto& above = dispatcher(0);
    client.emplace(above);
    routes.emplace(*client);
    if (depth > 0) remote.emplace(above, *client, NodeId(3), far_network, NodeId(50), turn);
    world.run_for(100ms);
    for (auto& bus : world.buses()) port(static_cast<unsigned>(bus->number())).send(*can::parse_frame("000#0100"), 0);
    world.run_for(100ms);
  }
  void add_gateway(unsigned level, unsigned depth) {
    od::DescriptionBuilder upper, lower;
    device::add_device(upper);
    multilevel::add_gateway_objects(upper);
    const od::SubSpec value{
        .name = "Value", .type = od::DataType::unsigned16, .access = od::Access::rww, .mappable = true};
    upper.variable(0x2000, value);
    device::add_rpdo(upper, 1, {.map = {{{0x2000, 0}, 16}}});
    device::add_device(lower);
    lower.variable(0x2000, {.name = "Value", .type = od::DataType::unsigned16, .mappable = true});
    device::add_tpdo(lower, 1, {.map = {{{0x2000, 0}, 16}}});
    gateways.push_back(std::make_unique<multilevel::GatewayDevice>(
        world.executor(), port(level),
        multilevel::GatewayOptions{.upper = {.node_id = NodeId(3), .presets = {{{0x1400, 1}, 0x181}}},
                                   .description = upper.build()}));
    multilevel::BusOptions beneath{.device = {.node_id = NodeId(1), .send_tpdos_at_start = false},
                                   .description = lower.build()};
    beneath.sdo.levels_beneath = depth - 1 - level;
    auto& gateway = *gateways.back();
    auto& bus = gateway.add_bus(port(level + 1), beneath);
    gateway.set_signals({{.name = "value", .source = {0x2000, 0}, .target = {0x2000, 0}}});
    gateway.signals().set_safe(true);
    const bool lowest = level + 1 == depth;
    const multilevel::RemoteNetwork way{far_network, &bus.dispatcher(), nullptr, lowest ? NodeId() : NodeId(3)};
    routers.push_back(std::make_unique<multilevel::RemoteSdo>(world.executor(), gateway.upper().values(),
                                                              std::vector<multilevel::RemoteNetwork>{way}));
    gateway.power_on();
    path.gateways.push_back({NodeId(3)});
  }
  sim::Controller& port(unsigned level) {
    return *ports.emplace_back(world.buses()[level]->attach({.queue_depth = 64, .rx_depth = 64}));
  }
  can::Dispatcher& dispatcher(unsigned level) {
    return *dispatchers.emplace_back(std::make_unique<can::Dispatcher>(world.executor(), port(level)));
  }
  static rt::Task<void> read(co::SdoAccess& access, bool& good) {
    const auto type = co_await access.read_u32(0x1000, 0);
    good = type.has_value();
  }
  struct Cost {
    unsigned accesses = 0, above = 0, all = 0;
    rt::Duration time{};
    [[nodiscard]] std::string text() const {
      return fmt::format("{} / {} / {} / {}", accesses, above, all, bench::time_text(time));
    }
  };
  Cost cost(co::SdoAccess& access) {
    std::vector<std::unique_ptr<Count>> counts;
    for (auto& bus : world.buses()) counts.push_back(std::make_unique<Count>(*bus));
    const auto began = world.now();
    bool good = false;
    rt::Scope scope(world.executor());
    scope.spawn(read(access, good));
    world.run_until([&] { return scope.running() == 0; }, 10s);
    if (!good) std::exit(1);
    Cost made{.accesses = counts[0]->accesses, .above = counts[0]->frames, .time = counts[0]->last - began};
    for (auto& each : counts) made.all += each->frames;
    world.run_for(10ms);
    return made;
  }

  sim::World world{1};
  std::vector<std::unique_ptr<sim::Controller>> ports;
  std::vector<std::unique_ptr<can::Dispatcher>> dispatchers;
  std::vector<std::unique_ptr<multilevel::GatewayDevice>> gateways;
  std::vector<std::unique_ptr<multilevel::RemoteSdo>> routers;
  std::optional<device::Device> leaf;
  std::optional<co::SdoClient> client;
  std::optional<multilevel::Routes> routes;
  std::optional<multilevel::RemoteAccess> remote;
  rt::Turn turn;
  multilevel::Path path;
};

void print_accesses() {
  std::vector<std::vector<std::string>> rows;
  Tower alone(0);  // on the node's own bus
  const auto direct = alone.cost(alone.routes->access(alone.path)).text();
  for (unsigned depth = 1; depth <= 6; ++depth) {
    Tower tower(depth);
    auto& access = tower.routes->access(tower.path);
    const auto first = tower.cost(access), further = tower.cost(access);
    rows.push_back({std::to_string(depth), first.text(), further.text(), tower.cost(*tower.remote).text(), direct});
  }
  bench::print_columns(
      "an SDO upload of four bytes: accesses and frames on the client's bus / frames on all buses / time, 500 kbit/s",
      {"gateways", "paper 3, first", "paper 3, further", "CiA 302-7", "direct"}, rows);
}

// When each value was on a bus.
struct Seen final : can::Tap {
  void frame(const can::Frame& frame, rt::Time at, int) noexcept override {
    if (frame.id == 0x181) when[load_le<std::uint16_t>(frame.data.data())] = at;
  }
  std::map<unsigned, rt::Time> when;
};

// Other traffic of one bus: more urgent messages, each with its period, and a less urgent one that may be on the wire.
struct Other {
  std::uint32_t id;
  rt::Duration period;
};
constexpr rt::Duration signal_period = 2ms;
constexpr std::array<Other, 13> traffic{{{0x101, 3500us},
                                         {0x102, 4100us},
                                         {0x103, 4700us},
                                         {0x104, 5300us},
                                         {0x105, 5900us},
                                         {0x106, 6700us},
                                         {0x107, 7100us},
                                         {0x108, 7900us},
                                         {0x109, 8300us},
                                         {0x10A, 8900us},
                                         {0x10B, 9700us},
                                         {0x10C, 10300us},
                                         {0x7F0, 2900us}}};

// What a bus carries, with the signal among it; `jitter`: of its arrival.
analysis::Line line_of(bool busy, rt::Duration jitter) {
  analysis::Line line;
  line.bit_rate = bit_rate;
  const auto add = [&](std::uint32_t id, unsigned bytes, rt::Duration period, rt::Duration late) {
    line.senders.push_back({fmt::format("{:03X}", id)});
    analysis::Message message;
    message.sender = line.senders.size() - 1;
    message.key = id;
    message.data_bytes = bytes;
    message.period = period;
    message.jitter = late;
    line.messages.push_back(message);
  };
  add(0x181, 2, signal_period, jitter);
  for (const Other& other : traffic) {
    if (busy) add(other.id, 8, other.period, 0ns);
  }
  return line;
}

// From the end of its frame on the uppermost bus to the end of that on the lowest, at worst: each bus adds its response
// to a message that comes with what those above it make early or late.
std::optional<rt::Duration> bound(unsigned depth, bool busy, rt::Duration shortest_frame) {
  rt::Duration latest{}, sum{};
  for (unsigned level = 0; level <= depth; ++level) {
    const rt::Duration jitter = latest - level * shortest_frame;
    const auto result = analysis::analyze(line_of(busy, jitter));
    const auto signal = std::ranges::find(result.responses, 0U, &analysis::Response::message);
    if (!signal->worst) return std::nullopt;
    const rt::Duration own = *signal->worst - jitter;
    if (level > 0) sum += own;
    latest += own;
  }
  return sum;
}

// A frame of two bytes without stuff bits, and the intermission before it.
constexpr rt::Duration shortest_frame = 63 * 1'000'000'000ns / bit_rate;

std::vector<std::string> delays(unsigned depth, bool busy) {
  Tower tower(depth);
  Random random(depth);
  auto& source = tower.port(0);
  struct Sender {
    sim::Controller* port;
    Other what;
    rt::Time next;
  };
  std::vector<Sender> others;
  for (unsigned level = 0; level <= depth && busy; ++level) {
    for (const Other& other : traffic) {
      const auto phase = std::chrono::microseconds(100 * random.below(100));
      others.push_back({&tower.port(level), other, tower.world.now() + phase});
    }
  }
  Seen above, beneath;
  tower.world.buses().front()->add_tap(above);
  tower.world.buses().back()->add_tap(beneath);
  rt::Duration least = 1h, longest{};
  constexpr unsigned signals = 20'000;
  constexpr rt::Duration step = 100us;
  unsigned sent = 0;
  for (rt::Time next = tower.world.now(); sent < signals; tower.world.run_for(step)) {
    const rt::Time now = tower.world.now();
    for (auto& other : others) {
      if (now < other.next) continue;
      other.port->send(can::Frame::base(other.what.id, {1, 2, 3, 4, 5, 6, 7, 8}), 0);
      other.next += other.what.period;
    }
    if (now < next) continue;
    next += signal_period;
    can::Frame frame = can::Frame::base(0x181, {0, 0});
    store_le(frame.data.data(), static_cast<std::uint16_t>(++sent));
    source.send(frame, 0);
  }
  tower.world.run_for(100ms);
  for (const auto& [value, at] : beneath.when) {
    const rt::Duration delay = at - above.when.at(value);
    least = std::min(least, delay);
    longest = std::max(longest, delay);
  }
  if (beneath.when.size() != signals) std::exit(1);  // one was left behind
  const auto most = bound(depth, busy, shortest_frame);
  if (most && longest > *most) std::exit(1);  // the analysis is wrong
  const double load = tower.world.buses().back()->load();
  tower.world.buses().front()->remove_tap(above);
  tower.world.buses().back()->remove_tap(beneath);
  const auto us = [](rt::Duration time) { return fmt::format("{:.0f} us", time / 1.0us); };
  return {
      std::to_string(depth),    fmt::format("{:.0f} %", load * 100), us(depth * shortest_frame), us(least), us(longest),
      most ? us(*most) : "none"};
}

void print_delays() {
  std::vector<std::vector<std::string>> rows;
  for (unsigned depth = 1; depth <= 3; ++depth) {
    rows.push_back(delays(depth, false));
    rows.push_back(delays(depth, true));
  }
  bench::print_columns("delay of a signal, end of frame to end of frame, 20,000 of them, every 2 ms, 500 kbit/s",
                       {"gateways", "load beneath", "buses alone", "shortest", "longest", "bound"}, rows);
}

// What the gateway's own code takes: no bus, no PDO.
double forwarding() {
  rt::Executor executor;
  od::DescriptionBuilder b;
  b.variable(0x2000, {.name = "Value", .type = od::DataType::unsigned32, .mappable = true});
  const auto description = b.build();
  od::Values upper(description), lower(description);
  std::uint64_t changes = 0;
  std::vector<multilevel::SignalSide> sides(2);
  sides[0].values = &upper;
  sides[1].values = &lower;
  sides[1].changed = [&](ObjectRef) { ++changes; };
  multilevel::SignalGateway gateway(executor, sides, {{.name = "value", .source = {0x2000, 0}, .target = {0x2000, 0}}});
  gateway.set_complete(true);
  gateway.set_safe(true);
  constexpr std::uint32_t signals = 2'000'000;
  const bench::Watch watch;
  for (std::uint32_t i = 1; i <= signals; ++i) {
    upper.set({0x2000, 0}, i);
    gateway.received(0);
  }
  const double seconds = watch.seconds();
  if (changes != signals) std::exit(1);
  return seconds / signals * 1e9;
}

// An emergency from beneath until it is in the upper port: no bus, no other work.
struct EmcyPort final : can::Port {
  can::Queued send(const can::Frame&, std::uint32_t) noexcept override {
    ++frames;
    return can::Queued::yes;
  }
  void withdraw(std::uint32_t) noexcept override {}
  void listen(can::Listener* who, std::span<const can::IdRange>) noexcept override { listener = who; }
  [[nodiscard]] can::Status status() const noexcept override {
    can::Status now;
    now.up = true;
    return now;
  }
  bool restart(std::uint32_t) noexcept override { return false; }
  can::Listener* listener = nullptr;
  std::uint64_t frames = 0;
};

double emergencies() {
  rt::Executor executor;
  EmcyPort above, beneath;
  can::Dispatcher upper_dispatcher(executor, above), lower_dispatcher(executor, beneath);
  device::Device upper(upper_dispatcher, device::minimal_description(), nullptr, {.node_id = NodeId(3)});
  upper.power_on();
  executor.advance(executor.now() + 1s);
  upper.apply(co::NmtCommand::start);
  multilevel::EmcyGateway gateway(upper.errors().emcy());
  gateway.hear_all(lower_dispatcher);
  constexpr std::uint32_t messages = 500'000;
  const std::uint64_t before = above.frames;
  const bench::Watch watch;
  for (std::uint32_t i = 0; i < messages; ++i) {
    can::Frame frame = can::Frame::base(0x85 + i % 100, {0x10, 0x23, 3, 0, 0, 0, 0, 0});
    frame.data[0] = static_cast<std::uint8_t>(i / 100 % 2 == 0 ? 0x10 : 0);  // it comes, and exits
    frame.data[1] = static_cast<std::uint8_t>(i / 100 % 2 == 0 ? 0x23 : 0);
    beneath.listener->received(frame, executor.now());
    executor.advance(executor.now());
  }
  const double seconds = watch.seconds();
  if (above.frames - before != messages) {
    std::fprintf(stderr, "bench multilevel: %llu of %u emergencies went up\n",
                 static_cast<unsigned long long>(above.frames - before), messages);
    std::exit(1);
  }
  return seconds / messages * 1e9;
}

// ---- the harvester

struct Booted {
  rt::Duration time{};
  std::size_t devices = 0;
};

// One bus of it by itself, with Berth as its master; gateways are devices like others then. Empty: the whole machine.
void leave_alone(const std::string& only, design::Machine& machine, plant::PlantFile& plant) {
  design::Bus bus = *machine.bus(only);
  bus.own_port = true;
  bus.gateway.reset();
  machine.buses = {bus};
  machine.beneath.clear();
  std::erase_if(machine.slots, [&](const auto& slot) { return slot.spec.name.bus != only; });
  std::erase_if(plant.devices, [&](const auto& device) { return device.bus != only || device.does.master; });
  std::erase_if(plant.buses, [&](const auto& each) { return each.name != only; });
  plant.gateways.clear();
}

Booted boot(const std::string& only) {
  const auto alone = [&](design::Machine& machine, plant::PlantFile& plant) {
    if (!only.empty()) leave_alone(only, machine, plant);
  };
  test::Harvester machine(alone);
  if (!machine.begin()) {
    std::fprintf(stderr, "bench multilevel: %s\n", machine.problem().c_str());
    std::exit(3);
  }
  if (!machine.run_until([&] { return machine.operational() && machine.all_run(); }, 120s)) std::exit(3);
  return {machine.world().executor().now().time_since_epoch(), machine.world().devices().size()};
}

void print_harvester() {
  std::vector<std::vector<std::string>> rows;
  rt::Duration sum{};
  for (const char* const bus : {"backbone", "left", "right", "header", "reel"}) {
    const auto [time, devices] = boot(bus);
    sum += time;
    rows.push_back({bus, std::to_string(devices), bench::time_text(time)});
  }
  rows.push_back({"one after the other", "", bench::time_text(sum)});
  const auto [time, devices] = boot("");
  rows.push_back({"the machine, through its gateways", std::to_string(devices), bench::time_text(time)});
  bench::print_columns("the harvester from blank to operational, bus time", {"bus", "devices", "time"}, rows);
}

// ---- levels (S3.3)

// Twenty devices with a PDO of 8 bytes every 10 ms: on one bus of 250 kbit/s, or ten each on two buses beneath
// gateways, which send one signal each on.
void print_levels() {
  const auto loads = [](bool levels) {
    sim::World world{1};
    std::vector<sim::Bus*> buses;
    for (const char* const name : {"backbone", "left", "right"}) buses.push_back(&world.add_bus(name, 250'000));
    std::vector<std::pair<std::unique_ptr<sim::Controller>, can::Frame>> senders;
    for (std::uint32_t i = 0; i < 20; ++i) {
      auto& bus = *buses[!levels ? 0 : i < 10 ? 1 : 2];
      senders.emplace_back(bus.attach({}), can::Frame::base(0x181 + i, {1, 2, 3, 4, 5, 6, 7, 8}));
    }
    for (std::uint32_t i = 0; i < 2 && levels; ++i)
      senders.emplace_back(buses[0]->attach({}), can::Frame::base(0x201 + i, {1, 2}));
    for (int cycle = 0; cycle < 1000; ++cycle) {
      for (auto& [port, frame] : senders) port->send(frame, 0);
      world.run_for(10ms);
    }
    std::vector<std::string> row;
    for (auto* const bus : buses) row.push_back(fmt::format("{:.1f} %", 100 * bus->load()));
    return row;
  };
  const auto one = loads(false), many = loads(true);
  bench::print_columns("bus load of twenty devices with a PDO of 8 bytes every 10 ms, 250 kbit/s",
                       {"", "backbone", "left", "right"},
                       {{"one bus", one[0], "-", "-"}, {"two levels", many[0], many[1], many[2]}});
}

}  // namespace

int main() {
  print_accesses();
  print_delays();
  print_harvester();
  print_levels();
  const bench::Figure figures[] = {
      bench::at_most("a signal forwarded", forwarding(), 200, "ns"),
      {"an EMCY forwarded", fmt::format("{:.0f} ns", emergencies())},
  };
  bench::print_figures("a gateway's processor", figures);
  return 0;
}
