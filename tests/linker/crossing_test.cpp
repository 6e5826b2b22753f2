// Links across gateways: PDOs on every bus of the way, routes in the gateways, and the refusals.
#include <fmt/format.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <map>

#include "berth/device/dictionary.hpp"
#include "berth/eds/eds.hpp"
#include "berth/eds/write.hpp"
#include "berth/linker/files.hpp"
#include "berth/linker/plan_file.hpp"
#include "berth/multilevel/routing_objects.hpp"
#include "tests/linker/devices.hpp"

using namespace berth;
using namespace berth::test;
using namespace std::chrono_literals;
using linker::make_plan;

namespace {

/// One node of a gateway, as its maker's EDS has it. `rows` 0: no routing objects.
std::shared_ptr<const eds::File> gateway_node(std::uint8_t rows, std::uint8_t places = 4) {
  od::DescriptionBuilder b;
  device::add_device(b, {.name = "Gateway"});
  if (rows != 0) multilevel::add_routing_objects(b, rows);
  if (places != 0) multilevel::add_signal_places(b, places, 4);
  eds::File file;
  file.description = b.build();
  file.device.granularity = 8;
  file.device.rpdos = file.device.tpdos = 4;
  file.info.file_name = "gateway.eds";
  return std::make_shared<const eds::File>(eds::read(eds::write(file).text, "gateway.eds").file);
}

/// A backbone with `left` beneath it and `reel` beneath that.
linker::LinkNetwork tree() {
  const auto io = file_of(io_module());
  auto network = network_of({{"engine", io},
                             {"left gateway", gateway_node(8)},
                             {"sensor", io},
                             {"valve", io},
                             {"reel gateway", gateway_node(8)},
                             {"motor", io},
                             {"pump", io},
                             {"left gateway on left", gateway_node(0)},
                             {"reel gateway on reel", gateway_node(0)}});
  for (const char* const name : {"left", "reel"}) {
    network.buses.push_back(network.buses.front());
    network.buses.back().name = name;
  }
  const std::size_t buses[] = {0, 0, 1, 1, 1, 2, 2, 1, 2};
  for (std::size_t i = 0; i < network.nodes.size(); ++i) network.nodes[i].bus = buses[i];
  for (const std::size_t own : {7U, 8U}) network.nodes[own].id = NodeId(1);
  network.nodes[5].id = NodeId(3);  // as the left gateway, on another bus
  network.gateways.push_back({.above = 1, .bus = 1, .beneath = 7});
  network.gateways.push_back({.above = 4, .bus = 2, .beneath = 8});
  return network;
}

std::string problems_of(const linker::Planned& planned) {
  std::string text;
  for (const auto& each : planned.findings) text += to_string(each) + "\n";
  return text;
}

/// What is written into the devices, followed from an object to where it arrives: "node/object". By the meaning of the
/// objects alone (CiA 301 §7.5.2.33 to 38, docs/multilevel.md), not by the plan.
class Followed {
 public:
  explicit Followed(const linker::LinkNetwork& network, const linker::Plan& plan) : network_(network) {
    for (std::size_t node = 0; node < network.nodes.size(); ++node) {
      if (!plan.linked[node]) continue;
      for (const auto& each : linker::settings_of(network, plan, node)) {
        values_[node][each.object] = each.value.resolve(each.type, network.nodes[node].id.value());
      }
    }
  }
  std::vector<std::string> from(const std::string& name, ObjectRef object, int depth = 0) {
    const auto node = index(name);
    std::vector<std::string> ends;
    for (std::uint16_t n = 0; n < 8 && depth < 8; ++n) {
      const auto id = value(node, 0x1800 + n, 1);
      if ((id & 0x8000'0000) != 0) continue;
      unsigned at = 0;
      for (std::uint8_t sub = 1; sub <= value(node, 0x1A00 + n, 0); ++sub) {
        const auto entry = value(node, 0x1A00 + n, sub);
        const auto bits = static_cast<unsigned>(entry & 0xFF);
        if (entry >> 8 == (static_cast<std::uint64_t>(object.index) << 8U | object.sub))
          arrive(node, id & 0x7FF, at, bits, depth, ends);
        at += bits;
      }
    }
    std::ranges::sort(ends);
    return ends;
  }
  std::uint64_t value(std::size_t node, unsigned index, unsigned sub) {
    const auto& all = values_[node];
    const auto it = all.find({static_cast<std::uint16_t>(index), static_cast<std::uint8_t>(sub)});
    return it == all.end() ? ((sub == 1 && index < 0x1A00) ? 0x8000'0000U : 0U) : it->second;
  }

 private:
  std::size_t index(const std::string& name) const {
    return static_cast<std::size_t>(std::ranges::find(network_.nodes, name, &linker::Node::name) -
                                    network_.nodes.begin());
  }
  void arrive(std::size_t producer, std::uint64_t id, unsigned at, unsigned bits, int depth,
              std::vector<std::string>& ends) {
    for (auto& [node, ignored] : values_) {
      if (network_.nodes[node].bus != network_.nodes[producer].bus || node == producer) continue;
      for (std::uint16_t n = 0; n < 8; ++n) {
        if (value(node, 0x1400 + n, 1) != id) continue;
        unsigned here = 0;
        for (std::uint8_t sub = 1; sub <= value(node, 0x1600 + n, 0); ++sub) {
          const auto entry = value(node, 0x1600 + n, sub);
          const ObjectRef object{static_cast<std::uint16_t>(entry >> 16U), static_cast<std::uint8_t>(entry >> 8U)};
          if (here == at && (entry & 0xFF) == bits && object.index >= 0x20) {
            ends.push_back(fmt::format("{}/{:04X}h:{:02X}", network_.nodes[node].name, object.index, object.sub));
            hand_on(node, object, depth, ends);
          }
          here += static_cast<unsigned>(entry & 0xFF);
        }
      }
    }
  }
  /// By the rows of 5F11h of the gateway that has this node.
  void hand_on(std::size_t node, ObjectRef object, int depth, std::vector<std::string>& ends) {
    for (const auto& gateway : network_.gateways) {
      for (std::uint8_t row = 1; row <= value(gateway.above, 0x5F11, 0); ++row) {
        const auto raw = value(gateway.above, 0x5F11, row);
        const auto node_of = [&](std::uint64_t side) { return side == 0 ? gateway.above : *gateway.beneath; };
        const bool mine =
            node_of(raw & 0xFF) == node && (raw >> 8 & 0xFF) == object.sub && (raw >> 16 & 0xFFFF) == object.index;
        if (!mine) continue;
        const ObjectRef target{static_cast<std::uint16_t>(raw >> 48), static_cast<std::uint8_t>(raw >> 40)};
        for (auto& end : from(network_.nodes[node_of(raw >> 32 & 0xFF)].name, target, depth + 1)) {
          ends.push_back(std::move(end));
        }
      }
    }
  }
  const linker::LinkNetwork& network_;
  std::map<std::size_t, std::map<ObjectRef, std::uint64_t>> values_;
};

/// Those that are no places of gateways.
std::vector<std::string> arrivals(std::vector<std::string> ends) {
  std::erase_if(ends, [](const std::string& end) { return end.find("/5F2") != std::string::npos; });
  return ends;
}

using Names = std::vector<std::string>;

class LinkCrossing : public ::testing::Test {
 protected:
  std::string only() {
    const auto made = make_plan(network);
    EXPECT_EQ(made.findings.size(), 1U) << problems_of(made);
    return made.findings.empty() ? "" : to_string(made.findings.front());
  }
  linker::LinkNetwork network = tree();
};

}  // namespace

TEST_F(LinkCrossing, ValuesArriveThroughOneGatewayAndThroughTwoUpAndDown) {
  add_link(network, "motor/6401h:01", {"engine/6411h:01"}, 60ms);                     // two up
  add_link(network, "engine/6000h:01", {"sensor/6200h:01", "motor/6200h:02"}, 80ms);  // one down and two
  add_link(network, "sensor/6401h:02", {"motor/6411h:01"}, 40ms);                     // one down
  add_link(network, "sensor/6000h:02", {"engine/6200h:01", "valve/6200h:01"}, 40ms);  // one up, and here
  const auto made = make_plan(network);
  ASSERT_TRUE(made.good()) << problems_of(made);
  Followed flow(network, made.plan);
  EXPECT_EQ(arrivals(flow.from("motor", {0x6401, 1})), Names{"engine/6411h:01"});
  EXPECT_EQ(arrivals(flow.from("engine", {0x6000, 1})), (Names{"motor/6200h:02", "sensor/6200h:01"}));
  EXPECT_EQ(arrivals(flow.from("sensor", {0x6401, 2})), Names{"motor/6411h:01"});
  EXPECT_EQ(arrivals(flow.from("sensor", {0x6000, 2})), (Names{"engine/6200h:01", "valve/6200h:01"}));
  // The bus beneath two gateways carries what goes there, and nothing else.
  EXPECT_EQ(made.plan.routes.size(), 6U);
}

TEST_F(LinkCrossing, TheBoundIsThatOfEveryBusAndGatewayAndWithinTheDeadline) {
  network.gateways[0].delay = 2ms;
  network.gateways[1].delay = 3ms;
  add_link(network, "motor/6401h:01", {"engine/6411h:01"}, 60ms);
  const auto made = make_plan(network);
  ASSERT_TRUE(made.good()) << problems_of(made);
  ASSERT_EQ(made.plan.pdos.size(), 3U);
  ASSERT_EQ(made.plan.crossings.size(), 1U);
  const auto& way = made.plan.crossings.front();
  EXPECT_EQ(network.nodes[way.from].name, "motor");
  EXPECT_EQ(network.nodes[way.to].name, "engine");
  EXPECT_EQ(way.gateways, (std::vector<std::size_t>{1, 0}));
  rt::Duration sum = 5ms;
  for (const auto& pdo : made.plan.pdos) sum += *pdo.worst;
  ASSERT_TRUE(way.worst);
  EXPECT_EQ(*way.worst, sum);
  EXPECT_LE(sum, 60ms);
  // 55 ms for three buses of one bit rate; a gateway's budget has its own delay besides.
  for (const auto& pdo : made.plan.pdos) EXPECT_NEAR(static_cast<double>(pdo.deadline->count()), 55e6 / 3, 10);
  for (const auto& route : made.plan.routes) {
    EXPECT_NEAR(static_cast<double>(route.budget.count()),
                55e6 / 3 + static_cast<double>(network.gateways[route.gateway].delay.count()), 10);
    EXPECT_GT(route.freshness_ms, 0);
  }
}

TEST_F(LinkCrossing, ASlowBusGetsMoreOfTheDeadline) {
  network.buses[1].others.bit_rate = 125'000;
  add_link(network, "sensor/6401h:01", {"engine/6411h:01"}, 51ms);
  const auto made = make_plan(network);
  ASSERT_TRUE(made.good()) << problems_of(made);
  for (const auto& pdo : made.plan.pdos)
    EXPECT_NEAR(static_cast<double>(pdo.deadline->count()), pdo.bus == 1 ? 40e6 : 10e6, 10);
}

TEST_F(LinkCrossing, WithoutADeadlineNothingIsWatched) {
  add_link(network, "sensor/6401h:01", {"engine/6411h:01"});
  const auto made = make_plan(network);
  ASSERT_TRUE(made.good()) << problems_of(made);
  ASSERT_EQ(made.plan.routes.size(), 1U);
  EXPECT_EQ(made.plan.routes.front().budget, 0ms);
  EXPECT_EQ(made.plan.routes.front().freshness_ms, 0);
}

// A gateway that ends a TPDO because its producer is silent ends no other producer's.
TEST_F(LinkCrossing, WhatComesFromTwoDevicesSharesNoPdoOfAGateway) {
  for (int sub = 1; sub <= 2; ++sub) {
    add_link(network, fmt::format("sensor/6000h:{:02X}", sub), {fmt::format("engine/6200h:{:02X}", sub)}, 40ms);
    add_link(network, fmt::format("valve/6401h:{:02X}", sub), {fmt::format("engine/6411h:{:02X}", sub)}, 40ms);
  }
  const auto made = make_plan(network);
  ASSERT_TRUE(made.good()) << problems_of(made);
  const auto of_gateway = std::ranges::count(made.plan.pdos, 1U, &linker::Pdo::producer);
  EXPECT_EQ(of_gateway, 2);
  for (const auto& pdo : made.plan.pdos) EXPECT_EQ(pdo.carried.size(), 2U);
}

TEST_F(LinkCrossing, RoutesAndPlacesStayWhateverElseIsLinked) {
  add_link(network, "sensor/6401h:02", {"engine/6411h:02"}, 40ms);
  const auto first = make_plan(network);
  ASSERT_TRUE(first.good());
  Findings none;
  const auto text = linker::write(linker::earlier_of(network, first.plan));
  const auto earlier = linker::read_plan(text, "plan.toml", none);
  ASSERT_TRUE(earlier) << text;
  EXPECT_EQ(*earlier, linker::earlier_of(network, first.plan));
  add_link(network, "sensor/6401h:01", {"engine/6411h:01"}, 40ms);  // comes before it in any order
  const auto more = make_plan(network, *earlier);
  ASSERT_TRUE(more.good()) << problems_of(more);
  const auto same = [&](const linker::Route& route) { return route.object == ObjectRef{0x6401, 2}; };
  const auto old = first.plan.routes.front();
  const auto now = *std::ranges::find_if(more.plan.routes, same);
  EXPECT_EQ(now.row, old.row);
  EXPECT_EQ(now.source, old.source);
  EXPECT_EQ(now.target, old.target);
}

TEST_F(LinkCrossing, RowsOfTheGatewaysOwnConfigurationStay) {
  auto with_row = std::make_shared<eds::File>(*network.nodes[1].file);
  const multilevel::RouteEntry by_hand{1, 0, {0x5F21, 1}, {0x5F21, 1}};
  with_row->parameters.push_back({{0x5F11, 1}, od::DataType::unsigned64, od::Literal::number(by_hand.raw())});
  network.nodes[1].file = with_row;
  add_link(network, "sensor/6401h:01", {"engine/6411h:01"}, 40ms);
  const auto made = make_plan(network);
  ASSERT_TRUE(made.good()) << problems_of(made);
  ASSERT_EQ(made.plan.routes.size(), 1U);
  EXPECT_EQ(made.plan.routes.front().row, 2);
  EXPECT_EQ(made.plan.routes.front().source, (ObjectRef{0x5F21, 2}));
  EXPECT_EQ(made.plan.routes.front().target, (ObjectRef{0x5F21, 2}));
  const auto settings = linker::settings_of(network, made.plan, 1);
  const auto at = [&](ObjectRef object) { return std::ranges::find(settings, object, &eds::Parameter::object); };
  EXPECT_EQ(at({0x5F11, 1}), settings.end()) << "the configuration has it";
  ASSERT_NE(at({0x5F11, 0}), settings.end());
  EXPECT_EQ(at({0x5F11, 0})->value.raw, 2U);
}

TEST_F(LinkCrossing, NoGatewayOnTheWay) {
  network.gateways.pop_back();
  add_link(network, "motor/6401h:01", {"engine/6411h:01"});
  EXPECT_NE(only().find("motor is on reel, engine on field, and no gateway leads from one to the other"),
            std::string::npos);
}

TEST_F(LinkCrossing, AGatewayOfWhichNothingIsKnown) {
  network.gateways[0].beneath.reset();
  add_link(network, "motor/6401h:01", {"engine/6411h:01"});
  EXPECT_NE(only().find("the gateway left gateway is on the way, and nothing is known of its own node on left"),
            std::string::npos);
  network.gateways[0].beneath = 7;
  network.nodes[7].file.reset();
  EXPECT_NE(
      only().find("nothing is known of its own node on left, left gateway on left; add eds = \"FILE\" to its slot"),
      std::string::npos)
      << only();
  network.nodes[7].file = gateway_node(0);
  network.nodes[1].file = gateway_node(0);
  EXPECT_NE(only().find("the gateway left gateway has no routing objects (5F11h)"), std::string::npos);
  network.nodes[1].file = gateway_node(8);
  network.nodes[7].file = gateway_node(0, 0);
  EXPECT_NE(only().find("left gateway on left has no places for signals of 2 bytes (5F21h)"), std::string::npos);
}

TEST_F(LinkCrossing, SafetyRelevantDataIsNeverForwarded) {
  auto safe = std::make_shared<eds::File>(*network.nodes[0].file);
  safe->parameters.push_back({{0x1381, 1}, od::DataType::unsigned32, od::Literal::number(0x6000'0108)});
  network.nodes[0].file = safe;
  add_link(network, "engine/6000h:01", {"sensor/6200h:01"});
  EXPECT_NE(only().find("6000h:01 of engine is safety-relevant (SRDO): it is never forwarded"), std::string::npos);
}

TEST_F(LinkCrossing, SyncEndsAtTheGateway) {
  for (auto& bus : network.buses) bus.sync = 10ms;
  add_link(network, "sensor/6401h:01", {"engine/6411h:01"}, 100ms, 1);
  EXPECT_NE(only().find("SYNC of left ends at its gateway"), std::string::npos);
}

TEST_F(LinkCrossing, ADelayBudgetThatCannotBeMet) {
  add_link(network, "motor/6401h:01", {"engine/6411h:01"}, 2ms);
  EXPECT_NE(only().find("its deadline is 2 ms, and the 2 gateways on its way may take 2 ms without any bus"),
            std::string::npos);
  network.links.front().deadline = 2600us;  // 200 us for each bus, on which a frame takes 270 us
  const auto made = make_plan(network);
  EXPECT_FALSE(made.good());
  EXPECT_NE(problems_of(made).find("its deadline is 2.6 ms, of which 0.2 ms are for this bus"), std::string::npos)
      << problems_of(made);
}

TEST_F(LinkCrossing, AFullGateway) {
  network.nodes[1].file = gateway_node(1);
  add_link(network, "sensor/6401h:01", {"engine/6411h:01"});
  add_link(network, "valve/6401h:01", {"engine/6411h:02"});
  EXPECT_NE(only().find("left gateway has no row left for another signal (5F11h)"), std::string::npos);
}
