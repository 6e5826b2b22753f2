// A small master program: reads and writes objects of an I/O module by the names of its EDS, starts it, and listens to
// its PDO and its emergencies. Once as a coroutine, once with callbacks. The module and its bus are simulated:
//
//     build/release/examples/example_client examples/eds/io.eds
#include <array>
#include <cstdio>

#include "berth/client/remote_node.hpp"
#include "berth/device/device.hpp"
#include "berth/eds/eds.hpp"
#include "berth/rt/scope.hpp"
#include "berth/sim/world.hpp"

using namespace berth;
using namespace std::chrono_literals;

// As a coroutine: what is awaited reads like what is done.
rt::Task<void> run_module(client::RemoteNode& node) {
  const auto name = co_await node.read<std::string>("Manufacturer device name");
  if (name) std::printf("device: %s\n", name->c_str());
  const auto written = co_await node.write("Debounce time", 20);
  std::printf("debounce time: %s\n", written ? "written" : written.error().message.c_str());
  const auto refused = co_await node.write("Debounce time", 101);  // the EDS says: at most 100
  if (!refused) std::printf("%s\n", refused.error().message.c_str());

  const auto inputs = co_await node.subscribe(1);  // TPDO 1, mapped as the device says
  const auto outputs = co_await node.open(1);      // RPDO 1
  if (!inputs || !outputs) co_return;
  client::Tpdo& tpdo = **inputs;
  co_await node.nmt(co::NmtCommand::start);
  for (;;) {
    const auto sample = co_await tpdo.next(rt::never);
    if (!sample) co_return;
    const unsigned value = sample->get<std::uint8_t>("Read input 8 bit.Inputs 1 to 8").value_or(0);
    std::printf("inputs %02X\n", value);
    if ((*outputs)->set("Outputs 1 to 8", ~value & 0xFF)) (*outputs)->send();
  }
}

// With callbacks: they are called one by one, and may begin whatever they like.
void watch_module(client::RemoteNode& node) {
  node.on_emcy([&node](const client::Emergency& emergency) {
    std::printf("EMCY %04X: %s\n", emergency.emcy.code, emergency.text());
    node.read<std::uint16_t>("Supply voltage", [](const client::Outcome<std::uint16_t>& volts) {
      std::printf("supply voltage: %s\n",
                  volts ? (std::to_string(*volts) + " mV").c_str() : volts.error().message.c_str());
    });
  });
  node.on_state([](const client::StateEvent& event) {
    std::printf("node %u: %s, %s\n", event.node.value(), co::name(event.kind), name(event.state));
  });
}

int main(int count, char** words) {
  const auto eds = eds::read_file(count > 1 ? words[1] : "examples/eds/io.eds");
  for (const auto& finding : eds.findings) std::fprintf(stderr, "%s\n", to_string(finding).c_str());
  if (!eds.usable()) return 2;

  sim::World world;
  sim::Bus& bus = world.add_bus("bus", 500'000);
  const auto module_port = bus.attach();
  const auto master_port = bus.attach();
  can::Dispatcher module_dispatcher(world.executor(), *module_port);
  can::Dispatcher master_dispatcher(world.executor(), *master_port);
  device::Device module(module_dispatcher, eds.file.description, nullptr, {.address = {1, 3}, .node_id = NodeId(5)});

  client::Network network(master_dispatcher);
  client::RemoteNode node(network, NodeId(5), eds.file.description);
  watch_module(node);
  module.power_on();
  world.run_for(10ms);
  rt::Scope scope(world.executor());
  scope.spawn(run_module(node));
  world.run_for(100ms);

  auto inputs = module.variable<std::uint8_t>({0x6000, 1});
  for (const auto value : std::to_array<std::uint8_t>({0x01, 0x81})) {
    inputs.set(value);
    world.run_for(10ms);
  }
  module.errors().raise(0x3120, co::error_register::voltage);
  world.run_for(10ms);
  std::printf("outputs %02X\n", module.variable<std::uint8_t>({0x6200, 1}).get());
  return 0;
}
