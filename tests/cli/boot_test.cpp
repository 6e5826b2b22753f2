// `berth boot`: the devices of the slots through CiA 302-2's startup, once; and `berth nmt --request` (1F82h).
#include <fmt/format.h>
#include <gtest/gtest.h>

#include <nlohmann/json.hpp>
#include <string>

#include "command_fixture.hpp"
#include "tests/pch.hpp"

namespace berth::test {
namespace {

// The devices have the node-IDs of their slots, from a run of `berth up` before.
class Boot : public ::testing::Test {
 protected:
  void SetUp() override {
    const Outcome up = run({"up", "--until", "operational"}, example("by-eds.toml"));
    ASSERT_EQ(up.status, 0) << up.out << up.err;
  }
  [[nodiscard]] Outcome run(Words words, const std::string& machine) const {
    words.insert(words.end(), {"--machine", machine, "--sim", example("by-eds.plant.toml"), "--sim-state", state,
                               "--store", folder.file("slots")});
    return berth(words);
  }
  // by-eds.toml with `text` behind its slot `name`.
  [[nodiscard]] std::string with(const std::string& slot_key, const std::string& text) const {
    std::string machine = contents(example("by-eds.toml"));
    const std::size_t at = machine.find(slot_key);
    EXPECT_NE(at, std::string::npos);
    machine.insert(machine.find('\n', at) + 1, text);
    for (std::size_t i = 0; (i = machine.find("\"eds/", i)) != std::string::npos; i += 2) {
      machine.replace(i, 5, "\"" + folder.bring("eds/"));
    }
    return folder.write("changed.toml", machine);
  }

  Folder folder;
  std::string state = folder.file("state");
};

TEST_F(Boot, EachDeviceIsResetIdentifiedAndStarted) {
  const std::string record = folder.file("boot.log");
  const Outcome outcome = run({"boot", "--json", "--record", record}, example("by-eds.toml"));
  EXPECT_EQ(outcome.status, 0) << outcome.out << outcome.err;
  const Json reply = Json::parse(outcome.out);
  EXPECT_EQ(reply.at("wrong"), 0);
  ASSERT_EQ(reply.at("slots").size(), 5U);
  for (const auto& slot : reply.at("slots")) {
    EXPECT_EQ(slot.at("state"), "operational") << slot;
    EXPECT_FALSE(slot.contains("boot")) << slot;
  }
  const std::string frames = contents(record);
  const auto reset = frames.find("000#8200");
  const auto asked = frames.find("601#4018100100000000");
  const auto started = frames.find("000#0101");
  EXPECT_LT(reset, asked);
  EXPECT_LT(asked, started);
  EXPECT_NE(started, std::string::npos);
}

// 1000h of io.eds is 30191h.
TEST_F(Boot, AnotherDeviceTypeIsC) {
  const std::string slot = "name     = \"cabinet io\"";
  const Outcome one = run({"boot", "--json"}, with(slot, "device_type = 0x30192\n"));
  EXPECT_EQ(one.status, 1) << one.out << one.err;
  const Json reply = Json::parse(one.out);
  EXPECT_EQ(reply.at("wrong"), 1);
  EXPECT_EQ(reply.at("slots").at(4).at("boot"), "C");
  EXPECT_EQ(reply.at("slots").at(0).at("state"), "operational");
  EXPECT_EQ(run({"boot"}, with(slot, "device_type = 0x30191\n")).status, 0);
}

TEST_F(Boot, AMandatoryDeviceThatFailsHaltsTheStartup) {
  const Outcome outcome = run({"boot"}, with("name     = \"cabinet io\"", "device_type = 0x30192\nmandatory = true\n"));
  EXPECT_EQ(outcome.status, 1);
  EXPECT_TRUE(contains(outcome.out, "cabinet io: C: ")) << outcome.out;
  EXPECT_TRUE(contains(outcome.out, "drive 10: ready, and not started")) << outcome.out;
  EXPECT_TRUE(contains(outcome.out, "field: node 20: the startup is halted: this mandatory slave is not ready: C: "))
      << outcome.out;
  EXPECT_TRUE(contains(outcome.err, "5 devices are not operational")) << outcome.err;
}

TEST_F(Boot, OneWithoutNodeIdIsBAndWhatIsToBeDoneIsSaid) {
  const Outcome outcome =
      berth({"boot", "--machine", example("five-slaves.toml"), "--sim", example("five-slaves.plant.toml")});
  EXPECT_EQ(outcome.status, 1);
  EXPECT_TRUE(contains(outcome.out, "s1: B: ")) << outcome.out;
  EXPECT_TRUE(contains(outcome.err, "`berth bind`")) << outcome.err;
}

TEST_F(Boot, OnATerminalEachStepIsTold) {
  const Words words{"boot", "--machine", example("by-eds.toml"), "--sim", example("by-eds.plant.toml"), "--sim-state",
                    state,  "--store",   folder.file("slots")};
  Background boot(words, OnTerminal{});
  EXPECT_TRUE(boot.says("node 1: ready"));
  EXPECT_TRUE(boot.says("node 20: started"));
  const Outcome end = boot.end();
  EXPECT_EQ(end.status, 0);
  EXPECT_FALSE(contains(end.out + end.err, "twice")) << "each device is alone: " << end.out << end.err;
  EXPECT_FALSE(contains(berth(words).out, "node 1: ready")) << "a program gets the table alone";
}

// What a boot would send, and nothing is sent: the devices keep what they have.
TEST_F(Boot, ADryRunPrintsTheFrames) {
  const Outcome dry = run({"boot", "--dry-run"}, example("by-eds.toml"));
  EXPECT_EQ(dry.status, 0) << dry.err;
  EXPECT_TRUE(contains(dry.out, "000#8200")) << dry.out;
  EXPECT_TRUE(contains(dry.out, "000#0101")) << dry.out;
}

TEST_F(Boot, WrongWordsAreUsage) {
  EXPECT_EQ(run({"boot", "--bus", "nowhere"}, example("by-eds.toml")).status, 2);
  EXPECT_EQ(run({"boot", "drive"}, example("by-eds.toml")).status, 2);
}

// Two devices of one node-ID, which both answer, the one later than the other (two equal answers at one instant are one
// frame): each request has two answers.
TEST_F(Boot, TwoDevicesUnderOneNodeIdAreTold) {
  const auto device = [this](const char* name, int serial) {
    return fmt::format(
        "[[device]]\nbus = \"field\"\nname = \"{}\"\nserial = {}\nnode_id = 1\nresponse = \"{} ms\"\neds = \"{}\"\n",
        name, serial, serial, folder.bring("eds/sensor.eds"));
  };
  const std::string one = folder.write("one.plant.toml", "[bus.field]\n" + device("a", 1));
  const std::string two = folder.write("two.plant.toml", "[bus.field]\n" + device("a", 1) + device("b", 2));
  const std::string machine = folder.write("two.toml",
                                           "[machine]\nname = \"two\"\n[bus.field]\nport = \"sim\"\nbitrate = "
                                           "250_000\nmaster_id = 127\n[[slot]]\nbus = \"field\"\n"
                                           "id = 1\nname = \"s\"\neds = \"" +
                                               folder.bring("eds/sensor.eds") + "\"\n");
  const Outcome alone = berth({"boot", "--machine", machine, "--sim", one});
  EXPECT_EQ(alone.status, 0) << alone.out << alone.err;
  EXPECT_FALSE(contains(alone.out + alone.err, "twice")) << alone.out << alone.err;
  const Outcome doubled = berth({"boot", "--machine", machine, "--sim", two});
  EXPECT_TRUE(contains(doubled.out, "answered twice: two devices have this node-ID")) << doubled.out << doubled.err;
  const Outcome json = berth({"boot", "--machine", machine, "--sim", two, "--json"});
  EXPECT_EQ(Json::parse(json.out).at("slots").at(0).value("answered_twice", false), true) << json.out;
}

// As `berth up` does: it is guarded, and the answer tells that it is operational.
TEST_F(Boot, ADeviceWithoutHeartbeatIsGuarded) {
  std::string eds = contents(example("eds/sensor.eds"));
  for (const auto& [from, to] : {std::pair{"=0x1017", "=0x1015"}, std::pair{"[1017]", "[1015]"}}) {
    ASSERT_NE(eds.find(from), std::string::npos);
    eds.replace(eds.find(from), std::string(from).size(), to);
  }
  const std::string path = folder.write("guarded.eds", eds);
  const std::string plant =
      folder.write("guarded.plant.toml",
                   "[bus.field]\n[[device]]\nbus = \"field\"\nname = \"s\"\nserial = 1\nnode_id = 1\n"
                   "eds = \"" +
                       path + "\"\n");
  const std::string machine = folder.write("guarded.toml",
                                           "[machine]\nname = \"guarded\"\n[bus.field]\nport = \"sim\"\nbitrate = "
                                           "250_000\nmaster_id = 127\n[[slot]]\nbus = \"field\"\n"
                                           "id = 1\nname = \"s\"\neds = \"" +
                                               path + "\"\n");
  const std::string record = folder.file("guarded.log");
  const Outcome outcome = berth({"boot", "--machine", machine, "--sim", plant, "--record", record});
  EXPECT_EQ(outcome.status, 0) << outcome.out << outcome.err;
  EXPECT_TRUE(contains(outcome.out, "s: operational")) << outcome.out;
  EXPECT_TRUE(contains(contents(record), "701#R")) << "node guarding";
}

// A simulated slave is no NMT master: it has no 1F82h.
TEST_F(Boot, ARequestToWhatIsNoMasterIsRefusedByIt) {
  const std::string record = folder.file("request.log");
  const Outcome outcome =
      run({"nmt", "stop", "2", "--request", "1", "--up", "--record", record}, example("by-eds.toml"));
  EXPECT_EQ(outcome.status, 1) << outcome.out << outcome.err;
  EXPECT_TRUE(contains(outcome.err, "NMT stop of node 2 by the master at node 1 (1F82h:02)")) << outcome.err;
  EXPECT_TRUE(contains(contents(record), "601#2F821F0204000000")) << "1F82h:02 = 4, stopped";
  EXPECT_FALSE(contains(contents(record), "000#0202"));
  EXPECT_EQ(run({"nmt", "stop", "2", "--request", "128"}, example("by-eds.toml")).status, 2);
}

}  // namespace
}  // namespace berth::test
