// What reaches what: the written DCFs, judged by code of their own, against the links.
#include <gtest/gtest.h>
#include <rapidcheck.h>
#include <rapidcheck/gtest.h>

#include <algorithm>

#include "berth/eds/concise_dcf.hpp"
#include "berth/eds/cpj.hpp"
#include "berth/eds/eds.hpp"
#include "berth/linker/files.hpp"
#include "tests/linker/devices.hpp"
#include "tests/linker/judge.hpp"

using namespace berth;
using namespace berth::test;
using namespace std::chrono_literals;
using linker::make_plan;

namespace {

std::string findings(const linker::Planned& planned) {
  std::string text;
  for (const auto& each : planned.findings) text += to_string(each) + "\n";
  return text;
}

std::vector<Dcf> dcfs(const linker::LinkNetwork& network, const linker::Plan& plan) {
  const auto files = linker::make_files(network, plan);
  std::vector<Dcf> made;
  if (!files) {
    ADD_FAILURE() << files.error();
    return made;
  }
  for (const auto& file : *files) {
    if (file.name.ends_with(".dcf")) made.emplace_back(file.bytes);
  }
  return made;
}

const Dcf& of(const std::vector<Dcf>& all, const linker::LinkNetwork& network, std::size_t node) {
  return *std::ranges::find_if(all, [&](const Dcf& d) { return d.node_id() == network.nodes[node].id.value(); });
}

unsigned object_of(const Dcf& device, const std::string& word) {
  if (word.find("h:") == std::string::npos) return device.named(word);
  return static_cast<unsigned>(std::stoul(word.substr(0, 4), nullptr, 16) << 8 |
                               std::stoul(word.substr(6), nullptr, 16));
}

/// What the links say, by the names in the DCFs.
Flow wanted(const linker::LinkNetwork& network, const std::vector<Dcf>& all) {
  Flow flow;
  for (const auto& link : network.links) {
    const Dcf& from = of(all, network, link.from.node);
    const unsigned source = object_of(from, link.from.object);
    for (const auto& end : link.to) {
      const Dcf& to = of(all, network, end.node);
      const unsigned target = object_of(to, end.object);
      EXPECT_NE(source, 0U) << link.from.object;
      EXPECT_NE(target, 0U) << end.object;
      for (unsigned bit = 0; bit < from.bits(source >> 8, source & 0xFF); ++bit) {
        flow.insert({{from.node_id(), source, bit}, {to.node_id(), target, bit}});
      }
    }
  }
  return flow;
}

/// The judge agrees with the links, all of them and nothing else.
void expect_linked(const linker::LinkNetwork& network, const linker::Plan& plan) {
  const auto all = dcfs(network, plan);
  const auto judged = judge(all);
  EXPECT_EQ(judged.wrong, std::vector<std::string>{});
  EXPECT_EQ(judged.flow, wanted(network, all));
}

linker::LinkNetwork two_controllers() {
  const auto plc = file_of(controller());
  return network_of({{"press", plc}, {"belt", plc}, {"lift", plc}});
}

}  // namespace

// S5.7, S5.21: one variable, sent by one program and received by two.
TEST(Links, S5_2_S5_7_S5_21_AVariableReachesItsConsumers) {
  auto network = two_controllers();
  add_link(network, "press/speed", {"belt/speed", "lift/press_speed"}, 20ms, 255, od::DataType::unsigned16);
  const auto made = make_plan(network);
  ASSERT_TRUE(made.good()) << findings(made);
  expect_linked(network, made.plan);
  // An input of the network is what the press sends; outputs are 480h behind (protocol facts B.9).
  ASSERT_EQ(made.plan.variables.size(), 3U);
  EXPECT_TRUE(made.plan.variables[0].input);
  EXPECT_EQ(made.plan.variables[0].object, (ObjectRef{0xA100, 1}));
  EXPECT_FALSE(made.plan.variables[1].input);
  EXPECT_EQ(made.plan.variables[1].object, (ObjectRef{0xA580, 1}));
  ASSERT_EQ(made.plan.pdos.size(), 1U);
  EXPECT_EQ(made.plan.pdos[0].can_id, 0x181);
  EXPECT_EQ(made.plan.pdos[0].inhibit, 100);  // half of 20 ms
  EXPECT_EQ(made.plan.pdos[0].event_ms, 200);
}

TEST(Links, NoPdoGetsACanIdOfAPlannedChannel) {
  auto network = two_controllers();
  add_link(network, "press/speed", {"belt/speed"}, 20ms, 255, od::DataType::unsigned16);
  ASSERT_EQ(make_plan(network).plan.pdos.at(0).can_id, 0x181);
  network.buses.front().channels = {0x181};
  EXPECT_NE(make_plan(network).plan.pdos.at(0).can_id, 0x181);
}

// S5.5, S5.6, S5.9: each type has a segment for each direction; the image's place follows from PPOffset.
TEST(Links, S5_5_S5_6_S5_9_VariablesStandInTheSegmentOfTheirType) {
  auto network = two_controllers();
  using enum od::DataType;
  const std::vector<std::pair<od::DataType, unsigned>> types{
      {integer8, 0xA000},   {unsigned8, 0xA040},  {boolean, 0xA080},    {integer16, 0xA0C0},  {unsigned16, 0xA100},
      {integer24, 0xA140},  {unsigned24, 0xA180}, {integer32, 0xA1C0},  {unsigned32, 0xA200}, {real32, 0xA240},
      {unsigned40, 0xA280}, {integer40, 0xA2C0},  {unsigned48, 0xA300}, {integer48, 0xA340},  {unsigned56, 0xA380},
      {integer56, 0xA3C0},  {integer64, 0xA400},  {unsigned64, 0xA440}};
  ASSERT_EQ(types.size(), 18U);
  for (std::size_t i = 0; i < types.size(); ++i) {
    for (const char letter : {'a', 'b'}) {
      const auto name = std::string(1, letter) + std::to_string(i);
      add_link(network, "press/" + name, {"belt/" + name}, {}, 255, types[i].first);
    }
  }
  const auto made = make_plan(network);
  ASSERT_TRUE(made.good()) << findings(made);
  expect_linked(network, made.plan);
  for (const auto& [type, index] : types) {
    for (const auto& each : made.plan.variables) {
      if (each.type != type) continue;
      EXPECT_EQ(each.object.index, each.input ? index : index + 0x480);
      const auto second = each.name.front() == 'b';
      EXPECT_EQ(each.object.sub, second ? 2 : 1);
      EXPECT_EQ(each.offset % 0x2000, second ? od::byte_size(type) : 0U);
    }
  }
  EXPECT_EQ(made.plan.variables.size(), 4 * types.size());
}

TEST(Links, ASegmentGoesOnInItsNextIndex) {
  auto network = two_controllers();
  for (unsigned i = 0; i < 300; ++i) {
    add_link(network, "press/v" + std::to_string(1000 + i), {"belt/v" + std::to_string(1000 + i)}, 1s, 255,
             od::DataType::unsigned8);
  }
  const auto made = make_plan(network);
  ASSERT_TRUE(made.good()) << findings(made);
  EXPECT_EQ(made.plan.variables[253].object, (ObjectRef{0xA040, 254}));
  EXPECT_EQ(made.plan.variables[254].object, (ObjectRef{0xA041, 1}));
  EXPECT_EQ(made.plan.variables[254].offset, made.plan.variables[0].offset + 254U);
  expect_linked(network, made.plan);
}

TEST(Links, AConsumerOfAPartSkipsTheRestByDummies) {
  auto spec = controller();
  spec.tpdos = 1;
  const auto small = file_of(spec);
  const auto plc = file_of(controller());
  auto network = network_of({{"press", small}, {"belt", plc}, {"lift", plc}});
  add_link(network, "press/a", {"belt/a"}, 20ms, 255, od::DataType::unsigned16);
  add_link(network, "press/b", {"lift/b"}, 20ms, 255, od::DataType::unsigned32);
  add_link(network, "press/c", {"belt/c", "lift/c"}, 500ms, 255, od::DataType::unsigned8);
  const auto made = make_plan(network);
  ASSERT_TRUE(made.good()) << findings(made);
  ASSERT_EQ(made.plan.pdos.size(), 1U);
  expect_linked(network, made.plan);
  const auto dummies = [&](const linker::Receiver& each) {
    return std::ranges::count_if(each.mapping, [](const auto& entry) { return entry.object.index < 0x20; });
  };
  EXPECT_EQ(dummies(made.plan.pdos[0].receivers[0]), 1);  // 32 bits of b
  EXPECT_EQ(dummies(made.plan.pdos[0].receivers[1]), 1);  // 16 bits of a
  // Without dummies at the consumers the links cannot share the one PDO.
  auto none = controller();
  none.dummies = false;
  network.nodes[1].file = network.nodes[2].file = file_of(none);
  const auto refused = make_plan(network);
  EXPECT_FALSE(refused.good());
  EXPECT_NE(findings(refused).find("no PDO is free for it: press has 1 TPDOs for links"), std::string::npos)
      << findings(refused);
}

TEST(Links, AnMpdoCarriesWhatNoOtherPdoCan) {
  auto spec = controller();
  spec.tpdos = 2;
  spec.mpdo = 20;
  const auto small = file_of(spec);
  auto network = network_of({{"press", small}, {"belt", small}});
  for (unsigned i = 0; i < 5; ++i) {
    const auto name = "v" + std::to_string(i);
    add_link(network, "press/" + name, {"belt/" + name}, i == 0 ? 50ms : 2000ms, 255, od::DataType::unsigned32);
  }
  const auto made = make_plan(network);
  ASSERT_TRUE(made.good()) << findings(made);
  ASSERT_EQ(made.plan.pdos.size(), 2U);
  EXPECT_FALSE(made.plan.pdos[0].mpdo);
  EXPECT_TRUE(made.plan.pdos[1].mpdo);
  expect_linked(network, made.plan);
}

TEST(Links, ADeviceWithFixedMappingsSendsWhatItSends) {
  auto spec = io_module();
  spec.fixed = true;
  spec.mapping = "60000108 60000208 64010110";
  const auto plc = file_of(controller());
  auto network = network_of({{"sensor", file_of(spec)}, {"press", plc}, {"belt", plc}});
  add_link(network, "sensor/6000h:02", {"press/in"}, 50ms);
  add_link(network, "sensor/6401h:01", {"belt/level"}, 50ms);
  const auto made = make_plan(network);
  ASSERT_TRUE(made.good()) << findings(made);
  ASSERT_EQ(made.plan.pdos.size(), 1U);
  expect_linked(network, made.plan);
  add_link(network, "sensor/6401h:02", {"belt/other"}, 50ms);
  EXPECT_NE(findings(make_plan(network)).find("the TPDO mappings of sensor are fixed, and none carries 6401h:02"),
            std::string::npos);
}

TEST(Links, SynchronousLinksWaitForSync) {
  auto network = two_controllers();
  network.buses[0].sync = 10ms;
  network.buses[0].others.messages.push_back({.name = "SYNC", .key = 0x80, .data_bytes = 0, .period = 10ms});
  add_link(network, "press/a", {"belt/a"}, 50ms, 3, od::DataType::unsigned16);
  add_link(network, "press/b", {"belt/b"}, 20ms, 255, od::DataType::unsigned16);
  const auto made = make_plan(network);
  ASSERT_TRUE(made.good()) << findings(made);
  ASSERT_EQ(made.plan.pdos.size(), 2U);
  EXPECT_EQ(made.plan.pdos[1].transmission, 3);
  EXPECT_EQ(made.plan.pdos[1].receivers[0].transmission, 3);
  // Up to three periods to its SYNC, one more to the consumer's, which waits for a frame that has begun: 190 bits.
  EXPECT_GT(made.plan.pdos[1].worst, 40ms);
  EXPECT_LE(made.plan.pdos[1].worst, 40ms + 190 * 2us);
  expect_linked(network, made.plan);
  network.links[0].deadline = 40ms;
  EXPECT_NE(findings(make_plan(network)).find("it can take 40."), std::string::npos) << "SYNC may be late";
  network.links[0].deadline = 40ms + 190 * 2us;
  EXPECT_EQ(findings(make_plan(network)), "") << "just kept";
  EXPECT_TRUE(make_plan(network).good());
  network.links[0].deadline = 39ms;
  EXPECT_NE(
      findings(make_plan(network)).find("SYNC on field is every 10 ms: this link takes 40 ms, its deadline is 39 ms"),
      std::string::npos);
  network.buses[0].sync = 0ms;
  EXPECT_NE(findings(make_plan(network)).find("nothing on field produces SYNC"), std::string::npos);
}

TEST(Links, PdosOfAConfigurationStay) {
  auto reading = eds::read(eds_text(io_module()), "io");
  reading.file.parameters = {{{0x1800, 1}, od::DataType::unsigned32, od::Literal::number(0x182)},
                             {{0x1A00, 0}, od::DataType::unsigned8, od::Literal::number(0)}};
  const auto plc = file_of(controller());
  auto network = network_of({{"press", plc}, {"io", std::make_shared<const eds::File>(std::move(reading.file))}});
  add_link(network, "io/6000h:01", {"press/in"});
  const auto made = make_plan(network);
  ASSERT_TRUE(made.good()) << findings(made);
  EXPECT_EQ(made.plan.pdos[0].tpdo, 2);
  EXPECT_EQ(made.plan.pdos[0].can_id, 0x282);
  for (const auto& each : linker::settings_of(network, made.plan, 1)) {
    EXPECT_NE(each.object.index, 0x1800) << "what its configuration says is left alone";
  }
}

// TPDO 1 has the CAN-ID that TPDO 2 has in the predefined connection set.
TEST(Links, TheCanIdOfAConfiguredPdoIsNotGivenAgain) {
  std::string text = eds_text(io_module());
  const std::string cob_id = "[1800sub1]\n";
  const auto at = text.find(cob_id);
  ASSERT_NE(at, std::string::npos);
  text.insert(at + cob_id.size(), "ParameterValue=0x282\n");
  auto reading = eds::read(text, "io");
  ASSERT_EQ(reading.file.parameters.size(), 1U);
  auto network = network_of(
      {{"press", file_of(controller())}, {"io", std::make_shared<const eds::File>(std::move(reading.file))}});
  add_link(network, "io/6000h:01", {"press/in"});
  const auto made = make_plan(network);
  ASSERT_TRUE(made.good()) << findings(made);
  EXPECT_EQ(made.plan.pdos[0].tpdo, 2);
  EXPECT_NE(made.plan.pdos[0].can_id, 0x282);
}

// A machine of the size of the coal conveyor (paper 5, fig. 1).
TEST(Links, S5_21_TheConveyorIsLinked) {
  const auto network = conveyor();
  EXPECT_EQ(network.nodes.size(), 55U);
  EXPECT_GT(network.links.size(), 500U);
  const auto made = make_plan(network);
  ASSERT_TRUE(made.good()) << findings(made);
  EXPECT_EQ(made.plan.variables.size(), 280U);
  expect_linked(network, made.plan);
  for (const auto& pdo : made.plan.pdos) {
    EXPECT_LE(pdo.worst, pdo.deadline);
    if (pdo.tpdo <= 4) {
      EXPECT_EQ(pdo.can_id, 0x80 + 0x100 * pdo.tpdo + network.nodes[pdo.producer].id.value());
    }
  }
}

RC_GTEST_PROP(LinksProperty, TheDcfsSayWhatTheLinksSay, ()) {
  Random random(*rc::gen::arbitrary<std::uint64_t>());
  const auto network = random_network(random, *rc::gen::inRange(1U, 60U));
  const auto made = make_plan(network);
  if (!made.good()) RC_DISCARD("no room");
  const auto files = linker::make_files(network, made.plan);
  RC_ASSERT(files.has_value());
  std::vector<Dcf> all;
  for (const auto& file : *files) {
    if (file.name.ends_with(".dcf")) all.emplace_back(file.bytes);
  }
  const auto judged = judge(all);
  RC_ASSERT(judged.wrong.empty());
  RC_ASSERT(judged.flow == wanted(network, all));
}

TEST(LinkFiles, TheConciseDcfBringsTheSameValues) {
  auto network = two_controllers();
  add_link(network, "press/speed", {"belt/speed"}, 20ms, 255, od::DataType::unsigned16);
  const auto made = make_plan(network);
  ASSERT_TRUE(made.good());
  const auto files = linker::make_files(network, made.plan);
  ASSERT_TRUE(files);
  const auto bytes = [&](const std::string& name) {
    return std::ranges::find(*files, name, &linker::MadeFile::name)->bytes;
  };
  const Dcf dcf(bytes("belt.dcf"));
  const std::string stream = bytes("belt.cdcf");
  std::map<ObjectRef, std::vector<std::uint8_t>> last;
  const auto decoded = eds::decode_concise_dcf(std::vector<std::uint8_t>(stream.begin(), stream.end()));
  ASSERT_TRUE(decoded);
  for (const auto& entry : decoded->entries) last[entry.object] = entry.data;
  EXPECT_EQ(last.at({0x1400, 1}), (std::vector<std::uint8_t>{0x81, 0x01, 0, 0}));
  EXPECT_EQ(last.at({0x1600, 0}), std::vector<std::uint8_t>{1});
  EXPECT_EQ(last.at({0x1600, 1}), (std::vector<std::uint8_t>{0x10, 0x01, 0x80, 0xA5}));
  EXPECT_EQ(last.at({0x1800, 1}).back() & 0x80, 0x80) << "it sends nothing";
  for (const auto& [object, value] : last) {
    unsigned long long number = 0;
    for (std::size_t i = 0; i < value.size(); ++i) number |= static_cast<unsigned long long>(value[i]) << (8 * i);
    EXPECT_EQ(number, dcf.value(object.index, object.sub)) << object.index;
  }
  EXPECT_EQ(dcf.commissioned("NodeName"), "belt");
  EXPECT_EQ(dcf.commissioned("Baudrate"), "500");
  EXPECT_TRUE(dcf.listed().contains(0xA580));
}

TEST(LinkFiles, TheProjectNamesEachDeviceAndItsDcf) {
  auto network = two_controllers();
  network.nodes[1].name = "belt 2";
  network.nodes[2].name = "belt_2";
  add_link(network, "press/speed", {"belt 2/speed"}, 20ms, 255, od::DataType::unsigned16);
  const auto made = make_plan(network);
  const auto files = linker::make_files(network, made.plan);
  ASSERT_TRUE(files);
  const auto cpj = std::ranges::find(*files, "network.cpj", &linker::MadeFile::name);
  ASSERT_NE(cpj, files->end());
  const auto reading = eds::read_cpj(cpj->bytes, "network.cpj");
  ASSERT_TRUE(reading.usable());
  ASSERT_EQ(reading.project.topologies.size(), 1U);
  const auto& nodes = reading.project.topologies[0].nodes;
  ASSERT_EQ(nodes.size(), 3U);
  EXPECT_EQ(nodes[0].dcf_name, "press.dcf");
  EXPECT_EQ(nodes[1].dcf_name, "belt_2-1-2.dcf") << "two slots whose file names would be equal";
  EXPECT_EQ(nodes[2].dcf_name, "") << "no link leads there";
  for (const auto& node : nodes) {
    if (node.dcf_name.empty()) continue;
    EXPECT_NE(std::ranges::find(*files, node.dcf_name, &linker::MadeFile::name), files->end());
  }
}

TEST(LinkFiles, WhatTheLinkerWroteIsItsOwn) {
  auto network = two_controllers();
  add_link(network, "press/speed", {"belt/speed"}, 20ms, 255, od::DataType::unsigned16);
  add_link(network, "press/count", {"belt/count"}, 20ms, 255, od::DataType::unsigned32);
  const auto first = make_plan(network);
  const auto files = linker::make_files(network, first.plan);
  ASSERT_TRUE(files);
  // Its DCFs become the slots' configurations; then a link goes.
  for (const auto& file : *files) {
    if (!file.name.ends_with(".dcf")) continue;
    auto reading = eds::read(file.bytes, file.name);
    ASSERT_TRUE(reading.usable());
    EXPECT_TRUE(linker::written_by_linker(reading.file));
    auto& node = *std::ranges::find(network.nodes, file.name.substr(0, file.name.size() - 4), &linker::Node::name);
    node.file = std::make_shared<const eds::File>(std::move(reading.file));
    node.linked_before = true;
  }
  const auto again = make_plan(network, linker::earlier_of(network, first.plan));
  ASSERT_TRUE(again.good()) << findings(again);
  EXPECT_TRUE(again.plan == first.plan);
  const auto same = linker::make_files(network, again.plan);
  ASSERT_TRUE(same);
  for (std::size_t i = 0; i < same->size(); ++i) EXPECT_TRUE((*same)[i].bytes == (*files)[i].bytes) << (*same)[i].name;
  network.links.erase(network.links.begin());
  const auto fewer = make_plan(network, linker::earlier_of(network, first.plan));
  ASSERT_TRUE(fewer.good()) << findings(fewer);
  expect_linked(network, fewer.plan);
  const auto all = dcfs(network, fewer.plan);
  EXPECT_EQ(of(all, network, 0).named("speed"), 0U) << "the variable is gone";
  EXPECT_FALSE(of(all, network, 0).listed().contains(0xA100));
}

// The predefined connection set puts the CAN-IDs of low node-IDs first; where that makes a tight deadline missed, new
// PDOs take theirs in the order of deadlines.
TEST(Links, TightDeadlinesBeforeThePredefinedConnectionSet) {
  const auto plc = file_of(controller());
  auto network = network_of({{"a", plc}, {"b", plc}, {"c", plc}, {"d", plc}, {"e", plc}, {"tight", plc}, {"all", plc}});
  network.buses[0].others.bit_rate = 50'000;
  for (const char* const name : {"a", "b", "c", "d", "e"}) {
    add_link(network, name + std::string("/v"), {std::string("all/") + name}, 1s, 255, od::DataType::unsigned64);
  }
  add_link(network, "tight/v", {"all/tight"}, 1s, 255, od::DataType::unsigned64);
  const auto predefined = make_plan(network);
  ASSERT_TRUE(predefined.good()) << findings(predefined);
  for (const auto& pdo : predefined.plan.pdos) EXPECT_EQ(pdo.can_id, 0x180 + network.nodes[pdo.producer].id.value());
  network.links.back().deadline = 20ms;
  const auto made = make_plan(network);
  ASSERT_TRUE(made.good()) << findings(made);
  EXPECT_EQ(made.plan.pdos.back().can_id, 0x181);
  expect_linked(network, made.plan);
}
