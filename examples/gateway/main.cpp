// A gateway as its maker writes it: a slave on the backbone, the master of a bus of its own beneath (paper 3). It gives
// the valve there its node-ID by its network list, boots that bus first, carries SDO and emergencies, and hands a
// lever's position on while it is safe. Here on two simulated buses, with a master above that reads a value of the
// valve beneath (path 3/5); every frame is printed. docs/multilevel.md says how.
#include <cstdio>

#include "berth/network/dictionary_manager.hpp"
#include "berth/manager/node_id_assigner.hpp"
#include "berth/multilevel/gateway_access.hpp"
#include "berth/multilevel/gateway_device.hpp"
#include "berth/sim/world.hpp"

using namespace berth;
using namespace std::chrono_literals;

struct Print final : can::Tap {
  explicit Print(sim::Bus& line) : bus(line) { bus.add_tap(*this); }
  ~Print() { bus.remove_tap(*this); }
  void frame(const can::Frame& frame, rt::Time, int) noexcept override {
    std::printf("%-10s %s\n", bus.name().c_str(), can::to_string(frame).c_str());
  }
  sim::Bus& bus;
};

rt::Task<void> read_valve(co::SdoAccess& valve) {
  const auto type = co_await valve.read_u32(0x1000, 0);
  std::printf("the valve beneath the gateway is of type %08X\n", type ? *type : 0U);
}

int main() {
  sim::World world;
  Print backbone(world.add_bus("backbone", 500'000)), boom(world.add_bus("  boom", 125'000));
  const auto up = backbone.bus.attach({.queue_depth = 16, .rx_depth = 16});
  const auto down = boom.bus.attach({.queue_depth = 16, .rx_depth = 16});

  od::DescriptionBuilder upper, lower;  // ---- the gateway: its dictionaries, and what crosses
  device::add_device(upper, {.name = "Boom gateway"});
  multilevel::add_gateway_objects(upper);
  upper.variable(0x2000,
                 {.name = "Lever", .type = od::DataType::integer16, .access = od::Access::rww, .mappable = true});
  device::add_rpdo(upper, 1, {.map = {{{0x2000, 0}, 16}}});
  device::add_device(lower, {.name = "Boom master"});
  network::add_manager_objects(lower, {.most = 8});
  lower.variable(0x2000, {.name = "Lever", .type = od::DataType::integer16, .mappable = true});
  device::add_tpdo(lower, 1, {.map = {{{0x2000, 0}, 16}}});
  multilevel::GatewayDevice gateway(world.executor(), *up,
                                    {.upper = {.node_id = NodeId(3)}, .description = upper.build()});
  auto& bus = gateway.add_bus(
      *down, {.device = {.node_id = NodeId(1), .presets = {{{0x1F81, 5}, 0x0D}, {{0x1F85, 5}, 1}, {{0x1F86, 5}, 7}}},
              .description = lower.build(),
              .boots_first = true});
  network::DictionaryManager master(bus.dispatcher(), bus.device().values(),
                                    [&](co::NmtCommand command) { bus.device().apply(command); });
  bus.use(master.bus().sdo());
  manager::ListStore told;  // to whom which node-ID; a real one gets a `ListMemory`, which outlives power
  manager::NodeIdAssigner assigner(
      {bus.dispatcher(), master.bus().sdo(), master.bus().nmt(), bus.device().values(), told});
  master.assign_by(&assigner);
  bus.device().on().state = [&](NmtState state) { master.own_state(state, NodeId(1)); };
  master.network().observe([&](const network::NetworkEvent& event) {
    if (event.kind == network::NetworkEvent::Kind::operational) bus.sub_bus().booted();
    if (event.kind == network::NetworkEvent::Kind::halted) bus.sub_bus().failed(event.node);
  });
  gateway.set_signals({{.name = "lever", .source = {0x2000, 0}, .target = {0x2000, 0}, .budget = 2ms}});
  gateway.signals().set_safe(true);

  const auto valve_port = boom.bus.attach({.rx_depth = 16});  // ---- the valve beneath, new from the factory
  can::Dispatcher valve_dispatcher(world.executor(), *valve_port);
  device::Device valve(valve_dispatcher, device::minimal_description(), nullptr, {.address = {1, 7, 1, 42}});
  valve.power_on();
  gateway.power_on();
  world.run_for(2s);

  const auto port = backbone.bus.attach();  // ---- the master above
  can::Dispatcher dispatcher(world.executor(), *port);
  co::SdoClient client(dispatcher);
  multilevel::Routes routes(client);
  rt::Scope scope(world.executor());
  scope.spawn(read_valve(routes.access(*multilevel::parse_path("3/5"))));
  world.run_for(100ms);
  for (const char* frame : {"000#0103", "203#7B01"}) dispatcher.send(*can::parse_frame(frame)), world.run_for(20ms);
  valve.errors().raise(0x2310, co::error_register::current);
  world.run_for(20ms);
  std::printf("the lever's position took %ld us\n", gateway.signals().figures(0).longest / 1us);
}
