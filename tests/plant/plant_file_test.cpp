#include <gtest/gtest.h>
#include <rapidcheck/gtest.h>
#include <chrono>
#include <cstdint>
#include <map>
#include <string>
#include <vector>

#include "berth/plant/plant_file.hpp"

#include "../paths.hpp"
#include "berth/base/random.hpp"
#include "tests/pch.hpp"

namespace berth::plant {
namespace {

using namespace std::chrono_literals;

const std::string head = "[bus.b]\n";
const std::string one = "[[device]]\nbus = \"b\"\nname = \"s1\"\ntype = { vendor = 1, product = 2 }\nserial = 5\n";

std::string only_error(const std::string& text) {
  const auto result = read_plant(text, "p.toml");
  EXPECT_FALSE(result.plant);
  EXPECT_EQ(result.findings.size(), 1U);
  std::string all;
  for (const auto& finding : result.findings) all += to_string(finding) + "\n";
  if (!all.empty()) all.pop_back();
  return all;
}

const std::string plc = "[[device]]\nbus = \"b\"\nname = \"plc\"\neds = \"plc.eds\"\n";

TEST(PlantFile, NetworkVariables) {
  const auto result = read_plant(head + plc + R"(variables = [
  { name = "speed", type = "UNSIGNED16", object = "A100h:01" },
  { name = "run", type = "u8", object = "A4C0h:FE" },
]
)",
                                 "p.toml");
  ASSERT_TRUE(result.plant) << to_string(result.findings.front());
  const std::vector<PlantVariable> wanted{{"speed", od::DataType::unsigned16, {0xA100, 1}},
                                          {"run", od::DataType::unsigned8, {0xA4C0, 254}}};
  EXPECT_EQ(result.plant->devices[0].does.variables, wanted);
  const auto again = read_plant(write_plant(*result.plant), "again.toml");
  ASSERT_TRUE(again.plant) << write_plant(*result.plant);
  EXPECT_EQ(again.plant->devices[0].does.variables, wanted);
}

TEST(PlantFile, NetworkVariablesThatAreNone) {
  const auto refused = [](const std::string& variable) {
    return only_error(head + plc + "variables = [" + variable + "]\n");
  };
  EXPECT_NE(refused("{ type = \"u8\", object = \"A040h:01\" }").find("give the variable a name"), std::string::npos);
  EXPECT_NE(refused("{ name = \"x\", object = \"A040h:01\" }").find("such as \"UNSIGNED16\""), std::string::npos);
  EXPECT_NE(refused("{ name = \"x\", type = \"VISIBLE_STRING\", object = \"A040h:01\" }")
                .find("not a data type of a network"),
            std::string::npos);
  EXPECT_NE(refused("{ name = \"x\", type = \"u8\", object = \"1800h:01\" }").find("not an object of a maker's own"),
            std::string::npos);
  EXPECT_NE(only_error(head + one + "variables = [{ name = \"x\", type = \"u8\", object = \"A040h:01\" }]\n")
                .find("no description"),
            std::string::npos);
}

TEST(PlantFile, ReadsEverything) {
  const auto result = read_plant(R"(
[plant]
seed = 42
[bus.b]
bitrate = 50_000
[bus.c]
[[device]]
bus = "b"
name = "s1"
type = { vendor = 0x0100_0001, product = 1, revision = 2 }
serial = 0x0A
source = "switches"
node_id = 9
bitrate = 10_000
speaks = ["lss", "rand-literal"]
response = { min = "1 ms", max = "4 ms", outlier = "300 ms", outlier_ppm = 20 }
boot = "1.5 s"
reset = "100 ms"
store = "20 ms"
programs = { count = 3, size = 1000, images = 1, sector = 256, erase = "5 ms", write = "9 us", checked = false }
deaf_while_storing = true
power_cycle_after_store = true
queue = "priority"
rx_depth = 1
heartbeat = "100 ms"
heartbeat_sent = "70 ms"
resets_at_heartbeat = "forgets"
identity_changes = ["vendor", "serial"]
sdo_serial = 11
identity_only_pre_operational = true
bus_off_recovery = "1 s"
repeat_ppm = 7
extended_frames = false
drift_ppm = -100
plugged = false
[[device]]
bus = "c"
name = "drive {n}"
eds = "eds/drive.eds"
count = 3
serial_first = 0x10
serial_step = 2
response = "4 ms"
[[event]]
at = "2.5 s"
action = "plug"
device = "s1"
[[event]]
after = "operational"
delay = "1 s"
action = "disturb"
bus = "c"
id = 0x1F94_0000
extended = true
skip = 3
times = 0
kind = "dominant"
bit_from_end = -1
bits = 6
nodes = ["drive 2", "master"]
[[event]]
at = "3 s"
action = "slow"
device = "drive 1"
latency = "200 ms"
duration = "1 s"
[[event]]
at = "4 s"
action = "cut-cable"
bus = "c"
nodes = ["drive 1"]
)",
                                 "dir/p.toml");
  ASSERT_TRUE(result.plant) << to_string(result.findings.at(0));
  const auto& p = *result.plant;
  EXPECT_EQ(p.seed, 42U);
  EXPECT_EQ(p.buses, (std::vector<PlantBus>{{"b", 50'000}, {"c", 0}}));
  ASSERT_EQ(p.devices.size(), 4U);
  const auto& s1 = p.devices[0];
  EXPECT_EQ(s1.address, (LssAddress{0x01000001, 1, 2, 0x0A}));
  EXPECT_FALSE(s1.address_of_eds);
  EXPECT_EQ(s1.source, NodeIdSource::switches);
  EXPECT_EQ(s1.node_id, NodeId(9));
  EXPECT_EQ(s1.bitrate, 10'000U);
  EXPECT_EQ(s1.speaks, (SpeaksSet{Speaks::lss, Speaks::rand, Speaks::rand_literal}));
  EXPECT_EQ(s1.response, (Latency{1ms, 4ms, 20, 300ms}));
  EXPECT_EQ(s1.boot, Duration(1500ms));
  EXPECT_EQ(s1.reset, Duration(100ms));
  EXPECT_EQ(s1.storing.time, Duration(20ms));
  EXPECT_EQ(s1.storing.programs.count, 3U);
  EXPECT_EQ(s1.storing.programs.size, 1000U);
  EXPECT_EQ(s1.storing.programs.images, 1U);
  EXPECT_EQ(s1.storing.programs.sector, 256U);
  EXPECT_EQ(s1.storing.programs.erase, Duration(5ms));
  EXPECT_EQ(s1.storing.programs.write, Duration(9us));
  EXPECT_FALSE(s1.storing.programs.checked);
  EXPECT_EQ(p.devices[1].storing.programs.count, 0U);
  EXPECT_TRUE(s1.storing.deaf);
  EXPECT_TRUE(s1.storing.power_cycle_after);
  EXPECT_EQ(s1.controller.queue, QueueKind::priority);
  EXPECT_EQ(s1.controller.rx_depth, 1U);
  EXPECT_EQ(s1.heartbeat, Duration(100ms));
  EXPECT_EQ(s1.controller.bus_off_recovery, Duration(1s));
  EXPECT_EQ(s1.controller.repeat_ppm, 7U);
  EXPECT_FALSE(s1.controller.extended_frames);
  const PlantOddities odd{0b1001, 11, true, ResetsAtHeartbeat::forgets, 70ms};
  EXPECT_EQ(s1.does.odd, odd);
  EXPECT_EQ(s1.controller.drift_ppm, -100);
  EXPECT_FALSE(s1.plugged);
  EXPECT_EQ(p.devices[3].name, "drive 3");
  EXPECT_EQ(p.devices[3].address.serial, 0x14U);
  EXPECT_TRUE(p.devices[3].address_of_eds);
  EXPECT_EQ(p.devices[3].eds_path, "dir/eds/drive.eds");
  EXPECT_EQ(p.devices[3].source, NodeIdSource::blank);
  EXPECT_FALSE(p.devices[3].node_id.configured());
  EXPECT_TRUE(p.devices[3].plugged);
  ASSERT_EQ(p.events.size(), 4U);
  EXPECT_EQ(p.events[0].delay, Duration(2500ms));
  EXPECT_EQ(p.events[0].after, After::start);
  const auto& strike = p.events[1].strike;
  EXPECT_EQ(p.events[1].after, After::operational);
  EXPECT_EQ(strike.id, 0x9F940000U);
  EXPECT_EQ(strike.kind, Disturbance::dominant);
  EXPECT_EQ(strike.bit, -1);
  EXPECT_TRUE(strike.from_end);
  EXPECT_EQ(strike.bits, 6U);
  EXPECT_EQ(strike.times, 0U);
  EXPECT_EQ(p.events[1].nodes, (std::vector<std::string>{"drive 2", "master"}));
  EXPECT_EQ(p.events[2].latency, Duration(200ms));
  EXPECT_EQ(p.events[3].action, Action::cut_cable);
}

// S1.38: the paper's Table II devices are in the example (s4 and s5: digits lost, 06h and 07h).
TEST(PlantFile, S1_38_TheFiveSlavesAndTheirReplacements) {
  const auto result = load_plant(berth::test::source_dir() + "/examples/five-slaves.plant.toml");
  ASSERT_TRUE(result.plant) << to_string(result.findings.at(0));
  const auto& p = *result.plant;
  const std::map<std::string, LssAddress> expected{{"s1", {0x01000001, 1, 0, 0x0A}},
                                                   {"s2", {1, 1, 0, 5}},
                                                   {"s3", {1, 5, 0, 8}},
                                                   {"s4", {1, 1, 0, 6}},
                                                   {"s5", {1, 1, 0, 7}},
                                                   {"s2 new", {1, 1, 0, 0x15}},
                                                   {"s4 new", {1, 1, 0, 0x18}}};
  std::map<std::string, LssAddress> found;
  for (const auto& d : p.devices) found[d.name] = d.address;
  EXPECT_EQ(found, expected);
  for (const auto& d : p.devices) EXPECT_EQ(d.plugged, !d.name.ends_with("new")) << d.name;
}

TEST(PlantFile, EveryExampleReads) {
  const std::map<std::string, std::size_t> examples{
      {"five-slaves", 7}, {"hundred-twenty", 120}, {"by-eds", 5}, {"configured", 4}};
  for (const auto& [name, devices] : examples) {
    const auto result = load_plant(berth::test::source_dir() + "/examples/" + name + ".plant.toml");
    ASSERT_TRUE(result.plant) << to_string(result.findings.at(0));
    EXPECT_TRUE(result.findings.empty()) << to_string(result.findings.at(0));
    EXPECT_EQ(result.plant->devices.size(), devices) << name;
  }
}

TEST(PlantFile, SaysWhatIsWrongAndWhere) {
  EXPECT_EQ(only_error(head + one + "boott = \"1 s\"\n"),
            "p.toml:7:1: error: device[1].boott: unknown key; did you mean \"boot\"?");
  EXPECT_EQ(only_error(head + one + "boot = 5\n"),
            "p.toml:7:8: error: device[1].boot: this is an integer; it must be a string with a unit, such as \"4 ms\"");
  EXPECT_EQ(only_error(head + one + "node_id = 200\n"),
            "p.toml:7:11: error: device[1].node_id: 200 is not a node-ID; use 1 to 127, or 255 for none");
  EXPECT_EQ(only_error(head + one + "[[event]]\nat = \"1 s\"\naction = \"unplug\"\ndevice = \"s2\"\n"),
            "p.toml:10:10: error: event[1].device: there is no device \"s2\"; did you mean \"s1\"?");
  EXPECT_EQ(only_error(head + one + "[[event]]\nat = \"1 s\"\naction = \"unplg\"\ndevice = \"s1\"\n").substr(0, 86),
            "p.toml:9:10: error: event[1].action: \"unplg\" is not known here; did you mean \"unplug\"?");
}

TEST(PlantFile, EveryOtherMistakeIsAnError) {
  const std::string event = head + one + "[[event]]\n";
  const std::vector<std::string> bad{
      "",
      one,
      "[bus.b]\nbitrate = 7\n",
      "[bus.\"a/b\"]\n",
      "[plant]\nseed = -1\n[bus.b]\n",
      "[plant]\nseed = \"0x\"\n[bus.b]\n",
      "[plant]\nseed = \"12\"\n[bus.b]\n",
      "[plant]\nseed = \"0x1_0000\"\n[bus.b]\n",
      "[plant]\nseed = \"0x10000000000000000\"\n[bus.b]\n",
      head + one + one,
      head + one + "name = \"x\"\n",
      head + one + "count = 2\n",
      head + one + "serial_first = 2\n",
      head + one + "n_first = 2\n",
      head + "[[device]]\nbus = \"b\"\nname = \"x\"\n",
      head + "[[device]]\nbus = \"b\"\nname = \"master\"\neds = \"x\"\n",
      head + "[[device]]\nbus = \"b\"\nname = \"x {n}\"\neds = \"x\"\n",
      head + "[[device]]\nbus = \"b\"\nname = \"x\"\ncount = 3\neds = \"x\"\n",
      head + "[[device]]\nbus = \"b\"\nname = \"x {n}\"\ncount = 3\nserial_first = 0xFFFF_FFFE\neds = \"x\"\n",
      head + "[[device]]\nbus = \"b\"\nname = \"x {n}\"\nserials = []\neds = \"x\"\n",
      head + "[[device]]\nbus = \"b\"\nname = \"x {n}\"\nserials = [1, \"2\"]\neds = \"x\"\n",
      head + "[[device]]\nbus = \"b\"\nname = \"x {n}\"\nserials = [1]\ncount = 1\neds = \"x\"\n",
      head + one + "source = \"blank\"\nnode_id = 5\n",
      head + one + "source = \"hard-coded\"\n",
      head + one + "speaks = [\"randd\"]\n",
      head + one + "habits = [\"lelly\"]\n",
      head + one + "identity_changes = [\"type\"]\n",
      head + one + "resets_at_heartbeat = \"often\"\n",
      head + one + "habits = [\"lely\", \"canopennode\"]\n",
      head + one + "habits = [\"lely\"]\nspeaks = [\"rand\"]\n",
      head + one + "lss_without = [\"inquire\"]\n",
      head + one + "lss_without = [\"fastscan\"]\n",
      head + one + "lss_without = [\"select\"]\nspeaks = [\"rand\"]\n",
      head + one + "lss_store = \"none\"\n",
      head + one + "lss_store = \"refused\"\nspeaks = [\"rand\"]\n",
      head + one + "short_answers = 1\n",
      head + one + "response = { min = \"2 ms\", max = \"1 ms\" }\n",
      head + one + "response = { min = \"2 ms\" }\n",
      head + one + "response = 4\n",
      head + one + "response = { min = \"1 ms\", max = \"1 ms\", outlier = \"1 s\" }\n",
      head + one + "programs = 1\n",
      head + one + "programs = { count = 0 }\n",
      head + one + "programs = { count = 255 }\n",
      head + one + "programs = { images = 3 }\n",
      head + one + "programs = { sector = 63 }\n",
      head + one + "programs = { count = 254, size = 16_000_000 }\n",
      head + one + "programs = { erase = 5 }\n",
      head + one + "programs = { file = \"x\" }\n",
      head + one + "rx_depth = 0\n",
      head + one + "heartbeat = \"1.5 ms\"\n",
      head + one + "heartbeat = \"66 s\"\n",
      head + one + "drift_ppm = 100001\n",
      event,
      event + "action = \"reset\"\ndevice = \"s1\"\n",
      event + "at = \"1 s\"\nafter = \"bound\"\naction = \"reset\"\ndevice = \"s1\"\n",
      event + "at = \"1 s\"\ndelay = \"1 s\"\naction = \"reset\"\ndevice = \"s1\"\n",
      event + "at = \"1 s\"\naction = \"reset\"\n",
      event + "at = \"1 s\"\naction = \"reset\"\ndevice = \"s1\"\nbits = 1\n",
      event + "at = \"1 s\"\naction = \"slow\"\ndevice = \"s1\"\n",
      event + "at = \"1 s\"\naction = \"set-node-id\"\ndevice = \"s1\"\nvalue = 128\n",
      event + "at = \"1 s\"\naction = \"set-serial\"\ndevice = \"s1\"\n",
      event + "at = \"1 s\"\naction = \"cut-cable\"\nbus = \"b\"\nnodes = []\n",
      event + "at = \"1 s\"\naction = \"cut-cable\"\nnodes = [\"s1\"]\n",
      event + "at = \"1 s\"\naction = \"disturb\"\nbus = \"b\"\n",
      event + "at = \"1 s\"\naction = \"disturb\"\nbus = \"b\"\nbit = 1\nbit_from_end = 1\n",
      event + "at = \"1 s\"\naction = \"disturb\"\nbus = \"b\"\nbit = 1\nid = 0x800\n",
      event + "at = \"1 s\"\naction = \"disturb\"\nbus = \"b\"\nbit = 1\nextended = true\n",
      event + "at = \"1 s\"\naction = \"disturb\"\nbus = \"b\"\nbit = 1\nnodes = [\"s1\"]\nspare_senders = true\n",
      event + "at = \"1 s\"\naction = \"disturb\"\nbus = \"b\"\nbit = 1\nsender = \"nobody\"\n",
      event + "at = \"1 s\"\naction = \"recover\"\ndevice = \"s1\"\nduration = \"1 s\"\n",
      event + "at = \"1 s\"\naction = \"overrun\"\nbus = \"b\"\nbit = 1\n",
      "[bus.c]\n" + event + "at = \"1 s\"\naction = \"overrun\"\nbus = \"c\"\nnodes = [\"s1\"]\n"};
  for (const auto& text : bad) {
    const auto result = read_plant(text, "p.toml");
    EXPECT_FALSE(result.plant) << text;
    EXPECT_TRUE(has_errors(result.findings)) << text;
    for (const auto& f : result.findings) EXPECT_GE(f.line, 1) << text << to_string(f);
  }
}

// A gateway's master whose own place is not in its network list could not take the list (1F22h of its own node-ID).
TEST(PlantFile, SeveralDevicesAreNumberedFromWhereTheirSlotsBegin) {
  const auto result =
      read_plant(head + "[[device]]\nbus = \"b\"\nname = \"x {n}\"\neds = \"x\"\ncount = 3\nn_first = 9\n", "p.toml");
  ASSERT_TRUE(result.plant) << to_string(result.findings.front());
  std::vector<std::string> names;
  for (const auto& device : result.plant->devices) names.push_back(device.name);
  EXPECT_EQ(names, (std::vector<std::string>{"x 9", "x 10", "x 11"}));
}

TEST(PlantFile, AMasterAboveTheHighestOfItsListIsRefusedInWords) {
  const auto with = [](const std::string& master) {
    return head + one + "node_id = 40\nmaster = { flying = false" + master + " }\n";
  };
  const auto error = only_error(with(""));
  EXPECT_NE(error.find("its own node-ID 40 is above the highest that its network list has (32)"), std::string::npos)
      << error;
  EXPECT_NE(error.find("most = 40"), std::string::npos) << error;
  EXPECT_TRUE(read_plant(with(", most = 40"), "p.toml").plant);
}

TEST(PlantFile, ANumericHardwareVersion) {
  const auto result = read_plant(head + one + "hardware = 3\n", "p.toml");
  ASSERT_TRUE(result.plant);
  EXPECT_EQ(result.plant->devices.front().does.hardware, 3U);
  EXPECT_NE(write_plant(*result.plant).find("hardware = 3"), std::string::npos);
  EXPECT_FALSE(read_plant(head + "[[device]]\nbus = \"b\"\nname = \"x\"\neds = \"x\"\nhardware = 3\n", "p.toml").plant);
}

// Both stacks have Fastscan built in, and neither knows RAND.
TEST(PlantFile, HabitsAreThoseOfAStackThatSpeaksFastscan) {
  const auto result = read_plant(head + one + "habits = [\"canopennode\"]\n", "p.toml");
  ASSERT_TRUE(result.plant);
  EXPECT_EQ(result.plant->devices[0].lss.habit, Habit::canopennode);
  EXPECT_EQ(result.plant->devices[0].speaks, SpeaksSet{Speaks::fastscan});
  const auto both = read_plant(head + one + "habits = [\"lely\"]\nspeaks = [\"fastscan\", \"rand\"]\n", "p.toml");
  ASSERT_TRUE(both.plant);
  EXPECT_EQ(both.plant->devices[0].lss.habit, Habit::lely);
  EXPECT_EQ(both.plant->devices[0].speaks, (SpeaksSet{Speaks::fastscan, Speaks::rand}));
}

TEST(PlantFile, WhatTheLssOfADeviceLacks) {
  const auto result = read_plant(head + one +
                                     "lss_without = [\"inquire-identity\", \"activate\"]\nlss_store = \"refused\"\n"
                                     "short_answers = true\n",
                                 "p.toml");
  ASSERT_TRUE(result.plant);
  const PlantLss& lss = result.plant->devices[0].lss;
  EXPECT_EQ(lss.without, (lss::LackSet{lss::Lackable::inquire_identity, lss::Lackable::activate}));
  EXPECT_TRUE(lss.refuses_store);
  EXPECT_TRUE(lss.short_answers);
  const auto error = only_error(head + one + "lss_without = [\"fastscan\"]\n");
  EXPECT_NE(error.find("leave \"fastscan\" out of speaks"), std::string::npos) << error;
}

// S1.22: a cloned LSS address is something to try; it is named, and allowed.
TEST(PlantFile, S1_22_ClonesAreNotedNotRefused) {
  const auto result = read_plant(
      head + one + "[[device]]\nbus = \"b\"\nname = \"s2\"\ntype = { vendor = 1, product = 2 }\nserial = 5\n",
      "p.toml");
  EXPECT_TRUE(result.plant);
  ASSERT_EQ(result.findings.size(), 1U);
  EXPECT_EQ(result.findings[0].severity, Finding::Severity::note);
}

// On another bus it is another device's, as it is of most that have no serial number.
TEST(PlantFile, OneAddressOnTwoBusesIsNothingToNote) {
  const auto result =
      read_plant(head + "[bus.c]\n" + one +
                     "[[device]]\nbus = \"c\"\nname = \"s2\"\ntype = { vendor = 1, product = 2 }\nserial = 5\n",
                 "p.toml");
  EXPECT_TRUE(result.plant);
  EXPECT_TRUE(result.findings.empty());
}

Duration random_time(Random& r, Duration most) {
  const std::array<std::int64_t, 4> scales{1, 1000, 1'000'000, 1'000'000'000};
  const auto scale = scales.at(r.below(4));
  return Duration(static_cast<std::int64_t>(r.below(static_cast<std::uint64_t>(most.count() / scale) + 1)) * scale);
}

std::string random_name(Random& r, std::size_t i) {
  const std::array<const char*, 6> stems{"s", "pump \"x\"", "\xC3\xA4\\", "a.b", "[x]", "#"};
  return stems.at(r.below(stems.size())) + std::to_string(i);
}

PlantDevice random_device(Random& r, std::size_t i, const std::vector<PlantBus>& buses) {
  PlantDevice d;
  d.name = random_name(r, i);
  d.bus = buses.at(r.below(buses.size())).name;
  if (r.chance(300'000)) d.eds = "eds/x.eds";
  d.address_of_eds = !d.eds.empty() && r.chance(500'000);
  const auto u32 = [&] { return static_cast<std::uint32_t>(r.chance(300'000) ? r.below(3) : r.next()); };
  if (!d.address_of_eds) d.address = {u32(), u32(), u32(), 0};
  d.address.serial = u32();
  if (r.chance(500'000)) d.node_id = NodeId(static_cast<std::uint8_t>(1 + r.below(127)));
  d.source = d.node_id.configured() ? static_cast<NodeIdSource>(1 + r.below(4)) : static_cast<NodeIdSource>(r.below(2));
  if (r.chance(300'000)) d.bitrate = 1000 + static_cast<std::uint32_t>(r.below(999'001));
  d.speaks = {};
  for (unsigned s = 0; s < 11; ++s) {
    if (r.chance(300'000)) d.speaks.add(static_cast<Speaks>(s));
  }
  if (r.chance(300'000)) {
    d.lss.habit = static_cast<Habit>(r.below(2));
    d.speaks.add(Speaks::fastscan);
  }
  if (d.speaks.has(Speaks::lss)) {
    for (unsigned each = 0; each < lss::lackable_count; ++each) {
      if (r.chance(300'000)) d.lss.without.add(static_cast<lss::Lackable>(each));
    }
    d.lss.refuses_store = r.chance(300'000);
    d.lss.short_answers = r.chance(300'000);
  }
  if (r.chance(700'000)) {
    d.response.min = random_time(r, 1h);
    d.response.max = d.response.min + random_time(r, 1h - d.response.min);
    if (r.chance(500'000)) {
      d.response.outlier_ppm = static_cast<std::uint32_t>(r.below(1'000'001));
      d.response.outlier = random_time(r, 1h);
    }
  }
  if (r.chance(500'000)) d.boot = random_time(r, 1h);
  if (r.chance(500'000)) d.reset = random_time(r, 1h);
  if (r.chance(500'000)) d.storing.time = random_time(r, 1h);
  d.storing.deaf = r.chance(500'000);
  d.storing.power_cycle_after = r.chance(500'000);
  d.controller.queue = static_cast<QueueKind>(r.below(2));
  d.controller.rx_depth = 1 + static_cast<std::uint32_t>(r.below(1024));
  d.heartbeat = std::chrono::milliseconds(r.below(65536));
  if (r.chance(500'000)) d.controller.bus_off_recovery = random_time(r, 1h);
  if (r.chance(500'000)) d.controller.repeat_ppm = static_cast<std::uint32_t>(r.below(1'000'001));
  d.controller.extended_frames = r.chance(500'000);
  if (r.chance(300'000)) {
    auto& odd = d.does.odd;
    odd.changing = static_cast<std::uint8_t>(r.below(16));
    if (r.chance(500'000)) odd.sdo_serial = static_cast<std::uint32_t>(r.below(1000));
    odd.identity_only_pre_operational = r.chance(500'000);
    odd.resets = static_cast<ResetsAtHeartbeat>(r.below(4));
    odd.heartbeat_sent = std::chrono::milliseconds(r.below(1000));
  }
  d.controller.drift_ppm = static_cast<std::int32_t>(r.between(-100'000, 100'000));
  d.plugged = r.chance(500'000);
  if (r.below(3) == 0) {
    d.storing.programs.count = static_cast<std::uint32_t>(1 + r.below(254));
    d.storing.programs.images = static_cast<std::uint32_t>(1 + r.below(2));
    d.storing.programs.size = static_cast<std::uint32_t>(1 + r.below(100'000));
    d.storing.programs.checked = r.below(2) == 0;
    d.storing.programs.write = Duration(static_cast<std::int64_t>(r.below(1'000'000)));
    if (r.below(2) == 0) d.storing.programs.loaded = "p \"1\".bprg";
  }
  return d;
}

Strike random_strike(Random& r, bool bits, bool nodes) {
  Strike s;
  if (r.chance(500'000)) s.frame = r.next() >> 1U;
  if (r.chance(500'000)) {
    s.id = r.chance(500'000) ? static_cast<std::uint32_t>(r.below(0x800))
                             : static_cast<std::uint32_t>(r.below(0x2000'0000)) | 0x8000'0000U;
  }
  s.skip = static_cast<std::uint32_t>(r.next());
  s.times = static_cast<std::uint32_t>(r.below(3));
  s.spare_senders = !nodes && r.chance(500'000);
  if (r.chance(500'000)) s.sender = "master";
  if (!bits) return s;
  s.kind = static_cast<Disturbance>(r.below(3));
  s.from_end = r.chance(500'000);
  s.bit = static_cast<std::int32_t>(r.between(s.from_end ? -3 : 0, 1000));
  s.bits = 1 + static_cast<std::uint32_t>(r.below(1000));
  return s;
}

PlantEvent random_event(Random& r, const PlantFile& p) {
  PlantEvent e;
  e.after = static_cast<After>(r.below(4));
  e.delay = random_time(r, 24h);
  e.action = static_cast<Action>(r.below(14));
  const auto& device = p.devices.at(r.below(p.devices.size()));
  const bool of_bus = e.action >= Action::cut_cable && e.action <= Action::overrun;
  if (of_bus) {
    e.bus = device.bus;
    if (e.action == Action::cut_cable || (e.action != Action::join && r.chance(500'000)))
      e.nodes = {device.name, "master"};
    if (e.action == Action::disturb || e.action == Action::overrun) {
      e.strike = random_strike(r, e.action == Action::disturb, !e.nodes.empty());
    }
    return e;
  }
  e.device = device.name;
  if (e.action == Action::deaf || e.action == Action::slow) e.duration = random_time(r, 24h);
  if (e.action == Action::slow) e.latency = random_time(r, 1h);
  if (e.action == Action::set_serial) e.value = static_cast<std::uint32_t>(r.next());
  if (e.action == Action::set_node_id) e.value = r.chance(300'000) ? 255 : 1 + static_cast<std::uint32_t>(r.below(127));
  return e;
}

// "A failed random run is a file": what is written is what is read.
RC_GTEST_PROP(PlantFile, WrittenIsReadBackEqual, (std::uint64_t seed)) {
  Random r(seed);
  PlantFile plant;
  plant.seed = r.chance(500'000) ? r.next() : r.below(5);
  plant.buses = {{"b", 0}, {"bus \"2\"", 10'000, 2'000'000}};
  for (std::size_t n = 1 + r.below(6), i = 0; i < n; ++i) plant.devices.push_back(random_device(r, i, plant.buses));
  for (std::size_t n = r.below(8); n > 0; --n) plant.events.push_back(random_event(r, plant));
  const auto text = write_plant(plant, "seed 7\n\nfrom ./run faults\x01");
  const auto result = read_plant(text, "p.toml");
  if (!result.plant) RC_LOG() << to_string(result.findings.at(0)) << "\n" << text;
  RC_ASSERT(result.plant.has_value());
  RC_ASSERT(*result.plant == plant);
  RC_ASSERT(write_plant(*result.plant) == text.substr(text.find("[plant]")));
}

TEST(PlantFile, WriterLeavesOutWhatIsUsual) {
  PlantFile plant;
  plant.buses = {{"b", 0}};
  PlantDevice d;
  d.name = "s1";
  d.bus = "b";
  d.address = {1, 2, 0, 5};
  plant.devices = {d};
  EXPECT_EQ(write_plant(plant, "why"),
            "# why\n[plant]\nseed = 1\n\n[bus.\"b\"]\n\n[[device]]\nbus = \"b\"\nname = \"s1\"\n"
            "type = { vendor = 0x00000001, product = 0x00000002 }\nserial = 0x00000005\n");
}

}  // namespace
}  // namespace berth::plant
