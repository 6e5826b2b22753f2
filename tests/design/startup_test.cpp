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

TEST(RoleKey, EachWordIsItsRole) {
  EXPECT_EQ(good(file("", "", "master")).buses.at(0).role, Role::master);
  EXPECT_EQ(good(file("", "", "commissioner")).buses.at(0).role, Role::commissioner);
  EXPECT_EQ(good(file("", "", "observer")).buses.at(0).role, Role::observer);
  EXPECT_NE(wrong_keys(file("", "", "reader")).find("bus.b.role"), std::string::npos) << "of no machine file";
}

// `[bus.NAME.sync]`: 1005h, 1006h and 1019h of Berth's own device.
TEST(SyncKeys, EachKeyAndTheEndsOfItsRange) {
  EXPECT_FALSE(good(file("")).buses.at(0).sync) << "Berth sends none";
  const Machine m = good(file("[bus.b.sync]\nperiod = \"10 ms\"\n"));
  ASSERT_TRUE(m.buses.at(0).sync);
  EXPECT_EQ(m.buses.at(0).sync->period, 10ms);
  EXPECT_EQ(m.buses.at(0).sync->counter, 0) << "SYNC without data";
  const Machine counts = good(file("[bus.b.sync]\nperiod = \"1 h\"\ncounter = 240\n"));
  EXPECT_EQ(counts.buses.at(0).sync->period, 1h);
  EXPECT_EQ(counts.buses.at(0).sync->counter, 240);
  const auto wrong = [](const std::string& keys) { return wrong_keys(file("[bus.b.sync]\n" + keys)); };
  EXPECT_NE(wrong("").find("bus.b.sync.period"), std::string::npos) << wrong("");
  for (const char* const keys : {"period = \"99 us\"\n", "period = \"61 min\"\n", "period = \"10.0005 ms\"\n",
                                 "period = 10\n", "periode = \"10 ms\"\n"}) {
    EXPECT_NE(wrong(keys).find("bus.b.sync.period"), std::string::npos) << keys << wrong(keys);
  }
  for (const char* const keys : {"counter = 1\n", "counter = 241\n", "counter = 0\n"}) {
    const std::string text = "period = \"10 ms\"\n" + std::string(keys);
    EXPECT_NE(wrong(text).find("bus.b.sync.counter"), std::string::npos) << keys << wrong(text);
  }
}

// 125 kbit/s: 65 bit times of a SYNC are 520 us.
TEST(SyncKeys, WhatTheBusCannotCarryAndOtherRolesAreRefused) {
  EXPECT_EQ(good(file("[bus.b.sync]\nperiod = \"1040 us\"\n")).buses.at(0).sync->period, 1040us);
  EXPECT_NE(wrong_keys(file("[bus.b.sync]\nperiod = \"1039 us\"\n")).find("more than half of a bus at 125 kbit/s"),
            std::string::npos);
  for (const char* const role : {"observer", "commissioner"}) {
    EXPECT_NE(wrong_keys(file("[bus.b.sync]\nperiod = \"10 ms\"\n", "", role)).find("only a master sends SYNC"),
              std::string::npos);
  }
}

// `[bus.NAME.flying_master]`: CiA 302-2's 1F90h in words.
TEST(FlyingMasterKeys, ATableAloneHasTheDefaultsOf1F90h) {
  EXPECT_FALSE(good(file("")).buses.at(0).flying);
  const Machine m = good(file("[bus.b.flying_master]\n"));
  ASSERT_TRUE(m.buses.at(0).flying);
  const FlyingBus& flying = *m.buses.at(0).flying;
  EXPECT_EQ(flying.priority, 1);
  EXPECT_EQ(flying.timing.detection, 100ms);
  EXPECT_EQ(flying.timing.delay, 500ms);
  EXPECT_EQ(flying.timing.priority_slot, 1500ms);
  EXPECT_EQ(flying.timing.device_slot, 10ms);
  EXPECT_TRUE(m.buses.at(0).startup.rules.flying) << "bit 5 of 1F80h";
}

TEST(FlyingMasterKeys, EachKeyAndTheEndsOfItsRange) {
  const Machine m = good(
      file("[bus.b.flying_master]\npriority = 2\ndetection = \"1 ms\"\ndelay = \"0 ms\"\npriority_slot = \"65535 ms\"\n"
           "device_slot = \"515 ms\"\ncycle = \"65535 ms\"\n"));
  const FlyingBus& flying = *m.buses.at(0).flying;
  EXPECT_EQ(flying.priority, 2);
  EXPECT_EQ(flying.timing.detection, 1ms);
  EXPECT_EQ(flying.timing.delay, 0ms);
  EXPECT_EQ(flying.timing.priority_slot, 65535ms);
  EXPECT_EQ(flying.timing.device_slot, 515ms);
  EXPECT_EQ(flying.timing.cycle, 65535ms);
  const auto wrong = [](const std::string& keys) { return wrong_keys(file("[bus.b.flying_master]\n" + keys)); };
  for (const char* const keys :
       {"priority = 3\n", "priority = -1\n", "detection = \"0 ms\"\n", "detection = \"65536 ms\"\n",
        "delay = \"65536 ms\"\n", "priority_slot = \"0 ms\"\n", "priority_slot = \"65536 ms\"\n",
        "device_slot = \"0 ms\"\n", "cycle = \"0 ms\"\n", "cycle = \"65536 ms\"\n"}) {
    const std::string text = keys;
    const std::string key = text.substr(0, text.find(' '));
    EXPECT_NE(wrong(text).find(key), std::string::npos) << text << wrong(text);
  }
}

TEST(FlyingMasterKeys, SlotsThatOverlapAndOtherRolesAreRefused) {
  EXPECT_NE(wrong_keys(file("[bus.b.flying_master]\n", "", "observer")).find("only a master can be a flying master"),
            std::string::npos);
  EXPECT_NE(wrong_keys(file("[bus.b.flying_master]\npriority_slot = \"1270 ms\"\n"))
                .find("the slots of two priorities overlap"),
            std::string::npos);
  EXPECT_TRUE(good(file("[bus.b.flying_master]\npriority_slot = \"1271 ms\"\n")).buses.at(0).flying);
  EXPECT_NE(wrong_keys(file("[bus.b.flying_master]\nnoise = 1\n")).find("noise"), std::string::npos);
}

TEST(TimingKeys, AtOnceIsFrom1To127) {
  const auto with = [](const std::string& keys) { return file("[timing]\n" + keys); };
  EXPECT_EQ(good(file("")).buses.at(0).timing.at_once, 0U) << "as many as the bus has room for";
  EXPECT_EQ(good(with("at_once = 1\n")).buses.at(0).timing.at_once, 1U);
  EXPECT_EQ(good(with("at_once = 127\n")).buses.at(0).timing.at_once, 127U);
  EXPECT_NE(wrong_keys(with("at_once = 0\n")).find("at_once"), std::string::npos);
  EXPECT_NE(wrong_keys(with("at_once = 128\n")).find("at_once"), std::string::npos);
}

TEST(MachineKeys, WatchNamesObjectsOfSlots) {
  const auto with = [](const std::string& words) {
    std::string text = file("");
    return text.insert(text.find("[bus.b]"), "watch = [" + words + "]\n");
  };
  EXPECT_TRUE(good(file("")).watch.empty());
  const auto watch = good(with(R"("left/1001h", "left/Identity object/Serial number")")).watch;
  EXPECT_EQ(watch, (std::vector<LinkEnd>{{"left", "1001h"}, {"left", "Identity object/Serial number"}}));
  EXPECT_NE(wrong_keys(with(R"("lefd/1001h")")).find("did you mean \"left\"?"), std::string::npos);
  EXPECT_NE(wrong_keys(with(R"("1001h")")).find("machine.watch"), std::string::npos);
  EXPECT_NE(wrong_keys(with("7")).find("every item must be a string"), std::string::npos);
  std::string many = "\"left/1001h\"";
  for (int i = 0; i < 31; ++i) many += ", \"left/1001h\"";
  EXPECT_EQ(good(with(many)).watch.size(), 32U);
  EXPECT_NE(wrong_keys(with(many + ", \"left/1001h\"")).find("33 values"), std::string::npos);
}

TEST(MachineKeys, LinkPlanStandsBesideTheMachineFile) {
  const auto with = [](const std::string& line) {
    std::string text = file("");
    return text.insert(text.find("[bus.b]"), line);
  };
  const std::vector<std::string> anywhere{"/"};
  const auto read = [&](const std::string& text) {
    return read_machine(text, "some/where/m.toml", {}, {}, {}, anywhere);
  };
  EXPECT_EQ(read(file("")).machine->link_plan, "");
  const auto named = read(with("link_plan = \"plan.toml\"\n"));
  ASSERT_TRUE(named.machine);
  EXPECT_EQ(named.machine->link_plan, "some/where/plan.toml");
  const auto absolute = read(with("link_plan = \"/srv/plan.toml\"\n"));
  ASSERT_TRUE(absolute.machine);
  EXPECT_EQ(absolute.machine->link_plan, "/srv/plan.toml");
  EXPECT_NE(wrong_keys(with("link_plan = \"\"\n")).find("the file name is empty"), std::string::npos);
}

}  // namespace
}  // namespace berth::design
