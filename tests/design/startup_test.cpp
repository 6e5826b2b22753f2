// `[bus.NAME.startup]`, and the slots' keys that it needs: CiA 302-2's 1F80h, 1F81h, 1F84h, 1F89h and 102Ah in words.
#include <gtest/gtest.h>

#include <chrono>
#include <string>

#include "berth/design/machine.hpp"

namespace berth::design {
namespace {

using namespace std::chrono_literals;

std::string file(const std::string& startup, const std::string& slot_keys = "mandatory = true\n",
                 const std::string& role = "master") {
  return "[machine]\nname = \"m\"\n[bus.b]\nport = \"sim\"\nbitrate = 125_000\nrole = \"" + role + "\"\n" + startup +
         "[[slot]]\nbus = \"b\"\nid = 2\nname = \"left\"\ntype = { vendor = 1, product = 1 }\n" + slot_keys;
}

std::string wrong_keys(const std::string& text) {
  const auto result = read_machine(text, "m.toml", {});
  EXPECT_FALSE(result.machine) << text;
  std::string all;
  for (const auto& finding : result.findings) all += to_string(finding) + "\n";
  return all;
}

Machine good(const std::string& text) {
  auto result = read_machine(text, "m.toml", {});
  for (const auto& finding : result.findings) ADD_FAILURE() << to_string(finding);
  return result.machine ? *result.machine : Machine{};
}

std::uint32_t object_1f80(const std::string& keys) {
  return manager::value_of(good(file("[bus.b.startup]\n" + keys)).buses.at(0).startup.rules);
}

// The bits as CiA 302-2 numbers them.
TEST(StartupKeys, S5_12_AreTheBitsOf1F80h) {
  EXPECT_EQ(object_1f80(""), 0x01U);
  EXPECT_EQ(object_1f80("start = \"each\"\nmaster = \"automatic\"\non_error = \"device\"\n"), 0x01U);
  EXPECT_EQ(object_1f80("start = \"together\"\n"), 0x03U);
  EXPECT_EQ(object_1f80("start = \"by-hand\"\n"), 0x09U);
  EXPECT_EQ(object_1f80("master = \"by-hand\"\n"), 0x05U);
  EXPECT_EQ(object_1f80("on_error = \"reset-all\"\n"), 0x11U);
  EXPECT_EQ(object_1f80("on_error = \"stop-all\"\n"), 0x41U);
  EXPECT_EQ(object_1f80("start = \"together\"\nmaster = \"by-hand\"\non_error = \"stop-all\"\n"), 0x47U);
}

TEST(StartupKeys, WithoutTheTableEachDeviceIsStartedByItself) {
  const Machine m = good(file(""));
  EXPECT_EQ(manager::value_of(m.buses.at(0).startup.rules), 0x01U);
  EXPECT_EQ(m.buses.at(0).startup.boot_time, 0s);
  EXPECT_EQ(m.buses.at(0).startup.nmt_inhibit, 0s);
  EXPECT_TRUE(m.slots.at(0).spec.mandatory);
  EXPECT_EQ(m.slots.at(0).spec.device_type, 0U);
  EXPECT_FALSE(good(file("", "optional = true\n")).slots.at(0).spec.mandatory);
}

TEST(StartupKeys, TimesAndTheDeviceTypeAreRead) {
  const Machine m = good(file("[bus.b.startup]\nboot_time = \"20 s\"\nnmt_inhibit = \"0.3 ms\"\n",
                              "mandatory = true\ndevice_type = 0x0002_0192\n"));
  EXPECT_EQ(m.buses.at(0).startup.boot_time, 20s);
  EXPECT_EQ(m.buses.at(0).startup.nmt_inhibit, 300us);
  EXPECT_EQ(m.slots.at(0).spec.device_type, 0x0002'0192U);
}

TEST(StartupKeys, WhatCannotBeIsSaidWithItsPlace) {
  const auto says = [](const std::string& text, const std::string& words) {
    const std::string all = wrong_keys(text);
    EXPECT_NE(all.find(words), std::string::npos) << all;
  };
  const std::string table = "[bus.b.startup]\n";
  says(file("", "optional = true\nmandatory = true\n"),
       "m.toml:13:13: error: slot[1].mandatory: optional and mandatory");
  says(file(table + "start = \"togther\"\n"), "m.toml:8:9: error: bus.b.startup.start");
  says(file(table + "on_error = \"reset\"\n"), "m.toml:8:12: error: bus.b.startup.on_error");
  says(file(table + "boot_time = \"25 h\"\n"), "m.toml:8:13: error: bus.b.startup.boot_time");
  says(file(table + "boot_time = 20\n"), "m.toml:8:13: error: bus.b.startup.boot_time");
  says(file(table + "nmt_inhibit = \"50 us\"\n"), "tenths of a millisecond");
  says(file(table + "boots = 1\n"), "m.toml:8:1: error: bus.b.startup.boots");
  says(file("", "device_type = 0x1_0000_0000\n"), "slot[1].device_type: 4294967296 is out of range");
  says(file(table, "mandatory = true\n", "commissioner"), "only a master starts a network");
  for (const std::string key :
       {"start = \"together\"", "on_error = \"reset-all\"", "on_error = \"stop-all\"", "boot_time = \"1 s\""}) {
    says(file(table + key + "\n", ""), "bus.b.startup: no slot of this bus is mandatory; write mandatory = true");
  }
}

}  // namespace
}  // namespace berth::design
