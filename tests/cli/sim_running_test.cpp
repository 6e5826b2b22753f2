// `berth sim plug`, `power`, `fault`: a person's hands on a simulated machine that another process runs.
#include <gtest/gtest.h>
#include <signal.h>

#include <nlohmann/json.hpp>
#include <string>

#include "running_fixture.hpp"

namespace berth::test {
namespace {

// The slot `left` has device b: the smaller serial number.
TEST_F(Running, ADeviceIsUnpluggedAndPluggedByItsSlot) {
  begin(plant);
  const Outcome out = ask({"sim", "unplug", "left"});
  EXPECT_EQ(out.status, 0) << out.out;
  EXPECT_EQ(Json::parse(out.out).at("device"), "b");
  EXPECT_TRUE(wait_for("left", "absent"));
  EXPECT_EQ(ask({"sim", "unplug", "b"}).status, 1) << "it is unplugged already";
  EXPECT_EQ(ask({"sim", "plug", "2"}).status, 0) << "its slot by node-ID";
  EXPECT_TRUE(wait_for("left", "operational"));
}

TEST_F(Running, ADeviceLosesItsPowerAndGetsItBack) {
  begin(plant);
  ASSERT_TRUE(wait_for("drive", "operational"));
  EXPECT_EQ(ask({"sim", "power", "on", "c"}).status, 1) << "it has power";
  EXPECT_EQ(ask({"sim", "power", "off", "c"}).status, 0);
  EXPECT_TRUE(wait_for("drive", "absent"));
  const Json devices = Json::parse(ask({"sim", "devices"}).out).at("devices");
  EXPECT_EQ(devices.at(2).at("plugged"), true);
  EXPECT_EQ(devices.at(2).at("powered"), false);
  EXPECT_EQ(devices.at(3).at("plugged"), false) << "the spare";
  EXPECT_EQ(ask({"sim", "power", "on", "C"}).status, 0) << "in either case";
  EXPECT_TRUE(wait_for("drive", "operational"));
}

// An input that SDO cannot write: its sensor is the person's. What maps it is sent, by its event alone.
TEST_F(Running, AnInputIsSet) {
  machine = example("by-eds.toml");
  const std::string record = folder.file("run.log");
  up_ = std::make_unique<Background>(Words{"up", machine, "--sim", example("by-eds.plant.toml"), "--pace", "--control",
                                           socket, "--store", "", "--record", record});
  ASSERT_TRUE(wait_for("cabinet io", "operational"));
  const auto value = [&] { return Json::parse(ask({"sdo", "read", "cabinet io", "6000h:02"}).out).at("value"); };
  ASSERT_EQ(value(), 0);
  EXPECT_EQ(ask({"sdo", "write", "cabinet io", "6000h:02", "5"}).status, 1) << "it is read-only";
  const Outcome set = ask({"sim", "set", "cabinet io", "6000h:02", "0x85"});
  ASSERT_EQ(set.status, 0) << set.out;
  EXPECT_EQ(Json::parse(set.out).at("device"), "io");
  EXPECT_EQ(Json::parse(set.out).at("value"), 0x85);
  EXPECT_EQ(value(), 0x85);
  EXPECT_EQ(ask({"sim", "set", "20", "inputs 9 to 16", "6"}).status, 0) << "by node-ID and by name";
  EXPECT_EQ(value(), 6);
  EXPECT_EQ(ask({"sim", "set", "cabinet io", "6000h:02", "256"}).status, 2) << "it is UNSIGNED8";
  EXPECT_EQ(ask({"sim", "set", "cabinet io", "1017h", "5"}).status, 2) << "the device's own";
  EXPECT_EQ(ask({"sim", "set", "cabinet io", "7000h", "5"}).status, 2);
  EXPECT_EQ(ask({"sim", "set", "nobody", "6000h:02", "5"}).status, 2);
  EXPECT_EQ(value(), 6);
  ASSERT_EQ(ask({"sim", "unplug", "cabinet io"}).status, 0);
  EXPECT_EQ(ask({"sim", "set", "cabinet io", "6000h:02", "5"}).status, 1) << "without power it has no values";
  up_.reset();
  const std::string frames = contents(record);
  EXPECT_TRUE(contains(frames, "194#0085")) << "TPDO 1 of node 20";
  EXPECT_TRUE(contains(frames, "194#0006"));
}

// The keys are the plant file's, and what is wrong with them is told as its reader tells it.
TEST_F(Running, AnyEventOfThePlantFileCanBeMadeToHappen) {
  begin(plant);
  ASSERT_TRUE(wait_for("drive", "operational"));
  EXPECT_EQ(ask({"sim", "fault", "slow", "c"}).status, 2);
  const Outcome unit = ask({"sim", "fault", "deaf", "c", "duration=2"});
  EXPECT_EQ(unit.status, 2);
  EXPECT_TRUE(contains(unit.out, "duration")) << unit.out;
  EXPECT_TRUE(contains(ask({"sim", "fault", "def", "c"}).out, "did you mean deaf?"));
  EXPECT_EQ(ask({"sim", "fault", "deaf", "c", "at=1 s"}).status, 2) << "it happens now";
  const Outcome deaf = ask({"sim", "fault", "deaf", "c", "duration=1 h"});
  EXPECT_EQ(deaf.status, 0) << deaf.out;
  EXPECT_EQ(ask({"sdo", "read", "drive", "1018h:04"}).status, 1) << "it hears nothing";
  EXPECT_EQ(ask({"sim", "fault", "cut-cable", "nodes=a,b"}).status, 0) << "the only bus needs no name";
  EXPECT_TRUE(wait_for("left", "absent"));
  EXPECT_EQ(ask({"sim", "fault", "join"}).status, 0);
  EXPECT_TRUE(wait_for("left", "operational"));
}

// Nodes of a cut are named as devices are, by slot or node-ID too, and what is cut is told.
TEST_F(Running, ACableIsCutAndMended) {
  begin(plant);
  ASSERT_TRUE(wait_for("drive", "operational"));
  const auto pieces = [&] { return Json::parse(ask({"sim", "devices"}).out).at("cables").at(0).at("pieces"); };
  EXPECT_EQ(pieces(), Json::parse(R"([["a", "b", "c", "master"]])")) << pieces().dump();
  const Outcome cut = ask({"sim", "fault", "cut-cable", "nodes=left,c"});
  EXPECT_EQ(cut.status, 0) << cut.out;
  EXPECT_TRUE(contains(cut.out, "bus line is cut (b, c)")) << cut.out;
  EXPECT_EQ(pieces(), Json::parse(R"([["a", "master"], ["b", "c"]])")) << pieces().dump();
  EXPECT_TRUE(contains(berth({"sim", "devices", "--control", socket}).out, "bus line is cut: a, master | b, c"));
  EXPECT_TRUE(wait_for("left", "absent"));
  EXPECT_TRUE(wait_for("drive", "absent"));
  const Outcome nobody = ask({"sim", "fault", "cut-cable", "nodes=left,nobody"});
  EXPECT_EQ(nobody.status, 2);
  EXPECT_TRUE(contains(nobody.out, "called \\\"nobody\\\"")) << nobody.out;
  EXPECT_EQ(ask({"sim", "fault", "join"}).status, 0);
  EXPECT_EQ(pieces().size(), 1U);
  EXPECT_TRUE(wait_for("left", "operational"));
  EXPECT_TRUE(wait_for("drive", "operational"));
}

TEST_F(Running, ADeafOrSlowDeviceRecovers) {
  begin(plant);
  ASSERT_TRUE(wait_for("drive", "operational"));
  const auto device = [&] { return Json::parse(ask({"sim", "devices"}).out).at("devices").at(2); };
  EXPECT_EQ(device().at("slot"), "drive");
  ASSERT_EQ(ask({"sim", "fault", "slow", "drive", "latency=20 ms"}).status, 0);
  ASSERT_EQ(ask({"sim", "fault", "deaf", "drive"}).status, 0);
  EXPECT_EQ(device().at("deaf"), true);
  EXPECT_DOUBLE_EQ(device().at("late_s").get<double>(), 0.02);
  EXPECT_EQ(ask({"sdo", "read", "drive", "1018h:04"}).status, 1) << "it hears nothing";
  ASSERT_EQ(ask({"sim", "fault", "recover", "drive"}).status, 0);
  EXPECT_EQ(device().at("deaf"), false);
  EXPECT_DOUBLE_EQ(device().at("late_s").get<double>(), 0);
  EXPECT_TRUE(eventually([&] { return ask({"sdo", "read", "drive", "1018h:04"}).status == 0; }));
}

// Its boot-up shows that the firmware began anew; it keeps its place.
TEST_F(Running, ADeviceIsReset) {
  begin(plant);
  ASSERT_TRUE(wait_for("drive", "operational"));
  ASSERT_EQ(ask({"sdo", "write", "drive", "1017h", "321"}).status, 0);
  const Outcome reset = ask({"sim", "reset", "c"});
  EXPECT_EQ(reset.status, 0) << reset.out;
  EXPECT_EQ(Json::parse(reset.out).at("text"), "c is reset");
  const auto heartbeat = [&] {
    const Outcome read = ask({"sdo", "read", "drive", "1017h"});
    return read.status == 0 ? Json::parse(read.out).value("value", 0) : 321;
  };
  EXPECT_TRUE(eventually([&] { return heartbeat() != 321; })) << "what was written and not stored is gone";
  EXPECT_TRUE(wait_for("drive", "operational"));
  ASSERT_EQ(ask({"sim", "power", "off", "c"}).status, 0);
  EXPECT_EQ(ask({"sim", "reset", "c"}).status, 1) << "without power there is nothing to reset";
}

TEST_F(Running, WordsOfAFaultAreTakenOnce) {
  begin(plant);
  ASSERT_TRUE(wait_for("drive", "operational"));
  const Outcome other = ask({"sim", "fault", "deaf", "c", "duration=1 s", "action=unplug"});
  EXPECT_EQ(other.status, 2) << other.out;
  EXPECT_TRUE(contains(other.out, "the action comes first")) << other.out;
  EXPECT_EQ(ask({"sim", "fault", "deaf", "c", "duration=1 s", "duration=2 s"}).status, 2);
  EXPECT_EQ(ask({"sim", "fault", "deaf", "c", "device=a", "duration=1 s"}).status, 2);
  EXPECT_EQ(ask({"sim", "fault", "deaf", "c", "a"}).status, 2);
  EXPECT_EQ(ask({"sim", "fault", "deaf", "c", "=1"}).status, 2);
  const Outcome odd = ask({"sim", "unplug", "\"⚙\"/'x'"});
  EXPECT_EQ(odd.status, 2);
  EXPECT_TRUE(contains(odd.out, "the devices are a, b, c, spare")) << odd.out;
  const Json devices = Json::parse(ask({"sim", "devices"}).out).at("devices");
  EXPECT_EQ(devices.at(2).at("plugged"), true) << "nothing of this was done";
  const Outcome bus = ask({"sim", "devices", "--bus", "nowhere"});
  EXPECT_EQ(bus.status, 2) << bus.out;
  EXPECT_TRUE(contains(bus.out, "its buses are line")) << bus.out;
  EXPECT_EQ(ask({"sim", "unplug", "c", "--bus", "nowhere"}).status, 2);
}

TEST_F(Running, DevicesThatAreNotMeantForSureAreNamed) {
  begin(plant);
  ASSERT_TRUE(wait_for("drive", "operational"));
  const Outcome none = ask({"sim", "unplug", "spar"});
  EXPECT_EQ(none.status, 2);
  EXPECT_TRUE(contains(none.out, "did you mean spare?")) << none.out;
  EXPECT_TRUE(contains(ask({"sim", "unplug", "nobody"}).out, "the devices are a, b, c, spare"));
  EXPECT_EQ(ask({"sim", "plug", "device:drive"}).status, 2) << "no device has this name, only a slot";
}

// A slot's name that is another device's too: what fits the action counts, else both are named.
TEST_F(Running, ANameOfADeviceAndOfAnothersSlotIsToldApart) {
  std::string text(small_plant);
  text.replace(text.find("\"a\""), 3, "\"left\"");
  begin(folder.write("crossed.toml", text));
  const Outcome both = ask({"sim", "unplug", "left"});
  EXPECT_EQ(both.status, 2);
  EXPECT_TRUE(contains(both.out, "device:left")) << both.out;
  EXPECT_TRUE(contains(both.out, "slot:line/left (its device is b)")) << both.out;
  EXPECT_EQ(Json::parse(ask({"sim", "unplug", "slot:left"}).out).at("device"), "b");
  EXPECT_EQ(Json::parse(ask({"sim", "plug", "left"}).out).at("device"), "b") << "the other one is plugged in";
}

TEST_F(Running, NothingIsPulledWhereNothingRunsOrTheBusIsReal) {
  const Outcome off = berth({"sim", "unplug", "left", machine, "--control", folder.file("none.sock")});
  EXPECT_EQ(off.status, 3);
  EXPECT_TRUE(contains(off.err, "does not run: start it")) << off.err;
  std::string text = small_machine;
  text.replace(text.find("\"sim\""), 5, "\"socketcan:can7\"");
  const Outcome real = berth({"sim", "unplug", "left", folder.write("real.toml", text)});
  EXPECT_EQ(real.status, 1);
  EXPECT_TRUE(
      contains(real.err, "bus line is on socketcan:can7: on a real bus a person plugs devices and switches power"))
      << real.err;
}

// A plant in a process of its own: the `berth up` that uses it cannot pull a plug, and a client asks the plant.
TEST_F(Running, APlantByItselfTakesThemToo) {
  const std::string plant_socket = folder.file("plant.sock");
  Background alone({"plant", plant, "--listen", plant_socket, "--machine", machine});
  ASSERT_TRUE(alone.says("Ctrl-C ends it"));
  std::string text = small_machine;
  text.replace(text.find("\"sim\""), 5, "\"plant:" + plant_socket + "\"");
  text = patient(text);
  const std::string outside = folder.write("outside.toml", text);
  up_ = std::make_unique<Background>(Words{"up", outside, "--control", socket, "--yes"});
  ASSERT_TRUE(wait_for("drive", "operational"));
  const Outcome here = ask({"sim", "unplug", "drive"});
  EXPECT_EQ(here.status, 1) << "by its own socket: it has no plug to pull";
  EXPECT_TRUE(contains(here.out, "no bus of this machine is simulated in this process")) << here.out;
  EXPECT_EQ(berth({"sim", "unplug", "c", outside}).status, 0) << "by the machine's port";
  EXPECT_TRUE(wait_for("drive", "absent"));
  EXPECT_EQ(berth({"sim", "plug", "c", "--port", "plant:" + plant_socket}).status, 0) << "by the plant's socket";
  EXPECT_TRUE(wait_for("drive", "operational"));
  up_->signal(SIGTERM);
  static_cast<void>(up_->end());
}

// ---- berth world ----

TEST_F(Running, TheWorldStandsAndGoesAFrameFurther) {
  begin(plant);
  const auto world = [&](Words words) {
    words.insert(words.begin(), "world");
    return ask(words);
  };
  const Json stands = Json::parse(world({"pause"}).out);
  EXPECT_EQ(stands.at("paused"), true);
  const Json later = Json::parse(world({"pause"}).out);
  EXPECT_EQ(later.at("time_s"), stands.at("time_s")) << "its time stands";
  const Outcome step = world({"step", "3"});
  ASSERT_EQ(step.status, 0) << step.out << step.err;
  EXPECT_GT(Json::parse(step.out).at("time_s").get<double>(), stands.at("time_s").get<double>());
  EXPECT_EQ(Json::parse(world({"speed", "50"}).out).at("speed"), 50.0);
  EXPECT_EQ(Json::parse(world({"run"}).out).at("paused"), false);
  EXPECT_TRUE(eventually([&] {
    const Json now = Json::parse(world({"speed", "50"}).out);
    return now.at("time_s").get<double>() > stands.at("time_s").get<double>() + 2;
  }));
  EXPECT_EQ(world({"speed", "1"}).status, 0);
  for (const char* const factor : {"0", "-1", "1001", "fast", ""})
    EXPECT_EQ(world({"speed", factor}).status, 2) << factor;
  for (const char* const frames : {"0", "10001", "x"}) EXPECT_EQ(world({"step", frames}).status, 2) << frames;
  const Outcome damage = world({"damage", "2"});
  EXPECT_EQ(damage.status, 0) << damage.out;
  EXPECT_TRUE(contains(damage.out, "disturbed")) << damage.out;
  const Outcome of_one = world({"damage", "2", "--from", "left"});
  EXPECT_EQ(of_one.status, 0) << of_one.out;
  EXPECT_TRUE(contains(of_one.out, "only frames that b sends")) << of_one.out;
  EXPECT_EQ(world({"damage", "--from", "nobody"}).status, 2);
}

// A copy of a machine's folder has its name, too: what is asked there is not done here.
TEST_F(Command, ACopyOfTheMachineDoesNotSpeakToTheOneThatRuns) {
  const Folder other;
  const std::string copy = other.write("machine.toml", contents(machine));
  Background up({"up", machine, "--sim", plant, "--pace"});
  ASSERT_TRUE(eventually([&] { return berth({"status", machine}).status == 0; }));
  for (const Words& words : {Words{"status", copy}, Words{"sdo", "read", "left", "1018h:04", copy},
                             Words{"sim", "unplug", "a", "-m", copy}, Words{"nmt", "stop", "all", "-m", copy}}) {
    const Outcome there = berth(words);
    EXPECT_EQ(there.status, 3) << words[0] << there.out;
    EXPECT_TRUE(contains(there.err, copy) && contains(there.err, machine)) << there.err;
  }
  EXPECT_EQ(berth({"status", machine}).status, 0) << "nothing was done to it";
}

// Who, what and the answer of each request that changed something, and of no other.
TEST_F(Running, EveryChangeIsInTheAuditLog) {
  begin(plant);
  ASSERT_TRUE(wait_for("drive", "operational"));
  ASSERT_EQ(ask({"sdo", "read", "drive", "1017h"}).status, 0);
  ASSERT_EQ(ask({"sdo", "write", "drive", "1017h", "321"}).status, 0);
  ASSERT_EQ(ask({"sdo", "write", "drive", "2FFFh", "1", "--type", "u8"}).status, 1);
  ASSERT_EQ(ask({"sim", "devices"}).status, 0);
  ASSERT_EQ(ask({"sim", "unplug", "a"}).status, 0);
  const Outcome told = ask({"history", "--audit"});
  ASSERT_EQ(told.status, 0) << told.out;
  const Json audit = Json::parse(told.out).at("audit");
  ASSERT_EQ(audit.size(), 6U) << audit.dump(1);
  const auto what = [&](std::size_t i) { return audit.at(i).at("what").get<std::string>(); };
  const auto answer = [&](std::size_t i) { return audit.at(i).at("answer").get<std::string>(); };
  EXPECT_EQ(what(0), "sdo write node=drive object=1017h value=321");
  EXPECT_EQ(audit.at(0).at("who"), "control socket");
  EXPECT_EQ(answer(0), "begun") << "before it is carried out";
  EXPECT_EQ(answer(1), "done");
  EXPECT_EQ(what(1), what(0));
  EXPECT_TRUE(answer(3).starts_with("no: ")) << answer(3);
  EXPECT_TRUE(what(4).starts_with("sim action=unplug")) << what(4);
  EXPECT_GT(audit.at(5).at("stamp_ms").get<int>(), 0);
  EXPECT_FALSE(contains(ask({"history"}).out, "sdo write")) << "the history of the slots is without";
  EXPECT_EQ(ask({"history", "left", "--audit"}).status, 2);
}

// Else it looks like a bus on which nobody answers.
TEST_F(Running, AWorldThatStandsIsTold) {
  begin(plant);
  ASSERT_FALSE(Json::parse(ask({"status"}).out).contains("paused"));
  ASSERT_EQ(ask({"world", "pause"}).status, 0);
  EXPECT_EQ(Json::parse(ask({"status"}).out).at("paused"), true);
  const std::string words = "the world is paused: `berth world run` lets it go on";
  EXPECT_TRUE(contains(berth({"status", "--control", socket}).out, words));
  const Outcome read = berth({"sdo", "read", "left", "1018h:04", "--control", socket, "--timeout", "500 ms"});
  EXPECT_EQ(read.status, 3) << read.out << read.err;
  EXPECT_TRUE(contains(read.err, "no answer within 500 ms")) << read.err;
  EXPECT_TRUE(contains(read.err, words)) << read.err;
  const Outcome json = ask({"sdo", "read", "left", "1018h:04", "--timeout", "500 ms"});
  EXPECT_TRUE(contains(json.out, words)) << json.out;
  const Outcome doctor = berth({"doctor", machine, "--control", socket, "--for", "1 s"});
  EXPECT_TRUE(contains(doctor.err, words)) << doctor.out << doctor.err;
  EXPECT_NE(doctor.status, 0);
  EXPECT_FALSE(contains(doctor.out, "silent-bus")) << doctor.out;
  ASSERT_EQ(ask({"world", "run"}).status, 0);
  EXPECT_EQ(ask({"sdo", "read", "left", "1018h:04"}).status, 0);
}

// "Is the device on the bus?" is no question where its heartbeat comes.
TEST_F(Running, ASilentSdoServerOfADeviceThatIsHeardIsToldSo) {
  begin(plant);
  ASSERT_TRUE(all_operational());
  ASSERT_EQ(ask({"sim", "fault", "slow", "drive", "latency=4 s"}).status, 0);
  const Outcome read = berth({"sdo", "read", "drive", "1018h:04", "--control", socket});
  EXPECT_NE(read.status, 0) << read.out;
  EXPECT_TRUE(contains(read.err, "its other frames were heard in the last 3 s")) << read.err;
  EXPECT_FALSE(contains(read.err, "is the device on the bus")) << read.err;
  ASSERT_EQ(ask({"sim", "unplug", "left"}).status, 0);
  ASSERT_TRUE(wait_for("left", "absent"));
  const Outcome away = berth({"sdo", "read", "left", "1018h:04", "--control", socket});
  EXPECT_TRUE(contains(away.err, "slot left is absent: ")) << away.err;
  const Outcome nobody = berth({"sdo", "read", "77", "1018h:04", "--control", socket});
  EXPECT_TRUE(contains(nobody.err, "is the device on the bus and not stopped?")) << nobody.err;
}

TEST_F(Running, AnInputThatSdoCannotWriteIsSetInThePlant) {
  begin(plant);
  ASSERT_TRUE(all_operational());
  const Outcome refused = berth({"sdo", "write", "drive", "1001h", "1", "--control", socket});
  EXPECT_EQ(refused.status, 1) << refused.out << refused.err;
  EXPECT_TRUE(contains(refused.err, "06010002h")) << refused.err;
  EXPECT_TRUE(contains(refused.err, "of a simulated device `berth sim set 9 1001h:00 VALUE` sets it")) << refused.err;
}

TEST_F(Running, ARowOfTheDevicesFitsEightyColumns) {
  std::string with = small_plant;
  with.replace(with.find("name = \"a\""), 10, "name = \"light barrier of the big hall 1\"");
  begin(folder.write("long.toml", with));
  const Outcome devices = berth({"sim", "devices", "--control", socket});
  EXPECT_TRUE(contains(devices.out, "light barrier o~hall 1  ")) << devices.out;
  EXPECT_TRUE(contains(devices.out, "00000001-00000001-00000000-00000021")) << devices.out;
  std::istringstream lines(devices.out);
  for (std::string line; std::getline(lines, line);) EXPECT_LE(line.size(), 80U) << line;
}

TEST_F(Running, AWorldThatStandsEndsBySignal) {
  begin(plant);
  ASSERT_EQ(ask({"world", "pause"}).status, 0);
  up_->signal(SIGTERM);
  EXPECT_EQ(up_->end().status, 0);
}

TEST_F(Running, TimeIsHeldWhereItIsSimulatedOnly) {
  const Outcome alone = berth({"world", "pause", machine, "--control", folder.file("none.sock")});
  EXPECT_EQ(alone.status, 3);
  EXPECT_TRUE(contains(alone.err, "does not run: start it")) << alone.err;
  const std::string plant_socket = folder.file("plant.sock");
  Background plant_alone({"plant", plant, "--listen", plant_socket, "--machine", machine});
  ASSERT_TRUE(plant_alone.says("Ctrl-C ends it"));
  std::string text = small_machine;
  text.replace(text.find("\"sim\""), 5, "\"plant:" + plant_socket + "\"");
  const std::string outside = folder.write("outside.toml", patient(text));
  up_ = std::make_unique<Background>(Words{"up", outside, "--control", socket, "--yes"});
  ASSERT_TRUE(wait_for("drive", "operational"));
  const Outcome refused = ask({"world", "pause"});
  EXPECT_EQ(refused.status, 1);
  EXPECT_TRUE(contains(refused.out, "time is the clock's")) << refused.out;
}

}  // namespace
}  // namespace berth::test
