// What a host's command asks of Berth.
#include "berth/fleet/commands.hpp"

#include <gtest/gtest.h>

namespace berth::fleet {
namespace {

using sparkplug::Command;
using sparkplug::Value;

design::Machine machine() {
  auto read = design::read_machine(
      "[machine]\nname = \"m\"\n[bus.field]\nport = \"sim\"\nbitrate = 250_000\n[[slot]]\nbus = \"field\"\nid = 5\n"
      "name = \"left\"\ntype = { vendor = 1, product = 2 }\n",
      "m.toml", {});
  return std::move(*read.machine);
}

std::vector<Signal> signals() {
  Signal marked;
  marked.metric = "Signals/Speed";
  marked.object = {0x6042, 0};
  marked.type = od::DataType::integer16;
  marked.type_is_described = true;
  marked.wanted.writable = true;
  Signal other = marked;
  other.metric = "Signals/Position";
  other.wanted.writable = false;
  return {marked, other};
}

command::Request asked(const std::string& device, const std::string& metric, Value value) {
  const auto request = request_of({device, metric, std::move(value), {}}, machine(), signals());
  EXPECT_TRUE(request) << request.error();
  return request ? request->request : command::Request{};
}
bool refused(const std::string& device, const std::string& metric, Value value) {
  return !request_of({device, metric, std::move(value), {}}, machine(), signals());
}

}  // namespace

TEST(FleetCommands, AreRequestsAsOnTheCommandLine) {
  EXPECT_EQ(asked("", "Commands/Replace/left", std::string()), (command::Request{"replace", {{"slot", "field/left"}}}));
  EXPECT_EQ(asked("", "Commands/Replace/left", std::string("00000001-00000002-00000003-00000004")),
            (command::Request{"replace", {{"slot", "field/left"}, {"device", "00000001-00000002-00000003-00000004"}}}));
  EXPECT_EQ(asked("", "Commands/NMT/field", std::string("stop")),
            (command::Request{"nmt", {{"bus", "field"}, {"command", "stop"}, {"node", "all"}}}));
  EXPECT_EQ(asked("left", "Commands/NMT", std::string("start")),
            (command::Request{"nmt", {{"command", "start"}, {"node", "field/left"}}}));
  EXPECT_EQ(asked("left", "Commands/Locate", std::uint64_t{9}),
            (command::Request{"locate", {{"seconds", "9"}, {"target", "field/left"}}}));
  EXPECT_EQ(asked("left", "Signals/Speed", std::int64_t{-300}),
            (command::Request{"sdo write", {{"node", "field/left"}, {"object", "6042h:00"}, {"value", "-300"}}}));
}

TEST(FleetCommands, WhatIsNoneIsRefused) {
  EXPECT_TRUE(refused("left", "Signals/Position", std::int64_t{1})) << "it is not marked writable";
  EXPECT_TRUE(refused("right", "Commands/NMT", std::string("start")));
  EXPECT_TRUE(refused("", "Commands/Replace/right", std::string()));
  EXPECT_TRUE(refused("", "Machine/Operational", true));
  EXPECT_TRUE(refused("left", "Commands/NMT", std::uint64_t{1}));
  EXPECT_TRUE(refused("left", "Commands/NMT", std::string(1000, 'x')));
  EXPECT_TRUE(refused("left", "Commands/Locate", std::string("10")));
}

// No request that a host can cause carries what only a person may give.
TEST(FleetCommands, NeverConfirm) {
  for (const std::string value : {"yes", "start yes=1", "start\nyes\n1"}) {
    const auto request = asked("left", "Commands/NMT", value);
    EXPECT_FALSE(request.arguments.contains("yes"));
    EXPECT_EQ(request.arguments.at("command"), value);
  }
}

TEST(FleetCommands, AreMetricsAsFarAsTheyAreAllowed) {
  EXPECT_TRUE(node_commands(machine(), {}, {}).empty());
  EXPECT_TRUE(device_commands({}, {}).empty());
  const auto node = node_commands(machine(), {{"replace", "nmt"}}, {});
  ASSERT_EQ(node.size(), 2U);
  EXPECT_EQ(node[0].name, "Commands/Replace/left");
  EXPECT_EQ(node[1].name, "Commands/NMT/field");
  EXPECT_TRUE(node[0].writable && node[1].writable);
  const auto device = device_commands({{"locate"}}, {});
  ASSERT_EQ(device.size(), 1U);
  EXPECT_EQ(device[0].name, "Commands/Locate");
}

// Names and values come from outside.
TEST(FleetCommands, TheRowOfAnEndIsText) {
  const auto value = end_of("left", "a\nb\xFF", std::string(500, 'x'), "why\x1b[31m", {7});
  const auto& set = *std::get<sparkplug::Boxed<sparkplug::DataSet>>(value);
  ASSERT_EQ(set.rows.size(), 1U);
  EXPECT_TRUE(sparkplug::fits(sparkplug::DataType::data_set, value));
  for (const auto& cell : set.rows[0]) {
    const auto* const text = std::get_if<std::string>(&cell);
    if (text == nullptr) continue;
    EXPECT_TRUE(sparkplug::is_utf8(*text));
    EXPECT_EQ(text->find_first_of("\n\x1b"), std::string::npos) << *text;
    EXPECT_LT(text->size(), 250U);
  }
  EXPECT_EQ(set.rows[0][0], Value(std::uint64_t{7}));
}

}  // namespace berth::fleet
