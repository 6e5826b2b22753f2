// Verbs on buses beneath gateways, as a person uses them: a small machine of three buses, one beneath the other.
#include <fmt/format.h>

#include <gtest/gtest.h>

#include <nlohmann/json.hpp>
#include <string>

#include "command_fixture.hpp"

namespace berth::test {
namespace {

constexpr const char* tower_machine = R"([machine]
name = "tower"

[bus.backbone]
port    = "sim"
bitrate = 250_000

[bus.boom]
port      = "gateway"
bitrate   = 250_000
master_id = 1
gateway   = { bus = "backbone", slot = 3 }

[bus.tip]
port      = "gateway"
bitrate   = 125_000
master_id = 1
gateway   = { bus = "boom", slot = 5 }

[[slot]]
bus  = "tip"
id   = 2
name = "tip io"
eds  = "IO"

[[slot]]
bus  = "backbone"
id   = 2
name = "panel"
eds  = "IO"

[[slot]]
bus  = "backbone"
id   = 3
name = "boom gateway"
type = { vendor = 1, product = 0x58 }

[[slot]]
bus  = "boom"
id   = 2
name = "boom io"
eds  = "IO"

[[slot]]
bus  = "boom"
id   = 4
name = "boom lamps"
eds  = "IO"

[[slot]]
bus  = "boom"
id   = 5
name = "tip gateway"
type = { vendor = 1, product = 0x58 }
)";

constexpr const char* tower_link = R"(
[[link]]
from     = "boom io/6000h:01"
to       = ["3/4/6200h:01"]
deadline = "50 ms"
)";

constexpr const char* tower_plant = R"([plant]
seed = 3

[bus.backbone]
[bus.boom]
[bus.tip]

[[device]]
bus    = "backbone"
name   = "panel"
eds    = "IO"
serial = 11

[[device]]
bus    = "backbone"
name   = "boom gateway"
type   = { vendor = 1, product = 0x58 }
serial = 12

[[device]]
bus     = "boom"
name    = "boom port"
type    = { vendor = 1, product = 0x59 }
serial  = 20
node_id = 1
source  = "hard-coded"
master  = { flying = false, most = 10 }

[[device]]
bus    = "boom"
name   = "boom io {n}"
eds    = "IO"
count  = 2
serial_first = 21

[[device]]
bus    = "boom"
name   = "tip gateway"
type   = { vendor = 1, product = 0x58 }
serial = 23

[[device]]
bus     = "tip"
name    = "tip port"
type    = { vendor = 1, product = 0x59 }
serial  = 30
node_id = 1
source  = "hard-coded"
master  = { flying = false, most = 10 }

[[device]]
bus    = "tip"
name   = "tip io"
eds    = "IO"
serial = 31

[[gateway]]
above   = "boom gateway"
beneath = ["boom port"]
speaks_layout = [5]

[[gateway]]
above   = "tip gateway"
beneath = ["tip port"]
)";

std::string with_io(const Folder& folder, std::string text) {
  const std::string word = "\"IO\"";
  for (auto at = text.find(word); at != std::string::npos; at = text.find(word))
    text.replace(at, word.size(), "\"" + folder.bring("eds/io.eds") + "\"");
  return text;
}

class LevelsCommand : public ::testing::Test {
 protected:
  [[nodiscard]] Outcome brought_up(Words words) const {
    words.insert(words.end(), {"--machine", machine, "--sim", plant, "--up"});
    return berth(words);
  }

  Folder folder;
  std::string machine = folder.write("machine.toml", with_io(folder, tower_machine));
  std::string linked = folder.write("linked.toml", with_io(folder, tower_machine) + tower_link);
  std::string plant = folder.write("plant.toml", with_io(folder, tower_plant));
};

}  // namespace

// ---- scan ----

TEST_F(LevelsCommand, AScanOfABusBeneathWithoutARunningUp) {
  const Outcome run = berth({"scan", "--bus", "tip", "--machine", machine});
  EXPECT_EQ(run.status, 3) << run.out << run.err;
  EXPECT_FALSE(contains(run.err, "slot table")) << run.err;
  EXPECT_TRUE(contains(run.err, "no running `berth up`")) << run.err;
  EXPECT_TRUE(contains(run.err, "--sim PLANT")) << "what to do: " << run.err;
}

TEST_F(LevelsCommand, AScanOfGatewaysThatAreNewFromTheFactory) {
  const Outcome run = berth({"scan", "--all", "--machine", machine, "--sim", plant});
  EXPECT_EQ(run.status, 1) << run.out << run.err;
  EXPECT_TRUE(contains(run.out, "2 devices: 0 with a node-ID, 2 without")) << "the backbone's are told: " << run.out;
  EXPECT_TRUE(contains(run.err, "bus boom was not asked: gateway 3 (boom gateway) of bus backbone does not answer"))
      << run.err;
  EXPECT_TRUE(contains(run.err, "bus tip was not asked: bus boom above it was not reached")) << run.err;
  EXPECT_TRUE(contains(run.err, "--up")) << "what to do: " << run.err;
  const Outcome json = berth({"scan", "--all", "--machine", machine, "--sim", plant, "--json"});
  const Json reply = Json::parse(json.out);
  EXPECT_EQ(reply.at("unconfigured"), 2);
  EXPECT_EQ(reply.at("unreached").size(), 2U) << reply;
}

TEST_F(LevelsCommand, AScanOfAllBuses) {
  const Outcome run = brought_up({"scan", "--json"});
  EXPECT_EQ(run.status, 0) << run.out << run.err;
  const Json reply = Json::parse(run.out);
  EXPECT_EQ(reply.at("configured"), 6) << reply;
  EXPECT_FALSE(reply.contains("unreached")) << reply;
}

// ---- doctor ----

TEST_F(LevelsCommand, ADoctorWithoutAPortSaysWhatToDo) {
  const std::string real = folder.write("real.toml", [&] {
    std::string text = with_io(folder, tower_machine);
    return text.replace(text.find("\"sim\""), 5, "\"socketcan:no-such-interface\"");
  }());
  for (const Words& words : {Words{"doctor", real, "--bus", "boom"}, Words{"doctor", real, "--conformance", "3/4"}}) {
    const Outcome run = berth(words);
    EXPECT_EQ(run.status, 2) << run.err;
    EXPECT_TRUE(contains(run.err, "bus boom is beneath gateway 3 of bus backbone")) << run.err;
    EXPECT_TRUE(contains(run.err, "berth doctor --port can1 --bitrate 250000")) << run.err;
    EXPECT_TRUE(contains(run.err, "berth scan --bus boom")) << run.err;
  }
  const Outcome nowhere = berth({"doctor", real, "--conformance", "2/4"});
  EXPECT_EQ(nowhere.status, 2);
  EXPECT_TRUE(contains(nowhere.err, "node 2/4: no bus of the machine is there")) << nowhere.err;
}

TEST_F(LevelsCommand, ADoctorOnEverySimulatedBus) {
  const Outcome all = brought_up({"doctor", "--for", "3 s", "--json"});
  EXPECT_EQ(all.status, 0) << all.out << all.err;
  EXPECT_EQ(Json::parse(all.out).at("buses").size(), 3U) << all.out;
  const Outcome one = brought_up({"doctor", "--for", "3 s", "--bus", "tip"});
  EXPECT_EQ(one.status, 0) << one.out << one.err;
  EXPECT_TRUE(contains(one.out, "nothing wrong in 3.0 s on 1 bus")) << one.out;
}

TEST_F(LevelsCommand, ADoctorExaminesANodeByItsPath) {
  const Outcome run = brought_up({"doctor", "--conformance", "3/5/2"});
  EXPECT_TRUE(contains(run.out, "tip, node 2: CiA 301: ")) << run.out << run.err;
  EXPECT_EQ(run.status, 0) << run.out << run.err;
}

// ---- analyze ----

TEST_F(LevelsCommand, TheAnalysisHasEveryBus) {
  const Outcome all = berth({"analyze", machine, "--event", "50 ms", "--json"});
  EXPECT_EQ(all.status, 0) << all.out << all.err;
  const Json buses = Json::parse(all.out).at("buses");
  ASSERT_EQ(buses.size(), 3U) << all.out;
  EXPECT_EQ(buses[2].at("bus"), "tip");
  EXPECT_EQ(buses[2].at("bit_rate"), 125'000);
  const Outcome one = berth({"analyze", machine, "--bus", "boom"});
  EXPECT_TRUE(contains(one.out, "boom: 250000 bit/s")) << one.out << one.err;
  EXPECT_FALSE(contains(one.out, "backbone:")) << one.out;
}

TEST_F(LevelsCommand, TheAnalysisOfANodeByItsPath) {
  const Outcome run = berth({"analyze", machine, "--node", "3/5/2", "--event", "50 ms", "--json"});
  EXPECT_EQ(run.status, 0) << run.out << run.err;
  const Json buses = Json::parse(run.out).at("buses");
  ASSERT_EQ(buses.size(), 1U) << run.out;
  EXPECT_EQ(buses[0].at("bus"), "tip");
  ASSERT_FALSE(buses[0].at("messages").empty());
  for (const auto& message : buses[0].at("messages")) EXPECT_EQ(message.at("sender"), "tip io") << message;
  EXPECT_EQ(berth({"analyze", machine, "--fifo", "3/4", "--event", "50 ms"}).status, 0);
  const Outcome nobody = berth({"analyze", machine, "--node", "3/9"});
  EXPECT_EQ(nobody.status, 2);
  EXPECT_TRUE(contains(nobody.err, "node 3/9 on bus boom is neither a slot nor")) << nobody.err;
}

// ---- link ----

TEST_F(LevelsCommand, ALinkOnABusBeneath) {
  const Outcome run = berth({"link", linked, "--node", "3/4", "--links"});
  EXPECT_EQ(run.status, 0) << run.out << run.err;
  EXPECT_TRUE(contains(run.out, "boom: 250 kbit/s, 1 object in 1 PDO")) << run.out;
  EXPECT_TRUE(contains(run.out, "boom io/6000h:01 -> boom lamps/6200h:01")) << run.out;
  EXPECT_FALSE(contains(run.out, "backbone:")) << run.out;
  const Outcome none = berth({"link", linked, "--node", "3/9"});
  EXPECT_EQ(none.status, 2);
  EXPECT_TRUE(contains(none.err, "node 3/9 on bus boom is not a slot")) << none.err;
}

// The gateway's master brings it into the devices: 1F22h of its network list.
TEST_F(LevelsCommand, ALinkOnABusBeneathIsBroughtUp) {
  const Outcome run = berth({"sdo", "read", "3/4", "1400h:01", "--json", "--machine", linked, "--sim", plant, "--up"});
  ASSERT_EQ(run.status, 0) << run.out << run.err;
  const Json plan = Json::parse(berth({"link", linked, "--json"}).out).at("pdos").at(0);
  EXPECT_EQ(fmt::format("0x{:03X}", Json::parse(run.out).at("value").get<unsigned>()), plan.at("can_id"))
      << run.out << plan;
  ASSERT_EQ(plan.at("receivers").at(0).at("rpdo"), 1) << plan;
}

// ---- trace ----

TEST_F(LevelsCommand, ATraceOfWhatGatewaysCarry) {
  const std::string log = folder.write("run.log",
                                       // Gateway 3, its bus beneath, node 4: 2001h := 1234h.
                                       "(1.000000) backbone 603#2F305F0004000000\n"
                                       "(1.001000) backbone 583#60305F0000000000\n"
                                       "(1.002000) backbone 603#2B315F0034120000\n"
                                       "(1.003000) backbone 583#60315F0000000000\n"
                                       "(1.004000) backbone 603#23325F002B012000\n"
                                       "(1.005000) backbone 583#60325F0000000000\n"
                                       // Node 2 is none of a gateway's: 5F32h of it is its own.
                                       "(1.006000) backbone 602#23325F002B012000\n"
                                       "(1.007000) backbone 582#60325F0000000000\n"
                                       // From 3/4, from 3/5/2, from the gateway itself.
                                       "(1.008000) backbone 083#1023030400000000\n"
                                       "(1.009000) backbone 083#1023030502000000\n"
                                       "(1.010000) backbone 083#1023030000000000\n"
                                       // On the bus beneath, of which a port of its own has heard.
                                       "(1.011000) boom 604#2B01200034120000\n"
                                       "(1.012000) boom 584#6001200000000000\n"
                                       "(1.013000) boom 704#05\n");
  const auto rows = [&](const std::string& node) {
    return berth({"trace", log, "--machine", machine, "--node", node}).out;
  };
  const std::string four = rows("3/4");
  for (const char* const at : {"1.001000", "1.003000", "1.005000", "1.008000", "1.012000", "1.013000"})
    EXPECT_TRUE(contains(four, at)) << at << "\n" << four;
  for (const char* const at : {"1.007000", "1.009000", "1.010000"}) EXPECT_FALSE(contains(four, at)) << at << four;
  EXPECT_TRUE(contains(four, "(3/4)")) << four;
  EXPECT_EQ(rows("boom lamps"), four);
  const std::string deep = rows("3/5/2");
  EXPECT_TRUE(contains(deep, "1.009000")) << deep;
  EXPECT_FALSE(contains(deep, "1.008000")) << deep;
  EXPECT_TRUE(contains(berth({"trace", log, "--node", "3/4"}).out, "1.005000")) << "without a machine file";
  const Outcome json = berth({"trace", log, "--machine", machine, "--json", "--node", "3/5/2"});
  EXPECT_EQ(Json::parse(json.out).at("path"), "3/5/2") << json.out;
}

TEST_F(LevelsCommand, ATraceOfANodeWithoutAMachineFileNamesNoSlot) {
  const Outcome run = berth({"trace", folder.write("empty.log", ""), "--node", "boom io"});
  EXPECT_EQ(run.status, 2);
  EXPECT_TRUE(contains(run.err, "a path such as 3/5")) << run.err;
}

TEST_F(LevelsCommand, ALiveTraceOfABusWithoutAPort) {
  const Outcome run = berth({"trace", machine, "--bus", "tip"});
  EXPECT_EQ(run.status, 2) << run.out << run.err;
  EXPECT_TRUE(contains(run.err, "bus tip is beneath gateway 5 of bus boom")) << run.err;
  EXPECT_TRUE(contains(run.err, "--node 3/5/N")) << "what to do: " << run.err;
}

// ---- who does not answer ----

// Berth waits longer than the gateway, whose abort it hears; sdo_timeout is 500 ms, the gateway's second starts later.
TEST_F(LevelsCommand, ASilentNodeIsToldByItsGateway) {
  for (const std::string node : {"3/9", "3/5/9"}) {
    const Outcome run = brought_up({"sdo", "read", node, "1000h"});
    EXPECT_EQ(run.status, 1) << run.out << run.err;
    EXPECT_TRUE(contains(run.err, "node " + node + ", object 1000h:00: no answer beneath the gateway")) << run.err;
    EXPECT_TRUE(contains(run.err, "each gateway on the way")) << "what to do: " << run.err;
  }
  // Node 9 itself is asked to be a gateway, and is none.
  const Outcome nobody = brought_up({"sdo", "read", "3/9/2", "1000h", "--json"});
  EXPECT_EQ(nobody.status, 1) << nobody.out << nobody.err;
  const Json error = Json::parse(nobody.out).at("error");
  EXPECT_EQ(error.at("path"), "3/9/2") << error;
  EXPECT_TRUE(contains(error.at("message"), "no answer of the gateway")) << error;
}

// It is a slot, named as the file names it: what is missing is a port.
TEST_F(LevelsCommand, WhatNeedsAPortSaysThatThereIsNone) {
  const std::string where = "slot boom io is beneath gateway 3 of bus backbone, and Berth has no port there; ";
  const auto said = [&](Words words) {
    const Outcome outcome = brought_up(std::move(words));
    EXPECT_EQ(outcome.status, 2) << outcome.out << outcome.err;
    return outcome.err;
  };
  EXPECT_TRUE(contains(said({"locate", "boom io"}), where + "the NMT master there controls LSS and NMT"));
  EXPECT_TRUE(
      contains(said({"upload", "boom io"}), where + "`berth sdo dump` and `berth backup save` read its objects"));
  EXPECT_TRUE(contains(said({"configure", "boom io"}), where + "`berth up` brings its configuration into the gateway"));
  EXPECT_TRUE(contains(said({"replace", "boom io"}), where + "the NMT master there gives its device the node-ID"));
  EXPECT_TRUE(contains(said({"replace", "2"}), "\"2\" can be tip/tip io, backbone/panel")) << "which of them?";
  EXPECT_TRUE(contains(said({"locate", "nobody"}), "or give an LSS address or a node-ID"));
}

// Both files are known: what cannot come up is told before it is tried.
TEST_F(LevelsCommand, APlantThatContradictsTheMachineIsToldAtOnce) {
  const auto told = [&](const std::string& from, const std::string& to, const std::string& on) {
    std::string text = with_io(folder, tower_plant);
    text.replace(text.find(from), from.size(), to);
    const Outcome outcome = berth({"status", "--machine", on, "--sim", folder.write("other.toml", text)});
    return outcome.err;
  };
  const std::string none = told("seed = 3", "seed = 4", machine);
  EXPECT_TRUE(none.empty()) << none;
  const std::string id =
      told("node_id = 1\nsource  = \"hard-coded\"\nmaster  = { flying = false, most = 10 }", "", machine);
  EXPECT_TRUE(
      contains(id, "boom port: it is the gateway's own node on bus boom, which has node-ID 1 in the machine file"))
      << id;
  EXPECT_TRUE(contains(id, "node_id = 1")) << id;
  EXPECT_TRUE(contains(id, "boom port: it is the gateway's own node on bus boom, and no NMT master")) << id;
  const std::string bus = told("[[gateway]]\nabove   = \"tip gateway\"\nbeneath = [\"tip port\"]", "", machine);
  EXPECT_TRUE(contains(bus, "bus.tip: the machine file has this bus beneath a gateway, and no [[gateway]] here"))
      << bus;
  const std::string across = folder.write("across.toml", with_io(folder, tower_machine) +
                                                             "\n[[link]]\nfrom = \"panel/6000h:01\"\nto = [\"boom "
                                                             "io/6200h:01\"]\n");
  const std::string signals = told("seed = 3", "seed = 4", across);
  EXPECT_TRUE(contains(signals, "boom gateway: links of the machine file cross this gateway")) << signals;
  EXPECT_TRUE(contains(signals, "signals = 4")) << signals;
  EXPECT_FALSE(contains(told("speaks_layout = [5]", "signals = 4", across), "cross this gateway"));
}

TEST_F(LevelsCommand, APathThatIsNone) {
  const std::pair<const char*, const char*> wrong[] = {
      {"2/4", "node 2/4: node 2 on the way is no gateway to that bus: it has no object for it (5F30h to 5F4Fh)"},
      {"3/4/5", "node 3/4/5: node 4 on the way is no gateway to that bus"},
      {"3.2/5", "node 3.2/5: node 3 on the way is no gateway to that bus"},
      {"3/200", "node \"3/200\" is not a path; write node-IDs from 1 to 127"},
      {"3.9/5", "node \"3.9/5\" is not a path"},
      {"3//5", "node \"3//5\" is not a path"}};
  for (const auto& [node, text] : wrong) {
    const Outcome run = brought_up({"sdo", "read", node, "1000h"});
    EXPECT_EQ(run.status, contains(text, "not a path") ? 2 : 1) << run.out << run.err;
    EXPECT_TRUE(contains(run.err, text)) << node << ": " << run.err;
  }
}

// Of gateways that are said to wait 10 ms Berth believes after half a second that they are silent.
TEST_F(LevelsCommand, HowLongAGatewayWaitsIsInTheMachineFile) {
  std::string text = with_io(folder, tower_machine);
  for (const std::string slot : {"slot = 3", "slot = 5"}) text.insert(text.find(slot), "timeout = \"10 ms\", ");
  const std::string hasty = folder.write("hasty.toml", text);
  const Outcome run = berth({"sdo", "read", "3/9", "1000h", "--machine", hasty, "--sim", plant, "--up"});
  EXPECT_EQ(run.status, 1) << run.out << run.err;
  EXPECT_TRUE(contains(run.err, "node 3/9, object 1000h:00: no answer of the gateway")) << run.err;
}

TEST_F(LevelsCommand, APortForABusWithoutOne) {
  const Outcome run = berth({"up", machine, "--port", "boom=socketcan:can1"});
  EXPECT_EQ(run.status, 2) << run.out << run.err;
  EXPECT_TRUE(contains(run.err, "Berth has no port on bus boom (port = \"gateway\")")) << run.err;
  EXPECT_TRUE(contains(run.err, "write that port into [bus.boom]")) << "what to do: " << run.err;
}

// ---- a bus beneath with a port of its own ----

namespace {

// Berth has a port on the boom, and its gateway's own node there is a slot.
class PortBeneath : public LevelsCommand {
 protected:
  static void put(std::string& text, const std::string& from, const std::string& to) {
    const auto at = text.find(from);
    ASSERT_NE(at, std::string::npos) << from;
    text.replace(at, from.size(), to);
  }
  PortBeneath() {
    std::string text = with_io(folder, tower_machine);
    put(text, "port      = \"gateway\"\nbitrate   = 250_000\nmaster_id = 1\n", "port = \"sim\"\nbitrate = 250_000\n");
    put(text, "slot = 3 }", "slot = 3, node = 9 }");
    text += "\n[[slot]]\nbus = \"boom\"\nid = 9\nname = \"boom port\"\ntype = { vendor = 1, product = 0x59 }\n";
    machine = folder.write("machine.toml", text);
    std::string devices = with_io(folder, tower_plant);
    put(devices, "node_id = 1\nsource  = \"hard-coded\"\nmaster  = { flying = false, most = 10 }\n", "");
    plant = folder.write("plant.toml", devices);
  }
};

}  // namespace

TEST_F(PortBeneath, ComesUp) {
  const Outcome run = berth({"up", machine, "--sim", plant, "--json"});
  EXPECT_EQ(run.status, 0) << run.out << run.err;
  const Outcome scan = brought_up({"scan", "--json"});
  EXPECT_EQ(scan.status, 0) << scan.out << scan.err;
  EXPECT_EQ(Json::parse(scan.out).at("configured"), 7) << scan.out;
}

TEST_F(PortBeneath, APathGoesByThePortThatIsThere) {
  const Outcome read = brought_up({"sdo", "read", "3/4", "1018h:04", "--json"});
  ASSERT_EQ(read.status, 0) << read.out << read.err;
  EXPECT_EQ(Json::parse(read.out).at("bus"), "boom") << read.out;
  const Outcome deep = brought_up({"sdo", "read", "3/5/2", "1018h:04", "--json"});
  ASSERT_EQ(deep.status, 0) << deep.out << deep.err;
  EXPECT_EQ(Json::parse(deep.out).at("value"), 31) << deep.out;
  EXPECT_EQ(brought_up({"nmt", "stop", "3/4", "--yes"}).status, 0) << "Berth is the master there";
  EXPECT_EQ(berth({"analyze", machine, "--node", "3/4", "--event", "10 ms"}).status, 0);
  EXPECT_EQ(brought_up({"doctor", "--conformance", "3/4"}).status, 0);
}

}  // namespace berth::test
