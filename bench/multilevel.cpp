// Machines of many buses (paper 3; docs/multilevel.md): what an access through gateways costs, the paper's way and CiA
// 302-7's; how late a signal is behind one to three gateways; what a gateway's processor has to do for it.
#include <fmt/format.h>

#include <algorithm>
#include <map>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "bench/tools/figures.hpp"
#include "berth/base/bytes.hpp"
#include "berth/base/random.hpp"
#include "berth/multilevel/gateway_access.hpp"
#include "berth/multilevel/gateway_device.hpp"
#include "berth/multilevel/remote_sdo.hpp"
#include "berth/rt/scope.hpp"
#include "berth/sim/world.hpp"

using namespace berth;
using namespace std::chrono_literals;

namespace {

constexpr std::uint32_t bit_rate = 500'000;
constexpr std::uint16_t far_network = 9;

struct Count final : can::Tap {
  explicit Count(sim::Bus& line) : bus(&line) { line.add_tap(*this); }
  ~Count() { bus->remove_tap(*this); }
  void frame(const can::Frame&, rt::Time at, int) noexcept override {
    ++frames;
    last = at;
  }
  sim::Bus* bus;
  unsigned frames = 0;
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
    unsigned above = 0, all = 0;
    rt::Duration time{};
    [[nodiscard]] std::string text() const { return fmt::format("{} / {} / {}", above, all, bench::time_text(time)); }
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
    Cost made{.above = counts[0]->frames, .time = counts[0]->last - began};
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
  for (unsigned depth = 0; depth <= 6; ++depth) {
    Tower tower(depth);
    auto& access = tower.routes->access(tower.path);
    const auto first = tower.cost(access), further = tower.cost(access);
    rows.push_back(
        {std::to_string(depth), first.text(), further.text(), depth == 0 ? "-" : tower.cost(*tower.remote).text()});
  }
  bench::print_columns("an SDO upload of four bytes: frames on the client's bus / on all buses / time, 500 kbit/s",
                       {"gateways", "paper 3, first", "paper 3, further", "CiA 302-7"}, rows);
}

// When each value was on a bus.
struct Seen final : can::Tap {
  void frame(const can::Frame& frame, rt::Time at, int) noexcept override {
    if (frame.id == 0x181) when[load_le<std::uint16_t>(frame.data.data())] = at;
  }
  std::map<unsigned, rt::Time> when;
};

std::vector<std::string> delays(unsigned depth, unsigned background_us) {
  Tower tower(depth);
  Random random(depth);
  auto& source = tower.port(0);
  std::vector<sim::Controller*> others;
  for (unsigned level = 0; level <= depth; ++level) others.push_back(&tower.port(level));
  Seen above, beneath;
  tower.world.buses().front()->add_tap(above);
  tower.world.buses().back()->add_tap(beneath);
  rt::Duration least = 1h, longest{};
  for (unsigned i = 1; i <= 2000; ++i) {
    can::Frame frame = can::Frame::base(0x181, {0, 0});
    frame.data[0] = static_cast<std::uint8_t>(i);
    frame.data[1] = static_cast<std::uint8_t>(i >> 8U);
    source.send(frame, 0);
    for (unsigned step = 0; step < 20; ++step) {
      tower.world.run_for(100us);
      if (background_us == 0) continue;
      for (auto* other : others) {
        if (random.below(background_us) >= 100) continue;
        const can::Frame noise =
            can::Frame::base(static_cast<std::uint32_t>(0x100 + random.below(0x60)), {1, 2, 3, 4, 5, 6, 7, 8});
        other->send(noise, 0);
      }
    }
  }
  tower.world.run_for(100ms);
  for (const auto& [value, at] : beneath.when) {
    const rt::Duration delay = at - above.when.at(value);
    least = std::min(least, delay);
    longest = std::max(longest, delay);
  }
  if (beneath.when.size() != above.when.size()) std::exit(1);  // one was left behind
  const double load = tower.world.buses().back()->load();
  tower.world.buses().front()->remove_tap(above);
  tower.world.buses().back()->remove_tap(beneath);
  return {std::to_string(depth), fmt::format("{:.0f} %", load * 100), fmt::format("{:.0f} us", least / 1.0us),
          fmt::format("{:.0f} us", longest / 1.0us)};
}

void print_delays() {
  std::vector<std::vector<std::string>> rows;
  for (unsigned depth = 1; depth <= 3; ++depth) {
    rows.push_back(delays(depth, 0));
    rows.push_back(delays(depth, 500));
  }
  bench::print_columns("delay of a signal, end of frame to end of frame, 2000 of them, 500 kbit/s",
                       {"gateways", "load beneath", "shortest", "longest"}, rows);
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

}  // namespace

int main() {
  print_accesses();
  print_delays();
  const bench::Figure figures[] = {bench::at_most("a signal forwarded", forwarding(), 200, "ns")};
  bench::print_figures("a gateway's processor", figures);
  return 0;
}
