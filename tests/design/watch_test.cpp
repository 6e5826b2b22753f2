// What a slot says of how its device is watched: keys, ranges, and what excludes each other.
#include <gtest/gtest.h>
#include <string>

#include "berth/design/machine.hpp"

using namespace berth;
using namespace std::chrono_literals;
using places::SlotWatch;

namespace watch_tests {
namespace {

design::MachineResult read(const std::string& keys, const std::string& port = "sim") {
  const std::string gateway =
      port == "gateway"
          ? "[bus.above]\nport = \"sim\"\nbitrate = 125000\n[[slot]]\nbus = \"above\"\nid = 1\nname = \"g\"\n"
            "type = { vendor = 1, product = 2 }\n"
          : "";
  const std::string beneath =
      port == "gateway" ? "master_id = 1\ngateway = { bus = \"above\", slot = 1, port = 1 }\n" : "";
  return design::read_machine("[machine]\nname = \"m\"\n" + gateway + "[bus.field]\nport = \"" + port +
                                  "\"\nbitrate = 125000\n" + beneath +
                                  "[[slot]]\nbus = \"field\"\nid = 5\nname = \"d\"\n"
                                  "type = { vendor = 1, product = 1 }\n" +
                                  keys,
                              "m.toml", {});
}

std::string said(const std::string& keys, const std::string& port = "sim") {
  std::string all;
  for (const auto& f : read(keys, port).findings) all += to_string(f) + "\n";
  return all;
}

SlotWatch watch_of(const std::string& keys) {
  const auto result = read(keys);
  EXPECT_TRUE(result.machine) << said(keys);
  return result.machine ? result.machine->slots.back().spec.watch : SlotWatch{};
}

}  // namespace

TEST(SlotWatch, WhatIsLeftOutIsTheBuss) { EXPECT_EQ(watch_of(""), SlotWatch{}); }

TEST(SlotWatch, EachKeyIsRead) {
  EXPECT_EQ(watch_of("heartbeat_period = \"2 s\"\nheartbeat_timeout = \"7 s\"\nsdo_timeout = \"900 ms\"\n"),
            (SlotWatch{.heartbeat_period = 2s, .heartbeat_timeout = 7s, .sdo_timeout = 900ms}));
  EXPECT_EQ(watch_of("error_control = \"guarding\"\nguard_time = \"200 ms\"\nlife_time_factor = 5\n"),
            (SlotWatch{.by = SlotWatch::By::guarding, .guard_time = 200ms, .life_time_factor = 5}));
  EXPECT_EQ(watch_of("error_control = \"none\"\n").by, SlotWatch::By::none);
  EXPECT_EQ(watch_of("error_control = \"heartbeat\"\n").by, SlotWatch::By::heartbeat);
  EXPECT_EQ(watch_of("guard_time = \"200 ms\"\n").by, SlotWatch::By::guarding) << "who writes it wants guarding";
}

TEST(SlotWatch, WhatCannotBeIsRefusedAtItsPlace) {
  const auto is = [](const std::string& keys, const char* begin, const char* part) {
    const auto text = said(keys);
    EXPECT_EQ(text.find(begin), 0U) << text;
    EXPECT_NE(text.find(part), std::string::npos) << text;
  };
  is("heartbeat_period = \"2 s\"\nheartbeat_timeout = \"1 s\"\n",
     "m.toml:12:21: error: slot[1].heartbeat_timeout:", "is not longer than the period");
  is("heartbeat_period = \"1.5 ms\"\n", "m.toml:11:20: error: slot[1].heartbeat_period:", "whole milliseconds");
  is("guard_time = \"70 s\"\n", "m.toml:11:14: error: slot[1].guard_time:", "65535 ms");
  is("life_time_factor = 256\n", "m.toml:11:20: error: slot[1].life_time_factor:", "255");
  is("error_control = \"never\"\n", "m.toml:11:17: error: slot[1].error_control:", "none");
  is("error_control = \"none\"\nheartbeat_period = \"1 s\"\n",
     "m.toml:12:20: error: slot[1].heartbeat_period:", "no heartbeat watches this slot");
  is("error_control = \"heartbeat\"\nguard_time = \"1 s\"\n",
     "m.toml:12:14: error: slot[1].guard_time:", "no guarding watches this slot");
  is("heartbeat_period = \"1 s\"\nguard_time = \"1 s\"\n", "m.toml:12:14: error: slot[1].guard_time:", "not both");
}

// Its own master watches it, and knows one period for all.
TEST(SlotWatch, BeneathAGatewayThereIsTheBussTimingAlone) {
  EXPECT_EQ(said("", "gateway"), "");
  for (const char* const key : {"error_control = \"none\"\n", "guard_time = \"1 s\"\n", "sdo_timeout = \"1 s\"\n"}) {
    EXPECT_NE(said(key, "gateway").find("the gateway's own master watches this device"), std::string::npos) << key;
  }
}

}  // namespace watch_tests
