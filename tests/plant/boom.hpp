/// What the tests of a gateway's NMT master share: a plant of two buses, the network list brought in through the
/// gateway.
#pragma once

#include <gtest/gtest.h>
#include <algorithm>
#include <array>
#include <chrono>
#include <memory>
#include <string>
#include <vector>

#include "berth/base/bytes.hpp"
#include "berth/multilevel/gateway_access.hpp"
#include "berth/plant/world.hpp"
#include "berth/rt/scope.hpp"
#include "record.hpp"

namespace berth::plant {

using namespace std::chrono_literals;

inline constexpr const char* two_levels = R"(
[bus.backbone]
bitrate = 250_000
[bus.boom]
bitrate = 125_000

[[device]]
name = "boom gateway"
bus = "backbone"
type = { vendor = 1, product = 1 }
node_id = 3
[[device]]
name = "boom port"
bus = "boom"
type = { vendor = 1, product = 2 }
node_id = 1
master = { flying = false, most = 9 }
[[device]]
name = "valve {n}"
bus = "boom"
type = { vendor = 1, product = 3 }
heartbeat = "100 ms"
count = 2
[[device]]
name = "sensor"
bus = "boom"
type = { vendor = 1, product = 4 }
heartbeat = "100 ms"
speaks = ["fastscan"]

[[gateway]]
above = "boom gateway"
beneath = ["boom port"]
)";

struct Boom : ::testing::Test {
  Boom() { build(); }
  void build(const std::string& plant = two_levels) {
    clear();
    const auto result = read_plant(plant, "x.plant.toml");
    for (const auto& finding : result.findings) ADD_FAILURE() << finding.message;
    Findings findings;
    world = World::make(*result.plant, {}, findings);
    EXPECT_TRUE(world);
    port = world->attach_master("backbone", {.queue_depth = 16, .rx_depth = 16});
    record = std::make_unique<Record>(*world->bus("backbone"));
    dispatcher = std::make_unique<can::Dispatcher>(world->executor(), *port);
    client = std::make_unique<co::SdoClient>(*dispatcher);
    routes = std::make_unique<multilevel::Routes>(*client);
    scope = std::make_unique<rt::Scope>(world->executor());
    world->start();
  }
  ~Boom() override { clear(); }
  void clear() {
    scope.reset();
    routes.reset();
    client.reset();
    dispatcher.reset();
    record.reset();
    port.reset();
    world.reset();
  }
  struct Row {
    ObjectRef object;
    std::uint32_t value;
    std::size_t size = 4;
  };
  static rt::Task<void> write_all(co::SdoAccess& node, const std::vector<Row>& rows, unsigned& good) {
    for (const Row& row : rows) {
      std::array<std::uint8_t, 8> bytes{};
      store_le(bytes.data(), std::uint64_t{row.value});
      const std::span<const std::uint8_t> data = std::span(bytes).first(row.size);
      const auto done = co_await node.write(row.object.index, row.object.sub, data);
      good += done ? 1 : 0;
      if (!done) ADD_FAILURE() << std::hex << row.object.index << ": " << describe(done.error());
    }
  }
  /// By the gateway's own node beneath.
  void write(const std::vector<Row>& rows) {
    unsigned good = 0;
    scope->spawn(write_all(routes->access(*multilevel::parse_path("3/1")), rows, good));
    world->sim().run_until([&] { return scope->running() == 0; }, 30s);
    EXPECT_EQ(good, rows.size());
  }
  std::vector<Row> list() {
    std::vector<Row> rows;
    for (std::uint8_t node = 4; node <= 6; ++node) {
      rows.push_back({{0x1F81, node}, 0x0D});
      rows.push_back({{0x1F85, node}, 1});
      rows.push_back({{0x1F86, node}, node == 6 ? 4U : 3U});
      rows.push_back({{0x1016, static_cast<std::uint8_t>(node - 3)}, node * 0x10000U + 300});
    }
    return rows;
  }
  void commission() {
    auto rows = list();
    rows.push_back({{0x1010, 1}, 0x65766173});
    rows.push_back({{0x1F82, 1}, 6, 1});
    write(rows);
  }
  Truth truth(const char* name) { return world->find(name)->truth(); }
  bool all_run() {
    return std::ranges::all_of(std::array{"valve 1", "valve 2", "sensor"},
                               [&](const char* name) { return truth(name).state == NmtState::operational; });
  }
  std::unique_ptr<World> world;
  std::unique_ptr<sim::Controller> port;
  std::unique_ptr<Record> record;
  std::unique_ptr<can::Dispatcher> dispatcher;
  std::unique_ptr<co::SdoClient> client;
  std::unique_ptr<multilevel::Routes> routes;
  std::unique_ptr<rt::Scope> scope;
};

// The rest of the plant is what the master beneath gives node-IDs to.
inline constexpr const char* master_beneath = R"(
[bus.backbone]
bitrate = 250_000
[bus.boom]
bitrate = 125_000

[[device]]
name = "boom gateway"
bus = "backbone"
type = { vendor = 1, product = 1 }
node_id = 3
[[device]]
name = "boom port"
bus = "boom"
type = { vendor = 1, product = 2 }
node_id = 1
master = { flying = false, most = 9 }
[[gateway]]
above = "boom gateway"
beneath = ["boom port"]
)";

}  // namespace berth::plant
