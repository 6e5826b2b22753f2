// S5.9: the process image of a programmable device, from what the linker made: by the DCF and by the plan it is the
// same, each variable at PPOffset of its segment, and what an RPDO of the plan brings is in the image.
#include "berth/linker/process_variables.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cstring>
#include <map>

#include "berth/device/device.hpp"
#include "berth/eds/eds.hpp"
#include "berth/linker/files.hpp"
#include "berth/process/load.hpp"
#include "berth/sim/world.hpp"
#include "tests/linker/devices.hpp"

using namespace berth;
using namespace berth::test;

namespace {

std::vector<linker::MadeFile> files_of(const linker::LinkNetwork& network, const linker::Plan& plan) {
  auto files = linker::make_files(network, plan);
  EXPECT_TRUE(files) << files.error();
  return std::move(*files);
}

eds::File dcf_of(const std::vector<linker::MadeFile>& files, const linker::LinkNetwork& network, std::size_t node) {
  const auto name = linker::file_stem(network, node) + ".dcf";
  const auto it = std::ranges::find(files, name, &linker::MadeFile::name);
  EXPECT_NE(it, files.end()) << name;
  auto read = eds::read(it->bytes, name);
  EXPECT_TRUE(read.usable());
  return std::move(read.file);
}

struct Place {
  od::DataType type = od::DataType::none;
  process::Direction direction = process::Direction::output;
  std::uint32_t offset = 0;
  ObjectRef object;
  friend bool operator==(const Place&, const Place&) = default;
};

std::map<std::string, Place> places_of(const process::Program& program) {
  std::map<std::string, Place> places;
  for (const auto& bound : program.bound) {
    const auto* const variable = program.layout.find(bound.variable);
    if (variable == nullptr) {
      ADD_FAILURE() << bound.variable;
      continue;
    }
    places[bound.variable] = {variable->type, variable->direction, variable->offset, bound.object};
  }
  EXPECT_EQ(places.size(), program.layout.variables().size());
  return places;
}

}  // namespace

TEST(ProcessVariables, S5_9_ByTheDcfAndByThePlanTheImageIsTheSame) {
  const auto network = conveyor();
  const auto made = linker::make_plan(network);
  const auto earlier = linker::earlier_of(network, made.plan);
  const auto files = files_of(network, made.plan);
  std::size_t variables = 0;
  for (std::size_t node = 0; node < network.nodes.size(); ++node) {
    if (network.nodes[node].file->dynamic_segments.empty()) continue;
    const auto by_dcf = process::load(dcf_of(files, network, node));
    const auto by_plan =
        process::load(*network.nodes[node].file, linker::variables_of(earlier, network.nodes[node].name));
    EXPECT_TRUE(by_dcf.problems.empty() && by_plan.problems.empty());
    const auto places = places_of(by_dcf);
    EXPECT_EQ(places, places_of(by_plan)) << network.nodes[node].name;
    for (const auto& wanted : made.plan.variables) {
      if (wanted.node != node) continue;
      ++variables;
      const Place place{wanted.type, wanted.input ? process::Direction::input : process::Direction::output,
                        wanted.offset, wanted.object};
      const auto found = places.find(wanted.name);
      ASSERT_NE(found, places.end()) << wanted.name;
      EXPECT_EQ(found->second, place) << wanted.name;
    }
  }
  EXPECT_EQ(variables, made.plan.variables.size());
  EXPECT_EQ(variables, 280U) << "paper 5, figure 1";
}

TEST(ProcessVariables, WhatAnRpdoOfThePlanBringsIsInTheImage) {
  const auto network = conveyor();
  const auto made = linker::make_plan(network);
  std::size_t node = 0;
  while (network.nodes[node].file->dynamic_segments.empty()) ++node;
  const auto program = process::load(dcf_of(files_of(network, made.plan), network, node));
  sim::World world;
  sim::Bus& bus = world.add_bus("b", 500'000);
  const auto port = bus.attach();
  const auto master = bus.attach();
  can::Dispatcher dispatcher(world.executor(), *port);
  device::Device device(dispatcher, program.description, nullptr,
                        {.source = device::NodeIdSource::fixed, .node_id = network.nodes[node].id});
  process::Image image(program.layout);
  process::DeviceImage link(device, world.executor(), image.network(), program.bound, {});
  EXPECT_TRUE(link.problems().empty());
  device.power_on();
  world.run_for(std::chrono::milliseconds(10));
  device.apply(co::NmtCommand::start);
  world.run_for(std::chrono::milliseconds(10));

  const auto places = places_of(program);
  std::size_t seen = 0;
  for (const auto& pdo : made.plan.pdos) {
    for (const auto& receiver : pdo.receivers) {
      if (receiver.node != node || pdo.mpdo) continue;
      const std::array<std::uint8_t, 8> bytes{0x11, 0x22, 0x33, 0x44, 0x55, 0x66, 0x77, 0x88};
      unsigned bits = 0;
      for (const auto& each : pdo.carried) bits = std::max<unsigned>(bits, each.at + each.bits);
      master->send(can::Frame::base(pdo.can_id, std::span(bytes).first((bits + 7) / 8)), 0);
      world.run_for(std::chrono::milliseconds(2));
      ASSERT_TRUE(image.application().refresh());
      for (const auto& received : receiver.received) {
        const auto& carried = pdo.carried[received.carried];
        if (carried.bits % 8 != 0) continue;
        const auto place =
            std::ranges::find(places, received.object, [](const auto& each) { return each.second.object; });
        ASSERT_NE(place, places.end());
        EXPECT_EQ(std::memcmp(image.application().outputs().data() + place->second.offset,
                              bytes.data() + carried.at / 8, carried.bits / 8),
                  0)
            << place->first;
        const auto number = program.layout.find(place->first)->number;
        EXPECT_EQ(image.application().validity_of(number), BERTH_GOOD) << place->first;
        ++seen;
      }
    }
  }
  EXPECT_GT(seen, 10U);
}

// An object that is no variable: by its access, or as the file's own PDOs map it; what cannot be mapped has no place.
TEST(ProcessVariables, OtherObjectsStandBehindThemByTheirNotation) {
  auto spec = controller();
  spec.objects = {{.index = 0x2100, .subs = 2, .type = 5, .access = "rww", .name = "In"},
                  {.index = 0x2200, .subs = 1, .type = 6, .access = "rwr", .name = "Out"},
                  {.index = 0x2300, .subs = 1, .type = 7, .access = "rw", .name = "Mapped"},
                  {.index = 0x2301, .subs = 1, .type = 7, .access = "rw", .name = "Not mapped"},
                  {.index = 0x2400, .subs = 1, .type = 7, .access = "rww", .name = "Not mappable", .mappable = false}};
  spec.mapping = "23000120";
  const auto file = file_of(spec);
  const std::vector<process::NetworkVariable> variables{{"speed", od::DataType::unsigned16, {0xA100, 3}}};
  const auto program = process::load(*file, variables);
  EXPECT_TRUE(program.problems.empty());
  const auto places = places_of(program);
  std::vector<std::string> names;
  for (const auto& [name, place] : places) names.push_back(name);
  EXPECT_EQ(names, (std::vector<std::string>{"2100h:01", "2100h:02", "2200h:01", "2300h:01", "speed"}));
  EXPECT_EQ(places.at("2100h:02").direction, process::Direction::output);
  EXPECT_EQ(places.at("2200h:01").direction, process::Direction::input);
  EXPECT_EQ(places.at("2300h:01").direction, process::Direction::input) << "its TPDO 1 maps it";
  EXPECT_EQ(places.at("speed").offset, 0x8000U + 2 * 2);
}

TEST(ProcessVariables, AVariableWithoutAPlaceIsTold) {
  const auto file = file_of(controller());
  const std::vector<process::NetworkVariable> variables{{"a", od::DataType::unsigned16, {0x2000, 1}},
                                                        {"b", od::DataType::unsigned8, {0xA100, 1}}};
  const auto program = process::load(*file, variables);
  EXPECT_EQ(program.problems,
            (std::vector<std::string>{
                "\"a\": 2000h:01 lies in no segment of its description's [DynamicChannels]; `berth link --links` says "
                "where the linker puts it",
                "\"b\": A100h:01 is in a segment of UNSIGNED16, not of UNSIGNED8; `berth link --links` says where the "
                "linker puts it"}));
}
