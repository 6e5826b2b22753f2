// A client on a real port: asks a device who it is, changes a value and follows its state until Ctrl-C or for some
// seconds. The same program runs on an interface, an adapter, a server or a simulated plant:
//
//     example_real_port socketcan:can0 250000 5 examples/eds/io.eds
//     example_real_port slcan:/dev/ttyACM0 250000 5 examples/eds/io.eds
//     example_real_port plant:/tmp/plant.sock 0 5 examples/eds/io.eds 3 field     # bus "field" of a plant, 3 seconds
#include <cstdio>
#include <cstdlib>
#include <string>

#include "berth/client/remote_node.hpp"
#include "berth/eds/eds.hpp"
#include "berth/io/open_port.hpp"
#include "berth/rt/scope.hpp"

using namespace berth;
using namespace std::chrono_literals;

namespace {

struct Wanted {
  can::PortSpec port;
  io::PortOptions options;
  NodeId node{};
  std::string eds;
  rt::Duration time = rt::Duration::max();
};

rt::Task<void> ask(client::RemoteNode& node) {
  const auto vendor = co_await node.read<std::uint32_t>("Identity object/Vendor-ID");
  if (!vendor) {
    std::printf("%s\n", vendor.error().message.c_str());  // node, object, what happened, what to do
    co_return;
  }
  std::printf("vendor-ID %08Xh\n", *vendor);
  const auto written = co_await node.write("Producer heartbeat time", 200);
  std::printf("heartbeat: %s\n", written ? "each 200 ms" : written.error().message.c_str());
  co_await node.nmt(co::NmtCommand::start);
}

int run(const Wanted& wanted) {
  const auto eds = eds::read_file(wanted.eds);
  for (const auto& finding : eds.findings) std::fprintf(stderr, "%s\n", to_string(finding).c_str());
  if (!eds.usable()) return 2;

  // In this order: the loop drives the executor, the port lives in the loop, the network on the port.
  rt::Executor executor;
  io::Loop loop(executor);
  const auto port = io::open_port(loop, wanted.port, wanted.options);
  if (!port) {
    std::fprintf(stderr, "%s\n", port.error().c_str());
    return 3;
  }
  can::Dispatcher dispatcher(executor, **port);
  client::Network network(dispatcher);
  client::RemoteNode node(network, wanted.node, eds.file.description, {.heartbeat = 1s});
  node.on_state([](const client::StateEvent& event) {
    std::printf("node %u: %s, %s\n", event.node.value(), co::name(event.kind), name(event.state));
    std::fflush(stdout);
  });
  rt::Scope scope(executor);
  scope.spawn(ask(node));
  const auto end = wanted.time == rt::Duration::max() ? rt::never : executor.now() + wanted.time;
  while (executor.now() < end) loop.turn(100ms);
  return 0;
}

int usage(const char* name) {
  std::fprintf(stderr, "usage: %s PORT BIT/S NODE EDS [SECONDS [BUS]]; BIT/S 0: as the port stands\n", name);
  return 2;
}

}  // namespace

int main(int count, char** words) {
  if (count < 5 || count > 7) return usage(words[0]);
  Wanted wanted;
  const auto port = can::parse_port(words[1]);
  const int node = std::atoi(words[3]);
  if (!port || node < 1 || node > 127) return usage(words[0]);
  wanted.port = *port;
  wanted.options.bit_rate = static_cast<std::uint32_t>(std::atoi(words[2]));
  wanted.node = NodeId(static_cast<std::uint8_t>(node));
  wanted.eds = words[4];
  if (count > 5) wanted.time = std::chrono::seconds(std::atoi(words[5]));
  if (count > 6) wanted.options.bus = words[6];
  return run(wanted);
}
