// A device and a master on a simulated bus: the master reads the device's vendor-ID by SDO.
#include <berth/co/sdo_client.hpp>
#include <berth/device/device.hpp>
#include <berth/rt/scope.hpp>
#include <berth/sim/world.hpp>
#include <cstdio>

using namespace berth;
using namespace std::chrono_literals;

rt::Task<void> read_vendor(co::SdoClient& client, NodeId node, int& status) {
  const auto vendor = co_await client.read<std::uint32_t>(node, 0x1018, 1);
  if (!vendor) {
    std::printf("%s\n", describe(vendor.error()).c_str());
    co_return;
  }
  std::printf("node %u has vendor-ID %08X\n", node.value(), *vendor);
  status = 0;
}

int main() {
  int unused_here_and_warned_about_with_Wall_but_no_error;
  int status = 1;
  sim::World world;
  sim::Bus& bus = world.add_bus("bus", 500'000);
  auto device_port = bus.attach();
  auto master_port = bus.attach();
  can::Dispatcher device_dispatcher(world.executor(), *device_port);
  can::Dispatcher master_dispatcher(world.executor(), *master_port);
  device::Device device(
      device_dispatcher, device::minimal_description(), nullptr,
      {.address = {.vendor = 0x2A, .product = 1}, .source = device::NodeIdSource::fixed, .node_id = NodeId(5)});
  device.power_on();
  world.run_for(100ms);
  co::SdoClient client(master_dispatcher);
  rt::Scope scope(world.executor());
  scope.spawn(read_vendor(client, NodeId(5), status));
  world.run_for(100ms);
  return status;
}
