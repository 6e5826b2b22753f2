#include "berth/design/machine.hpp"

#include <gtest/gtest.h>
#include <rapidcheck/gtest.h>
#include <chrono>
#include <cstdint>
#include <functional>
#include <map>
#include <optional>
#include <string>
#include <vector>

#include "../paths.hpp"
#include "berth/base/random.hpp"
#include "tests/pch.hpp"

namespace berth::design::machine_tests {
namespace {

using namespace std::chrono_literals;

const std::string head = "[machine]\nname = \"m\"\n[bus.b]\nport = \"sim\"\nbitrate = 125_000\n";
const std::string slot2 =
    "[[slot]]\nbus = \"b\"\nid = 2\nname = \"left\"\ntype = { vendor = 1, product = 0x0000_0001 }\n";

MachineResult read(const std::string& text) {
  const TypeLoader loader = [](const std::string& path, Findings& findings) -> std::optional<DeviceType> {
    if (path.ends_with("sensor.eds")) return DeviceType{{0x11, 0x22}, 0x00010002};
    if (path.ends_with("nameless.eds")) {
      od::DescriptionBuilder b;
      b.variable(0x1000, {.name = "Device type", .initial = od::Literal::number(0x0002'0192)});
      return DeviceType{{}, std::nullopt, b.build(), 3};
    }
    findings.push_back({Finding::Severity::error, path, 0, 0, "", "cannot be read", ""});
    return std::nullopt;
  };
  return read_machine(text, "some/where/m.toml", loader);
}

/// The one error of a text, as a person sees it.
std::string only_error(const std::string& text) {
  const auto result = read(text);
  EXPECT_FALSE(result.machine);
  EXPECT_EQ(result.findings.size(), 1U);
  std::string all;
  for (const auto& finding : result.findings) all += to_string(finding) + "\n";
  if (!all.empty()) all.pop_back();
  return all.starts_with("some/where/m.toml:") ? all.substr(18) : all;
}

TEST(MachineFile, ReadsEverything) {
  const auto result = read(R"(
[machine]
name = "conveyor"
[timing]
sdo_timeout = "200 ms"
save_timeout = "2 min"
[bus.backbone]
port    = "socketcan:can0"
bitrate = 250_000
role    = "commissioner"
master_id = 100
[bus.drives]
port    = "socketcand://host:29536/can0"
bitrate = 500_000
gateway = { bus = "backbone", slot = 3, mandatory = false }
[bus.drives.timing]
heartbeat_period = "100 ms"
tries = 5
[[slot]]
bus = "backbone"
id  = 2
name = "left sensor"
type = { vendor = 0x0000_0001, product = 0xFFFF_FFFF, revision = 0x0001_0000 }
when_ambiguous = "one-at-a-time"
revision = "major"
assign   = "recipe"
optional = true
replacement = "auto"
config   = "left-sensor.dcf"
activate = "power-cycle"
configure = "each-boot"
[[slot]]
bus = "backbone"
id = 3
name = "gate"
eds = "eds/sensor.eds"
[[slot]]
bus = "drives"
ids = "1..2, 9"
name = "drive {id}"
type = { vendor = 7, product = 8 }
[[device-type]]
name   = "sensor"
type   = { vendor = 0x0000_0001, product = 0xFFFF_FFFF }
recipe = { from = [1], write = [{ object = "2000h:00", value = "{id}" }] }
[[link]]
from = "left sensor/Position"
to   = ["drive 9/6040h:00"]
deadline = "20 ms"
)");
  ASSERT_TRUE(result.machine) << to_string(result.findings.at(0));
  const auto& m = *result.machine;
  EXPECT_EQ(m.name, "conveyor");
  ASSERT_EQ(m.buses.size(), 2U);
  EXPECT_EQ(m.buses[0].name, "backbone");
  EXPECT_EQ(m.buses[0].port, (PortSpec{PortKind::socketcan, "can0"}));
  EXPECT_EQ(m.buses[0].bitrate, 250'000U);
  EXPECT_EQ(m.buses[0].role, Role::commissioner);
  EXPECT_EQ(m.buses[0].master, NodeId(100));
  EXPECT_EQ(m.buses[0].timing.sdo_timeout, Duration(200ms));
  EXPECT_EQ(m.buses[1].port, (PortSpec{PortKind::socketcand, "host:29536/can0"}));
  EXPECT_EQ(m.buses[1].role, Role::master);
  EXPECT_EQ(m.buses[1].master, NodeId(127));
  EXPECT_EQ(m.buses[1].gateway, (Gateway{"backbone", NodeId(3), 1, false, "", "", NodeId()}));
  EXPECT_EQ(m.buses[1].timing.sdo_timeout, Duration(200ms));
  EXPECT_EQ(m.buses[1].timing.heartbeat_period, Duration(100ms));
  EXPECT_EQ(m.buses[1].timing.heartbeat_timeout, Duration(300ms));
  EXPECT_EQ(m.buses[1].timing.tries, 5U);
  EXPECT_EQ(m.buses[0].timing.tries, 3U);
  ASSERT_EQ(m.slots.size(), 5U);
  const auto& left = m.slots[0].spec;
  EXPECT_EQ(left.name, (places::SlotName{"conveyor", "backbone", "left sensor"}));
  EXPECT_EQ(left.id, NodeId(2));
  EXPECT_EQ(left.type, (TypeCode{1, 0xFFFFFFFF}));
  EXPECT_EQ(left.revision, 0x10000U);
  EXPECT_EQ(left.rule, places::RevisionRule::major);
  EXPECT_EQ(left.when_ambiguous, places::WhenAmbiguous::one_at_a_time);
  EXPECT_EQ(left.replacement, places::Replacement::automatic);
  EXPECT_EQ(left.assign, places::Assign::recipe);
  EXPECT_TRUE(left.optional);
  EXPECT_EQ(left.config, "some/where/left-sensor.dcf");
  EXPECT_EQ(left.configuring.activate, places::Activate::power_cycle);
  EXPECT_EQ(left.configuring.when, places::Configure::each_boot);
  EXPECT_EQ(m.slots[1].spec.configuring.when, places::Configure::by_date);
  EXPECT_EQ(m.buses[0].timing.save_timeout, Duration(2min));
  EXPECT_EQ(m.slots[1].spec.configuring.activate, places::Activate::at_once);
  EXPECT_EQ(m.slots[1].spec.type, (TypeCode{0x11, 0x22}));
  EXPECT_EQ(m.slots[1].eds_path, "some/where/eds/sensor.eds");
  EXPECT_EQ(m.slots[1].spec.when_ambiguous, places::WhenAmbiguous::ascending);
  EXPECT_EQ(m.slots[1].spec.replacement, places::Replacement::ask);
  EXPECT_EQ(m.slots[4].spec.name.name, "drive 9");
  EXPECT_EQ(m.slots[4].spec.id, NodeId(9));
  EXPECT_TRUE(m.slots[4].of_range);
  ASSERT_EQ(m.links.size(), 1U);
  EXPECT_EQ(m.links[0].to[0], (LinkEnd{"drive 9", "6040h:00"}));
  EXPECT_EQ(m.links[0].deadline, Duration(20ms));
  EXPECT_EQ(m.links[0].transmission, 255);
  EXPECT_EQ(m.links[0].type, std::nullopt);
  EXPECT_EQ(m.specs("drives").size(), 3U);
  EXPECT_NE(m.slot("backbone", NodeId(3)), nullptr);
  EXPECT_EQ(m.slot("drives", NodeId(3)), nullptr);
}

// S1.28: phase one, before any slave is there: Node_ID and Type_Code are fixed by the machine file; a table of
// the paper's form.
TEST(MachineFile, S1_28_NodeTableOfThePaper) {
  const auto result = load_machine(berth::test::source_dir() + "/examples/five-slaves.toml");
  ASSERT_TRUE(result.machine) << to_string(result.findings.at(0));
  const TypeCode a{0x01000001, 0x00000001};
  const TypeCode b{0x00000001, 0x00000001};
  const TypeCode c{0x00000001, 0x00000005};
  std::map<int, TypeCode> table;
  for (const auto& slot : result.machine->slots) table[slot.spec.id.value()] = slot.spec.type;
  EXPECT_EQ(table, (std::map<int, TypeCode>{{1, a}, {2, b}, {3, c}, {4, b}, {5, b}}));
  EXPECT_EQ(result.machine->buses.at(0).master, NodeId(127));
}

TEST(MachineFile, EveryExampleReads) {
  const std::map<std::string, std::size_t> examples{
      {"five-slaves", 5}, {"hundred-twenty", 120}, {"by-eds", 5}, {"configured", 3}, {"ailing", 12}};
  for (const auto& [name, slots] : examples) {
    const auto result = load_machine(berth::test::source_dir() + "/examples/" + name + ".toml");
    ASSERT_TRUE(result.machine) << to_string(result.findings.at(0));
    EXPECT_TRUE(result.findings.empty()) << to_string(result.findings.at(0));
    EXPECT_EQ(result.machine->slots.size(), slots) << name;
  }
}

// The configuration of a slot is looked at with the machine file: missing, unreadable, of another type, for another
// node.
TEST(MachineFile, AConfigurationIsLookedAt) {
  const ConfigLoader loader = [](const std::string& path, Findings& findings) -> std::optional<ConfigType> {
    if (path.ends_with("right.dcf")) return ConfigType{{1, 1}, std::nullopt, false};
    if (path.ends_with("any.cdcf")) return ConfigType{};
    if (path.ends_with("other.dcf")) return ConfigType{{1, 9}, std::nullopt, false};
    if (path.ends_with("node5.dcf")) return ConfigType{{1, 1}, NodeId(5), true};
    findings.push_back({Finding::Severity::error, path, 3, 1, "", "cannot be read", ""});
    return std::nullopt;
  };
  const auto said = [&](const std::string& line) {
    const auto result = read_machine(head + slot2 + line, "m.toml", {}, loader);
    std::string all;
    for (const auto& f : result.findings) all += to_string(f) + "\n";
    EXPECT_EQ(result.machine.has_value(), all.find("error") == std::string::npos) << all;
    return all;
  };
  EXPECT_EQ(said("config = \"right.dcf\"\n"), "");
  EXPECT_EQ(said("config = \"any.cdcf\"\n"), "");
  EXPECT_EQ(said("config = \"gone.dcf\"\n"),
            "m.toml:11:10: error: slot[1].config: \"gone.dcf\" cannot be used as a configuration; see the messages "
            "about that file\n"
            "gone.dcf:3:1: error: cannot be read\n");
  EXPECT_EQ(
      said("config = \"other.dcf\"\n"),
      "m.toml:11:10: error: slot[1].config: \"other.dcf\" is for devices of type 00000001-00000009, and the slot is "
      "for 00000001-00000001; name a configuration of the slot's type\n");
  EXPECT_EQ(
      said("config = \"node5.dcf\"\n"),
      "m.toml:11:10: warning: slot[1].config: \"node5.dcf\" was made for node-ID 5; check that its COB-IDs are "
      "written as $NODEID + n\nm.toml:11:10: warning: slot[1].config: \"node5.dcf\" sets the heartbeat 1017h, which "
      "is not used; set heartbeat_period in [timing] of the machine file\n");
  EXPECT_EQ(said("activate = \"reset\"\n"),
            "m.toml:11:12: error: slot[1].activate: the slot has no config to activate; leave the key out\n");
  EXPECT_EQ(said("config = \"right.dcf\"\nactivate = \"now\"\n").find("m.toml:12:12: error: slot[1].activate:"), 0U);
}

// What shall run in a slot's device: `programs`, `update`, and the texts of its versions.
TEST(MachineFile, TheProgramsOfASlot) {
  const std::vector<std::string> anywhere{"/"};
  const auto read = [&](const std::string& line) {
    return read_machine(head + slot2 + line, "dir/m.toml", {}, {}, {}, anywhere);
  };
  const auto good = read(
      "programs = [{ file = \"a.bprg\" }, { number = 9, file = \"/b.bin\", identification = 0x12 }, { file = \"c\" }]\n"
      "hardware_version = \"1.0\"\nsoftware_version = \"2.1\"\nupdate = \"by-hand\"\n");
  ASSERT_TRUE(good.machine) << to_string(good.findings.at(0));
  const auto& software = good.machine->slots.at(0).spec.software;
  EXPECT_EQ(software.programs, (std::vector<places::SlotProgram>{
                                   {1, "dir/a.bprg", std::nullopt}, {9, "/b.bin", 0x12}, {10, "dir/c", std::nullopt}}));
  EXPECT_EQ(software.hardware, "1.0");
  EXPECT_EQ(software.version, "2.1");
  EXPECT_FALSE(software.updates);
  const auto usual = read("programs = [{ file = \"a\" }]\n");
  ASSERT_TRUE(usual.machine);
  EXPECT_TRUE(usual.machine->slots.at(0).spec.software.updates);
  for (const char* const bad :
       {"programs = [{ number = 3 }]\n", "programs = [{ file = \"\" }]\n", "update = \"automatic\"\n",
        "programs = [{ number = 0, file = \"a\" }]\n", "programs = [{ number = 255, file = \"a\" }]\n",
        "programs = [{ number = 254, file = \"a\" }, { file = \"b\" }]\n", "programs = [{ file = \"a\", x = 1 }]\n",
        "programs = [{ number = 2, file = \"a\" }, { number = 2, file = \"b\" }]\n", "programs = \"a\"\n",
        "programs = [{ file = \"a\", identification = 0 }]\n", "programs = [{ file = \"a\" }]\nupdate = \"now\"\n"}) {
    const auto result = read(bad);
    EXPECT_FALSE(result.machine) << bad;
    EXPECT_FALSE(result.findings.empty()) << bad;
  }
}

TEST(MachineFile, TheTypeOfASlotComesFromItsDeviceDescription) {
  const auto result = load_machine(berth::test::source_dir() + "/examples/by-eds.toml");
  ASSERT_TRUE(result.machine) << to_string(result.findings.at(0));
  const auto& drive = result.machine->slot("drive 10")->spec;
  EXPECT_EQ(drive.type, (TypeCode{1, 2}));  // examples/eds/drive.eds, objects 1018h:01 and :02
  EXPECT_EQ(drive.revision, 0x00020000U);
}

// Bad input: each error names file, line and column.
TEST(MachineFile, ASlotForADeviceOfAnyType) {
  const std::string slot = head + "[[slot]]\nbus = \"b\"\nid = 2\nname = \"left\"\n";
  const auto any = read(slot + "type = \"any\"\n");
  ASSERT_TRUE(any.machine);
  EXPECT_TRUE(any.findings.empty());
  EXPECT_EQ(any.machine->slots[0].spec.asks.unasked, 3);
  EXPECT_EQ(any.machine->slots[0].spec.assign, places::Assign::fixed);
  EXPECT_EQ(any.machine->slots[0].spec.device_type, 0U);
  const auto vendor = read(slot + "type = { vendor = 7 }\n");
  ASSERT_TRUE(vendor.machine);
  EXPECT_EQ(vendor.machine->slots[0].spec.asks.unasked, 2);
  EXPECT_EQ(vendor.machine->slots[0].spec.assign, places::Assign::lss);
  const auto said = read(slot + "eds = \"nameless.eds\"\ntype = \"any\"\n");
  ASSERT_TRUE(said.machine);
  EXPECT_TRUE(said.findings.empty());
  EXPECT_EQ(said.machine->slots[0].spec.device_type, 0x0002'0192U) << "what else the description says";
  const auto unsaid = read(slot + "eds = \"nameless.eds\"\n");
  ASSERT_TRUE(unsaid.machine);
  ASSERT_EQ(unsaid.findings.size(), 1U);
  EXPECT_EQ(unsaid.findings[0].severity, Finding::Severity::warning);
  EXPECT_EQ(only_error(slot + "type = \"any\"\nassign = \"lss\"\n"),
            "11:10: error: slot[1].assign: a device of any type is known by its node-ID alone; write assign = "
            "\"fixed\", or type = { vendor = …, product = … }");
  EXPECT_FALSE(read(slot + "type = \"all\"\n").machine);
  EXPECT_FALSE(read(slot + "type = 7\n").machine);
  EXPECT_FALSE(read(slot + "eds = \"sensor.eds\"\ntype = { vendor = 1, product = 2 }\n").machine);
}

TEST(MachineFile, S5_20_ChannelsHaveTheirObjectsAndCanIds) {
  const auto channel = [](const std::string& client, const std::string& server) {
    return "[[channel]]\nclient = \"" + client + "\"\nserver = \"" + server + "\"\n";
  };
  std::string slots = head;
  for (const char* const number : {"1", "2", "3"}) {
    slots += std::string("[[slot]]\nbus = \"b\"\nid = ") + number + "\nname = \"s" + number +
             "\"\ntype = { vendor = 1, product = 1 }\n";
  }
  const auto good = read(slots + channel("s1", "s3") + channel("b/s1", "S2") + channel("s2", "s3"));
  ASSERT_TRUE(good.machine);
  const auto& channels = good.machine->buses.front().channels;
  ASSERT_EQ(channels.size(), 3U);
  EXPECT_EQ(channels[0], (Channel{NodeId(1), NodeId(3), 0x1280, 0x1201, 0x6DE}));
  EXPECT_EQ(channels[1], (Channel{NodeId(1), NodeId(2), 0x1281, 0x1201, 0x6DC}));
  EXPECT_EQ(channels[2], (Channel{NodeId(2), NodeId(3), 0x1280, 0x1202, 0x6DA}));
  const auto said = [&](const std::string& text) { return only_error(slots + text); };
  EXPECT_NE(said(channel("s1", "s1")).find("channel[1].server: client and server are one slot"), std::string::npos);
  EXPECT_NE(said(channel("s1", "s4")).find("there is no slot \"s4\""), std::string::npos);
  EXPECT_NE(said("[[channel]]\nclient = \"s1\"\n").find("channel[1].server: this key is missing"), std::string::npos);
  EXPECT_NE(said(channel("s1", "s2") + channel("s1", "s2")).find("this channel appears twice"), std::string::npos);
  EXPECT_NE(said(channel("s1", "s2") + "id = 3\n").find("unknown key"), std::string::npos);
}

TEST(MachineFile, ASlotsOwnSerialNumbersAreItsSpares) {
  const std::string fix =
      "a slot takes any device of its type; for devices that are kept for this slot write spares = [SERIAL, …]";
  EXPECT_EQ(only_error(head + slot2 + "serial = 5\n"), "11:10: error: slot[1].serial: unknown key; " + fix);
  EXPECT_EQ(only_error(head + slot2 + "serials = [5]\n"), "11:11: error: slot[1].serials: unknown key; " + fix);
}

TEST(MachineFile, SaysWhatIsWrongAndWhere) {
  EXPECT_EQ(only_error(head + "bitrat = 5\n" + slot2),
            "6:1: error: bus.b.bitrat: unknown key; did you mean \"bitrate\"?");
  EXPECT_EQ(only_error(head + slot2 + "optional = \"no\"\n"),
            "11:12: error: slot[1].optional: this is a string; it must be true or false");
  EXPECT_EQ(only_error(head + "[[slot]]\nbus = \"b\"\nid = 200\nname = \"x\"\ntype = { vendor = 1, product = 1 }\n"),
            "8:6: error: slot[1].id: 200 is not a node-ID; use 1 to 127");
  EXPECT_EQ(only_error(head + "[[slot]]\nbus = \"b\"\nid = 0\nname = \"x\"\ntype = { vendor = 1, product = 1 }\n"),
            "8:6: error: slot[1].id: 0 is not a node-ID; use 1 to 127");
  EXPECT_EQ(only_error(head + "[[slot]]\nbus = \"b\"\nid = 127\nname = \"x\"\ntype = { vendor = 1, product = 1 }\n"),
            "8:6: error: slot[1].id: node-ID 127 is the master's on bus \"b\"; use another, or change master_id");
  EXPECT_EQ(
      only_error(head + slot2 + "[[slot]]\nbus = \"b\"\nid = 2\nname = \"x\"\ntype = { vendor = 1, product = 1 }\n"),
      "13:6: error: slot[2].id: node-ID 2 is taken on bus \"b\" by slot \"left\" (line 6); a node-ID is used once on a "
      "bus");
  EXPECT_EQ(
      only_error(head + slot2 + "[[slot]]\nbus = \"b\"\nid = 3\nname = \"left\"\ntype = { vendor = 1, product = 1 }\n"),
      "14:8: error: slot[2].name: the name \"left\" is taken (line 6); slot names are unique in a machine");
  EXPECT_EQ(only_error(head + "[[slot]]\nbus = \"c\"\nid = 3\nname = \"x\"\ntype = { vendor = 1, product = 1 }\n"),
            "7:7: error: slot[1].bus: there is no bus \"c\"; the buses are \"b\"");
  EXPECT_EQ(only_error("[machine]\nname = \"m\"\n[bus.b]\nport = \"sim\"\nbitrate = 125\n"),
            "5:11: error: bus.b.bitrate: 125 bit/s is not a bit rate of classic CAN; write 125_000");
  EXPECT_EQ(only_error("[machine]\nname = \"m\"\n[bus.b]\nbitrate = 125_000\n"),
            "3:1: error: bus.b.port: this key is missing; such as \"sim\" or \"socketcan:can0\"");
  EXPECT_EQ(only_error(head + "role = \"mster\"\n"),
            "6:8: error: bus.b.role: \"mster\" is not known here; did you mean \"master\"? Use \"master\", "
            "\"commissioner\" or \"observer\"");
  EXPECT_EQ(only_error(head + slot2 + "[[link]]\nfrom = \"lft/x\"\nto = [\"left/y\"]\n"),
            "12:8: error: link[1].from: there is no slot \"lft\"; did you mean \"left\"?");
}

// S1.5: slot number = node-ID, 1..127, no two alike; names must be names.
TEST(MachineFile, EveryOtherMistakeIsAnError) {
  const std::string type = "type = { vendor = 1, product = 1 }\n";
  const std::vector<std::string> bad{
      "",
      "[machine]\nname = \"m\"\n",
      "machine = 5\n" + head.substr(head.find("[bus")),
      head + "[[slot]]\n",
      head + "[slot]\nid = 1\n",
      head + "slot = 7\n",
      "bus = { b = 3 }\n[machine]\nname = \"m\"\n",
      head + "master_id = 0\n",
      head + "master_id = 128\n",
      head + "bitrate = 125_000\n",
      head + "gateway = { bus = \"b\", slot = 2 }\n" + slot2,
      head + "gateway = { bus = \"nope\", slot = 2 }\n" + slot2,
      head + "[bus.c]\nport = \"sim\"\nbitrate = 10_000\ngateway = { bus = \"b\", slot = 9 }\n" + slot2,
      head + "[bus.c]\nport = \"sim\"\nbitrate = 10_000\ngateway = { bus = \"b\" }\n" + slot2,
      head + slot2 + "eds = \"sensor.eds\"\n",
      head + "[[slot]]\nbus = \"b\"\nid = 2\nname = \"x\"\n",
      head + "[[slot]]\nbus = \"b\"\nid = 2\nname = \"x\"\neds = \"gone.eds\"\n",
      head + "[[slot]]\nbus = \"b\"\nid = 2\nname = \"x\"\neds = \"\"\n",
      head + "[[slot]]\nbus = \"b\"\nid = 2\nname = \"x\"\ntype = { product = 1 }\n",
      head + "[[slot]]\nbus = \"b\"\nid = 2\nname = \"x\"\ntype = { vendor = 1, product = 0x1_0000_0000 }\n",
      head + "[[slot]]\nbus = \"b\"\nid = 2\nname = \"x\"\ntype = { vendor = 1, product = -1 }\n",
      head + "[[slot]]\nbus = \"b\"\nid = 2\nname = \"a/b\"\n" + type,
      head + "[[slot]]\nbus = \"b\"\nid = 2\nname = \"\"\n" + type,
      head + "[[slot]]\nbus = \"b\"\nid = 2\nname = \"x {id}\"\n" + type,
      head + "[[slot]]\nbus = \"b\"\nids = \"1..3\"\nname = \"x\"\n" + type,
      head + "[[slot]]\nbus = \"b\"\nids = \"1..128\"\nname = \"x {id}\"\n" + type,
      head + "[[slot]]\nbus = \"b\"\nid = 1\nids = \"1..3\"\nname = \"x {id}\"\n" + type,
      head + "[[slot]]\nbus = \"b\"\nids = \"125..127\"\nname = \"x {id}\"\n" + type,
      head + slot2 + "revision = \"exact\"\n",
      head + slot2 + "replacement = \"yes\"\n",
      head + slot2 + "config = \"\"\n",
      head + slot2 + "[[link]]\nfrom = \"left/x\"\n",
      head + slot2 + "[[link]]\nfrom = \"left/x\"\nto = []\n",
      head + slot2 + "[[link]]\nfrom = \"left/x\"\nto = [\"left/x\"]\n",
      head + slot2 + "[[link]]\nfrom = \"left/x\"\nto = [\"left\"]\n",
      head + slot2 + "[[link]]\nfrom = \"left/x\"\nto = [\"left/y\", \"left/y\"]\n",
      head + slot2 + "[[link]]\nfrom = \"left/x\"\nto = [\"left/y\"]\ndeadline = 20\n",
      head + "[timing]\nheartbeat_period = \"500 ms\"\nheartbeat_timeout = \"500 ms\"\n",
      head + "[timing]\nheartbeat_period = \"1.5 ms\"\n",
      head + "[timing]\nsdo_timeout = \"0 ms\"\n",
      head + "[timing]\ntries = 0\n",
  };
  for (const auto& text : bad) {
    const auto result = read(text);
    EXPECT_FALSE(result.machine) << text;
    EXPECT_TRUE(has_errors(result.findings)) << text;
  }
}

TEST(MachineFile, HowALinkIsTransmitted) {
  const std::string link = head + slot2 + "[[link]]\nfrom = \"left/x\"\nto = [\"left/y\"]\n";
  const std::vector<std::pair<std::string, int>> good{
      {"\"event\"", 255}, {"\"sync\"", 1}, {"\"sync-acyclic\"", 0}, {"0", 0}, {"240", 240}, {"254", 254}, {"255", 255}};
  for (const auto& [word, type] : good) {
    const auto result = read(link + "transmission = " + word + "\ntype = \"u16\"\n");
    ASSERT_TRUE(result.machine) << word;
    EXPECT_EQ(result.machine->links[0].transmission, type) << word;
    EXPECT_EQ(result.machine->links[0].type, od::DataType::unsigned16);
  }
  EXPECT_EQ(only_error(link + "transmission = 252\n"),
            "14:16: error: link[1].transmission: 252 is not a transmission type of a link; 0 to 240 (at SYNC), 254 or "
            "255 (at a change)");
  EXPECT_NE(only_error(link + "transmission = \"snyc\"\n").find("link[1].transmission"), std::string::npos);
  EXPECT_NE(only_error(link + "type = \"VISIBLE_STRING\"\n").find("not a data type of a network variable"),
            std::string::npos);
}

TEST(MachineFile, GatewaysInACircle) {
  const auto result = read(
      "[machine]\nname = \"m\"\n[bus.a]\nport = \"sim\"\nbitrate = 10_000\ngateway = { bus = \"b\", slot = 1 }\n"
      "[bus.b]\nport = \"sim\"\nbitrate = 10_000\ngateway = { bus = \"a\", slot = 2 }\n"
      "[[slot]]\nbus = \"b\"\nid = 1\nname = \"x\"\ntype = { vendor = 1, product = 1 }\n"
      "[[slot]]\nbus = \"a\"\nid = 2\nname = \"y\"\ntype = { vendor = 1, product = 1 }\n");
  EXPECT_FALSE(result.machine);
  ASSERT_EQ(result.findings.size(), 2U);
  EXPECT_EQ(result.findings[0].line, 6);
  EXPECT_EQ(result.findings[0].message, "these gateways form a loop");
}

// Buses on which Berth has no port are apart from the others, each above those beneath it, in whatever order they
// stand.
TEST(MachineFile, BusesWithoutAPort) {
  const std::string tail =
      "[[slot]]\nbus = \"top\"\nid = 3\nname = \"g\"\ntype = { vendor = 1, product = 2 }\n"
      "[[slot]]\nbus = \"mid\"\nid = 4\nname = \"h\"\ntype = { vendor = 1, product = 2 }\n";
  const std::string top = "[machine]\nname = \"m\"\n[bus.top]\nport = \"sim\"\nbitrate = 10_000\n";
  const std::string low =
      "[bus.low]\nport = \"gateway\"\nbitrate = 10_000\nmaster_id = 1\ngateway = { bus = \"mid\", slot = 4, port = 2 "
      "}\n";
  const std::string mid =
      "[bus.mid]\nport = \"gateway\"\nbitrate = 10_000\nmaster_id = 1\ngateway = { bus = \"top\", slot = 3 }\n";
  const auto result = read_machine(low + mid + top + tail, "m.toml", {});
  ASSERT_TRUE(result.machine) << (result.findings.empty() ? "" : to_string(result.findings.front()));
  const Machine& machine = *result.machine;
  ASSERT_EQ(machine.buses.size(), 1U);
  EXPECT_EQ(machine.buses[0].name, "top");
  ASSERT_EQ(machine.beneath.size(), 2U);
  EXPECT_EQ(machine.beneath[0].name, "mid");
  EXPECT_EQ(machine.beneath[1].name, "low");
  EXPECT_EQ(machine.beneath[1].gateway, (Gateway{"mid", NodeId(4), 2, true, "", "", NodeId()}));
  EXPECT_EQ(machine.bus("low")->master, NodeId(1));

  const auto message = [](const std::string& text) {
    const auto wrong = read_machine(text, "m.toml", {});
    return wrong.findings.empty() ? std::string() : wrong.findings.front().message;
  };
  EXPECT_EQ(message(top + "[bus.x]\nport = \"gateway\"\nbitrate = 10_000\n"), "which gateway?");
  EXPECT_EQ(message("[machine]\nname = \"m\"\n" + mid), "there is no bus \"top\"");
  // A gateway whose own node-ID there is another than 127 would be asked in vain, for minutes.
  EXPECT_EQ(message(top + "[bus.x]\nport = \"gateway\"\nbitrate = 10_000\ngateway = { bus = \"top\", slot = 3 }\n"),
            "no master_id: the gateway's own node-ID on bus \"x\" is taken to be 127");
}

TEST(MachineFile, OneMistakeDoesNotHideAnother) {
  const auto result = read(head + "rol = 1\n[[slot]]\nbus = \"b\"\nid = 300\nname = 7\ntype = 1\n");
  EXPECT_FALSE(result.machine);
  ASSERT_EQ(result.findings.size(), 4U);
  for (std::size_t i = 1; i < 4; ++i) EXPECT_LT(result.findings[i - 1].line, result.findings[i].line);
}

TEST(MachineFile, AMissingFileIsAFinding) {
  const auto result = load_machine("/nowhere/at/all.toml");
  EXPECT_FALSE(result.machine);
  ASSERT_EQ(result.findings.size(), 1U);
  EXPECT_EQ(to_string(result.findings[0]), "/nowhere/at/all.toml: error: cannot be read: No such file or directory");
}

// Whatever is done to a good file, the reader ends with a machine or with an error that has a place.
RC_GTEST_PROP(MachineFile, NeverNeitherMachineNorError, (std::uint64_t seed)) {
  Random random(seed);
  std::string text = head + slot2 + "[[link]]\nfrom = \"left/x\"\nto = [\"left/y\"]\n";
  for (std::uint64_t n = random.below(4); n-- > 0;) {
    const auto at = random.below(text.size());
    if (random.chance(500'000)) {
      text.erase(at, 1 + random.below(5));
    } else {
      text[at] = static_cast<char>(32 + random.below(95));
    }
    if (text.empty()) break;
  }
  const auto result = read(text);
  RC_ASSERT(result.machine.has_value() != has_errors(result.findings));
}

}  // namespace
// What links across a gateway need of it.
TEST(Machine, TheNodesOfGateways) {
  const std::string top = "[machine]\nname = \"m\"\n[bus.top]\nport = \"sim\"\nbitrate = 10_000\n";
  const auto low = [](const std::string& port, const std::string& more) {
    return "[bus.low]\nport = \"" + port + "\"\nbitrate = 10_000\ngateway = { bus = \"top\", slot = 3, " + more +
           " }\n";
  };
  const std::string slots =
      "[[slot]]\nbus = \"top\"\nid = 3\nname = \"g\"\ntype = { vendor = 1, product = 2 }\n"
      "[[slot]]\nbus = \"low\"\nid = 5\nname = \"own\"\ntype = { vendor = 1, product = 2 }\n";
  const auto beneath = read_machine(
      top + low("gateway", "eds = \"g/port.eds\", delay = \"250 us\", timeout = \"3 s\"") + slots, "folder/m.toml", {});
  ASSERT_TRUE(beneath.machine) << to_string(beneath.findings.front());
  const auto& gateway = *beneath.machine->bus("low")->gateway;
  EXPECT_EQ(gateway.eds, "g/port.eds");
  EXPECT_EQ(gateway.eds_path, "folder/g/port.eds");
  EXPECT_EQ(gateway.delay, Duration(250us));
  EXPECT_EQ(gateway.timeout, Duration(3s));
  EXPECT_EQ(gateway_node_name(*beneath.machine->bus("low")), "gateway on low");
  const auto with_port = read_machine(top + low("sim", "node = 5") + slots, "m.toml", {});
  ASSERT_TRUE(with_port.machine) << to_string(with_port.findings.front());
  EXPECT_EQ(with_port.machine->bus("low")->gateway->node, NodeId(5));
  EXPECT_EQ(with_port.machine->bus("low")->gateway->delay, Duration(1ms));
  EXPECT_EQ(with_port.machine->bus("low")->gateway->timeout, Duration(1s));

  const auto first_error = [](const MachineResult& result) {
    const auto it = std::ranges::find(result.findings, Finding::Severity::error, &Finding::severity);
    return it == result.findings.end() ? Finding{} : *it;
  };
  const auto error = [&](const std::string& port, const std::string& more) {
    const auto result = read_machine(top + low(port, more) + slots, "m.toml", {});
    EXPECT_FALSE(result.machine);
    return first_error(result).message;
  };
  const auto twins = read_machine(
      top + low("gateway", "delay = \"1 ms\"") +
          "[bus.twin]\nport = \"gateway\"\nbitrate = 10_000\ngateway = { bus = \"top\", slot = 3 }\n" + slots,
      "m.toml", {});
  ASSERT_FALSE(twins.machine);
  EXPECT_EQ(to_string(first_error(twins)),
            "m.toml:13:11: error: bus.twin.gateway.port: bus \"low\" is beneath port 1 of the same gateway; give the "
            "gateway's other port (1 to 8)");
  const auto lost = read_machine(
      top + low("gateway", "delay = \"1 ms\"") + slots + "[[link]]\nfrom = \"g/2000h\"\nto = [\"3/9/6000h\"]\n",
      "m.toml", {});
  ASSERT_FALSE(lost.machine);
  EXPECT_EQ(first_error(lost).message, "no slot has the path \"3/9\"");
  EXPECT_EQ(error("sim", "node = 6"), "this bus has no slot with node-ID 6");
  EXPECT_EQ(error("sim", "eds = \"x.eds\""), "Berth has a port on this bus: the gateway's own node is a slot there");
  EXPECT_EQ(error("gateway", "node = 5"), "without a port on this bus the gateway's own node is master_id");
}

}  // namespace berth::design::machine_tests
