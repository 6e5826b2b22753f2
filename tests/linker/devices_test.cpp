// S5.4: devices with the DCFs that the linker wrote, on a simulated bus: a variable that one program writes is what
// the others read.
#include <gtest/gtest.h>

#include <algorithm>
#include <map>

#include "berth/eds/eds.hpp"
#include "berth/linker/files.hpp"
#include "tests/device/rig.hpp"
#include "tests/linker/devices.hpp"

using namespace berth;
using namespace berth::test;
using namespace std::chrono_literals;

namespace {

/// The devices of a plan, running.
class Plant {
 public:
  Plant(const linker::LinkNetwork& network, const linker::Plan& plan) : network_(network) {
    const auto files = linker::make_files(network, plan);
    for (std::size_t i = 0; files && i < network.nodes.size(); ++i) {
      const auto file = std::ranges::find(*files, linker::file_stem(network, i) + ".dcf", &linker::MadeFile::name);
      if (file == files->end()) continue;
      auto reading = eds::read(file->bytes, file->name);
      EXPECT_TRUE(reading.usable()) << file->name;
      device::Options options{.address = device::test::address_of(static_cast<std::uint32_t>(i + 1)),
                              .node_id = network.nodes[i].id,
                              .bit_rate = 500'000};
      nodes_[i] = std::make_unique<device::test::Node>(rig_.world, rig_.bus, std::move(options), device::Timing{},
                                                       rt::Duration(0), reading.file.description);
      nodes_[i]->on();
    }
    rig_.run(2ms);
    rig_.ask("000#0100");
  }

  /// The program of a device writes a variable.
  void set(std::size_t node, const linker::Variable& variable, std::uint64_t value) {
    auto& device = nodes_.at(node)->device;
    switch (od::byte_size(variable.type)) {
      case 1: device.variable<std::uint8_t>(variable.object).set(static_cast<std::uint8_t>(value)); break;
      case 2: device.variable<std::uint16_t>(variable.object).set(static_cast<std::uint16_t>(value)); break;
      default: device.variable<std::uint32_t>(variable.object).set(static_cast<std::uint32_t>(value)); break;
    }
  }
  [[nodiscard]] std::uint64_t get(std::size_t node, ObjectRef object) {
    const auto raw = nodes_.at(node)->device.values().bytes(object);
    std::uint64_t value = 0;
    for (std::size_t i = 0; i < raw.size(); ++i) value |= std::uint64_t{raw[i]} << (8 * i);
    return value;
  }
  void run(device::test::milliseconds time) { rig_.run(time); }

 private:
  const linker::LinkNetwork& network_;
  device::test::Rig rig_;
  std::map<std::size_t, std::unique_ptr<device::test::Node>> nodes_;
};

const linker::Variable& named(const linker::Plan& plan, std::size_t node, const std::string& name) {
  return *std::ranges::find_if(plan.variables, [&](const auto& v) { return v.node == node && v.name == name; });
}

/// Every program writes all its variables, again and again; after the deadlines every consumer has them.
void exchange(const linker::LinkNetwork& network, const linker::Plan& plan, Random& random) {
  Plant plant(network, plan);
  for (unsigned round = 0; round < 20; ++round) {
    std::map<const linker::Link*, std::uint64_t> values;
    for (const auto& link : network.links) {
      const auto& variable = named(plan, link.from.node, link.from.object);
      const auto value = random.next() & (~std::uint64_t{0} >> (64 - od::bit_length(variable.type)));
      values[&link] = value;
      plant.set(link.from.node, variable, value);
    }
    plant.run(device::test::milliseconds(500));
    for (const auto& link : network.links) {
      for (const auto& to : link.to) {
        EXPECT_EQ(plant.get(to.node, named(plan, to.node, to.object).object), values[&link]) << to.object;
      }
    }
  }
}

}  // namespace

TEST(LinkedDevices, S5_4_WhatOneProgramWritesTheOthersRead) {
  auto spec = controller();
  spec.tpdos = 2;  // so that consumers skip parts by dummies
  const auto small = file_of(spec);
  auto network = network_of({{"press", small}, {"belt", small}, {"lift", small}});
  Random random(7);
  const od::DataType types[] = {od::DataType::unsigned8, od::DataType::unsigned16, od::DataType::unsigned32};
  for (unsigned i = 0; i < 9; ++i) {
    const std::vector<std::string> names{"press", "belt", "lift"};
    const auto from = i % 3;
    const auto v = "v" + std::to_string(i);
    std::vector<std::string> to{names[(from + 1) % 3] + "/" + v};
    if (i % 2 == 0) to.push_back(names[(from + 2) % 3] + "/" + v);
    add_link(network, names[from] + "/" + v, to, i < 3 ? 20ms : 500ms, 255, types[random.below(3)]);
  }
  const auto made = linker::make_plan(network);
  ASSERT_TRUE(made.good());
  const bool skips = std::ranges::any_of(made.plan.pdos, [](const linker::Pdo& pdo) {
    return std::ranges::any_of(pdo.receivers, [](const linker::Receiver& each) {
      return std::ranges::any_of(each.mapping, [](const auto& entry) { return entry.object.index < 0x20; });
    });
  });
  EXPECT_TRUE(skips);
  exchange(network, made.plan, random);
}

// The longest deadline is 500 ms: an MPDO sends one value after the other.
TEST(LinkedDevices, WhatAnMpdoCarriesArrivesToo) {
  auto spec = controller();
  spec.tpdos = 2;
  spec.mpdo = 12;
  const auto small = file_of(spec);
  auto network = network_of({{"press", small}, {"belt", small}, {"lift", small}});
  for (unsigned i = 0; i < 7; ++i) {
    const auto v = "v" + std::to_string(i);
    add_link(network, "press/" + v, {i % 2 == 0 ? "belt/" + v : "lift/" + v}, i < 2 ? 50ms : 500ms, 255,
             od::DataType::unsigned32);
  }
  const auto made = linker::make_plan(network);
  ASSERT_TRUE(made.good());
  EXPECT_TRUE(std::ranges::any_of(made.plan.pdos, &linker::Pdo::mpdo));
  Random random(9);
  exchange(network, made.plan, random);
}
