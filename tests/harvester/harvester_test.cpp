// The harvester (examples/harvester): five buses, 62 devices, Berth on the backbone alone.
#include "tests/harvester/harvester.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <chrono>
#include <map>
#include <string>
#include <utility>
#include <vector>

#include "../pch.hpp"
#include "berth/co/emcy.hpp"
#include "berth/command/execute.hpp"
#include "berth/command/verbs.hpp"
#include "berth/rt/scope.hpp"
#include "berth/tree/beneath.hpp"

namespace berth::test {
namespace {

using namespace std::chrono_literals;
using places::SlotState;

plant::PlantEvent event(plant::Action action, const std::string& device) {
  plant::PlantEvent made;
  made.action = action;
  made.device = device;
  return made;
}

struct Running : ::testing::Test {
  Running() {
    EXPECT_TRUE(machine.begin()) << machine.problem();
    EXPECT_TRUE(up(60s)) << machine.log();
    machine.run_for(2s);
  }
  bool up(rt::Duration limit) {
    return machine.run_until([&] { return machine.operational() && machine.all_run(); }, limit);
  }
  /// The cable between `node` and all others of the bus.
  void cut(const std::string& bus, const std::string& node) {
    plant::PlantEvent made;
    made.action = plant::Action::cut_cable;
    made.bus = bus;
    made.nodes = {node};
    ASSERT_TRUE(machine.world().perform(made));
  }
  void join(const std::string& bus) {
    plant::PlantEvent made;
    made.action = plant::Action::join;
    made.bus = bus;
    ASSERT_TRUE(machine.world().perform(made));
  }
  /// How often this slot was told to be absent since then.
  long absences(const std::string& slot, rt::Time since) {
    const auto lines = machine.told(slot, since);
    return std::ranges::count_if(lines, [](const auto& line) { return line.starts_with("absent"); });
  }
  std::string words(const std::string& slot, rt::Time since) {
    std::string text;
    for (const auto& line : machine.told(slot, since)) text += line + "\n";
    return text;
  }
  rt::Time now() { return machine.world().executor().now(); }
  command::Reply ask(const std::string& verb, std::map<std::string, std::string> arguments) {
    command::Request request;
    request.verb = verb;
    for (auto& [name, value] : arguments) request.arguments.emplace(name, value);
    command::Reply reply;
    rt::Scope scope(machine.world().executor());
    scope.spawn(command::execute(machine.session(), request, reply));
    EXPECT_TRUE(machine.run_until([&] { return scope.running() == 0; }, 60s)) << verb;
    return reply;
  }
  Harvester machine;
};

}  // namespace

// From blank to operational, from the bottom up: each gateway runs after the last mandatory device beneath it.
TEST(HarvesterMachine, BootsFromBlankFromTheBottomUp) {
  Harvester machine;
  ASSERT_TRUE(machine.begin()) << machine.problem();
  ASSERT_TRUE(machine.run_until([&] { return machine.operational() && machine.all_run(); }, 60s)) << machine.log();
  for (const auto& bus : machine.machine().beneath) {
    const auto* const gateway = machine.machine().slot(bus.gateway->bus, bus.gateway->slot);
    ASSERT_NE(gateway, nullptr);
    const auto above = machine.operational_at(gateway->spec.name.name);
    for (const auto& spec : machine.machine().specs(bus.name)) {
      if (!spec.mandatory) continue;
      EXPECT_LT(machine.operational_at(spec.name.name), above) << spec.name.name;
    }
  }
}

// The two undercarriages have the same node-IDs, and each device sits in the slot of its own side: node-IDs go by
// serial number, ascending.
TEST(HarvesterMachine, EqualSubsystemsStayApart) {
  Harvester machine;
  ASSERT_TRUE(machine.begin()) << machine.problem();
  ASSERT_TRUE(machine.run_until([&] { return machine.operational() && machine.all_run(); }, 60s)) << machine.log();
  for (const auto& slot : machine.machine().slots) {
    const auto truth = machine.truth(slot.spec.name.name);
    EXPECT_EQ(truth.bus, slot.spec.name.bus);
    EXPECT_EQ(truth.active, slot.spec.id) << slot.spec.name.name;
  }
}

// A run on devices that remember their node-IDs and lists: nothing is written, and all runs on.
TEST_F(Running, ALaterRunFindsEverythingInPlace) {
  const auto since = now();
  ASSERT_TRUE(machine.begin_again());
  ASSERT_TRUE(machine.run_until([&] { return machine.operational(); }, 30s)) << machine.log();
  EXPECT_EQ(machine.log().find("network list"), std::string::npos) << machine.log();
  EXPECT_EQ(machine.log().find("new network list"), std::string::npos) << machine.log();
  EXPECT_LT(now() - since, 10s);
  EXPECT_TRUE(machine.all_run());
}

// A new list is in a gateway's memory, and Berth ends before the reset that puts it to use: the next Berth finds the
// list as it is to be, and has the gateway boot its bus all the same. At each of the lists of a first start.
TEST(HarvesterMachine, BerthEndsBehindEachNewListAndTheNextOneGoesOn) {
  unsigned ended = 0;
  for (bool all_written = false; !all_written;) {
    Harvester machine;
    ASSERT_TRUE(machine.begin()) << machine.problem();
    unsigned lists = 0;
    machine.session().on_event([&](const operate::Event& each) {
      if (each.text == "its gateway has a new network list") ++lists;
    });
    const auto runs = [&] { return machine.operational() && machine.all_run(); };
    ASSERT_TRUE(machine.run_until([&] { return lists > ended || runs(); }, 60s)) << machine.log();
    all_written = lists <= ended;
    if (all_written) break;
    ++ended;
    ASSERT_TRUE(machine.begin_again());
    EXPECT_TRUE(machine.run_until(runs, 60s)) << "ended behind list " << ended << "\n" << machine.log();
  }
  EXPECT_GE(ended, 4U) << "one for each bus beneath a gateway";
}

// The cable of each bus is cut beside the gateway (the backbone's beside Berth) and put together again: every slot that
// is cut off is told once, and everything runs again.
TEST_F(Running, ABusThatIsCutIsToldOnceAndHeals) {
  const std::vector<std::pair<std::string, std::string>> cuts{{"left", "left port"},
                                                              {"right", "right port"},
                                                              {"header", "header port"},
                                                              {"reel", "reel port"},
                                                              {"backbone", "master"}};
  for (const auto& [bus, node] : cuts) {
    const auto since = now();
    cut(bus, node);
    machine.run_for(15s);
    for (const auto& spec : machine.machine().specs(bus)) {
      EXPECT_NE(machine.state(spec.name.name), SlotState::operational) << spec.name.name;
      EXPECT_EQ(absences(spec.name.name, since), 1) << spec.name.name << "\n" << machine.log();
    }
    join(bus);
    ASSERT_TRUE(up(60s)) << bus << "\n" << machine.log();
    machine.run_for(5s);
    EXPECT_TRUE(machine.operational() && machine.all_run()) << bus;
    for (const auto& spec : machine.machine().specs(bus))
      EXPECT_EQ(absences(spec.name.name, since), 1) << spec.name.name;
  }
}

// The wires of a bus beneath touch: no frame gets through, its master goes bus-off. Told once of each slot, nothing
// else is touched, and everything runs again when they are apart.
TEST_F(Running, AShortedBusIsToldOnceAndHeals) {
  for (const char* const bus : {"left", "reel"}) {
    const auto since = now();
    auto& faults = machine.world().bus(bus)->faults();
    // Dominant from the first bit behind start-of-frame on, for all.
    const unsigned wires_touch = faults.add(
        {.kind = sim::Fault::Kind::dominant, .trigger = {.times = 0}, .where = sim::from_start(1), .bits = 12});
    machine.run_for(12s);
    for (const auto& slot : machine.machine().slots) {
      const bool shorted = slot.spec.name.bus == bus;
      const auto& name = slot.spec.name.name;
      EXPECT_EQ(machine.state(name) == SlotState::operational, !shorted) << name << "\n" << machine.log();
      EXPECT_EQ(absences(name, since), shorted ? 1 : 0) << name << "\n" << words(name, since);
    }
    faults.cancel(wires_touch);
    ASSERT_TRUE(up(60s)) << bus << "\n" << machine.log();
    machine.run_for(5s);
    EXPECT_TRUE(machine.operational() && machine.all_run()) << bus;
  }
}

// A gateway whose port beneath is at another bit rate destroys that bus and no other: it is not started, its slots say
// why, once, and all others run.
TEST(HarvesterMachine, AGatewayAtAnotherBitRate) {
  Harvester machine([](design::Machine&, plant::PlantFile& plant) {
    for (auto& device : plant.devices) {
      if (device.name == "left port") device.bitrate = 125'000;
    }
  });
  ASSERT_TRUE(machine.begin()) << machine.problem();
  const auto beside = [&] {
    return std::ranges::all_of(machine.machine().slots, [&](const auto& slot) {
      const bool left = slot.spec.name.bus == "left" || slot.spec.name.name == "left gateway";
      return left || machine.state(slot.spec.name.name) == SlotState::operational;
    });
  };
  for (int second = 0; second < 120 && !beside(); ++second) machine.run_for(1s);
  ASSERT_TRUE(beside()) << machine.log();
  machine.run_for(tree::Beneath::patience);
  EXPECT_TRUE(beside()) << machine.log();
  EXPECT_FALSE(machine.operational());
  EXPECT_NE(machine.state("left gateway"), SlotState::operational);
  for (const auto& spec : machine.machine().specs("left")) {
    const auto slots = machine.session().slots();
    const auto slot = std::ranges::find(slots, spec.name.name, &operate::SlotReport::name);
    ASSERT_NE(slot, slots.end());
    EXPECT_NE(slot->state, SlotState::operational) << spec.name.name;
    EXPECT_FALSE(slot->reason.empty()) << spec.name.name << ": " << machine.log();
    EXPECT_LE(machine.told(spec.name.name, {}).size(), 1U) << machine.log();
  }
}

// A gateway that loses its power takes the bus beneath with it, and boots it before it comes back.
TEST_F(Running, AGatewayWithoutPower) {
  for (const char* const gateway : {"left gateway", "reel gateway"}) {
    const std::string motor = gateway == std::string("left gateway") ? "left front motor" : "reel motor";
    ASSERT_TRUE(machine.world().perform(event(plant::Action::power_off, gateway)));
    machine.run_for(10s);
    EXPECT_NE(machine.state(gateway), SlotState::operational);
    EXPECT_EQ(machine.state(motor), SlotState::absent) << machine.log();
    ASSERT_TRUE(machine.world().perform(event(plant::Action::power_on, gateway)));
    ASSERT_TRUE(up(60s)) << machine.log();
  }
}

// One beneath another gateway, too: it is told absent itself, once. One that restarted just before is what its bus's
// master tries to boot at that moment, and missing when that has given up.
TEST_F(Running, AGatewayThatIsLostTwoLevelsDown) {
  for (const bool restarts : {false, true}) {
    const auto since = now();
    if (restarts) machine.world().find("reel gateway")->reset();
    machine.run_for(100ms);
    machine.world().find("reel gateway")->power(false);
    machine.run_for(15s);
    EXPECT_NE(machine.state("reel gateway"), SlotState::operational) << restarts << machine.log();
    EXPECT_TRUE(machine.run_until([&] { return machine.state("reel gateway") == SlotState::absent; }, 60s))
        << restarts << machine.log();
    EXPECT_EQ(absences("reel gateway", since), 1) << words("reel gateway", since);
    EXPECT_EQ(absences("reel motor", since), 1) << words("reel motor", since);
    machine.world().find("reel gateway")->power(true);
    ASSERT_TRUE(up(60s)) << machine.log();
    machine.run_for(2s);
  }
}

// A new motor beneath one gateway, a new valve beneath two: the gateway's master gives it the node-ID of the old one.
// Berth waits for a device 500 ms, a gateway for what is beneath it a second for each level: all the same it is the
// gateway that tells who is silent, and Berth gives no access up before (0504 0000 of its own on the backbone).
TEST_F(Running, WhoIsSilentIsToldByTheGateways) {
  struct Aborts final : can::Tap {
    void frame(const can::Frame& frame, rt::Time, int) noexcept override {
      const auto text = can::to_string(frame);
      if (text.starts_with("60") && text.ends_with("00000405") && text.substr(4, 2) == "80") given_up.push_back(text);
    }
    std::vector<std::string> given_up;
  } aborts;
  machine.world().bus("backbone")->add_tap(aborts);
  for (const auto& [slot, path] : {std::pair{"left front motor", "3/2"}, std::pair{"reel motor", "5/13/2"}}) {
    machine.world().find(slot)->power(false);
    const auto reply = ask("sdo read", {{"node", path}, {"bus", "backbone"}, {"object", "1000h"}});
    EXPECT_EQ(reply.status, 1) << path;
    EXPECT_NE(reply.error.find("no answer beneath the gateway"), std::string::npos) << reply.error;
  }
  const auto since = now();
  machine.world().find("reel gateway")->power(false);
  machine.run_for(15s);
  EXPECT_EQ(absences("reel arm", since) + absences("reel lights", since), 2) << machine.log();
  EXPECT_NE(words("reel lights", since).find("gateway 13 above does not answer"), std::string::npos)
      << words("reel lights", since);
  EXPECT_EQ(absences("knife motor", since), 0) << "of the header none is told";
  EXPECT_EQ(aborts.given_up, std::vector<std::string>{});
  machine.world().bus("backbone")->remove_tap(aborts);
}

TEST_F(Running, ReplacementsBeneathGateways) {
  std::uint32_t serial = 77'000;
  for (const char* const name : {"left front motor", "reel arm"}) {
    auto& device = *machine.world().find(name);
    const auto id = device.truth().active;
    device.unplug();
    machine.run_for(5s);
    EXPECT_EQ(machine.state(name), SlotState::absent) << machine.log();
    device.next_power_on() = {.serial = ++serial, .node_id = NodeId()};
    device.plug();
    ASSERT_TRUE(up(60s)) << machine.log();
    EXPECT_EQ(device.truth().active, id);
    const auto slots = machine.session().slots();
    const auto slot = std::ranges::find(slots, name, &operate::SlotReport::name);
    ASSERT_TRUE(slot != slots.end() && slot->device);
    EXPECT_EQ(slot->device->address.serial, serial);
  }
}

// An emergency two levels down is told once, with its words.
TEST_F(Running, AnEmergencyFromTheReel) {
  const auto since = now();
  machine.world().find("reel motor")->device().errors().raise(0x4210, co::error_register::temperature);
  machine.run_for(1s);
  const auto lines = machine.told("reel motor", since);
  ASSERT_EQ(lines.size(), 1U) << machine.log();
  EXPECT_TRUE(lines.front().starts_with("EMCY 5/13/2: ")) << lines.front();
  EXPECT_NE(lines.front().find("4210h"), std::string::npos) << lines.front();
}

// Verbs by paths and by the names of slots; what a gateway does not carry is refused with the reason.
TEST_F(Running, VerbsTakePaths) {
  const auto serial = ask("sdo read", {{"node", "3/2"}, {"bus", "backbone"}, {"object", "1018h:04"}});
  EXPECT_EQ(serial.status, 0) << serial.error;
  EXPECT_NE(serial.json.find("\"path\":\"3/2\""), std::string::npos) << serial.json;
  EXPECT_NE(serial.json.find("2001"), std::string::npos) << serial.json;
  const auto by_name = ask("sdo read", {{"node", "reel motor"}, {"object", "1018h:04"}});
  EXPECT_EQ(by_name.status, 0) << by_name.error;
  EXPECT_NE(by_name.json.find("5/13/2"), std::string::npos) << by_name.json;
  EXPECT_EQ(ask("sdo write", {{"node", "5/13/2"}, {"bus", "backbone"}, {"object", "6042h"}, {"value", "-120"}}).status,
            0);
  EXPECT_EQ(machine.world().find("reel motor")->device().values().get_or<std::int16_t>({0x6042, 0}, std::int16_t{0}),
            -120);
  EXPECT_EQ(ask("emcy", {{"node", "left oil sensor"}}).status, 0);
  EXPECT_EQ(ask("sdo dump", {{"node", "header/locks"}}).status, 0);

  EXPECT_EQ(ask("nmt", {{"node", "3/2"}, {"bus", "backbone"}, {"command", "stop"}}).status, 0);
  machine.run_for(1s);
  EXPECT_EQ(machine.truth("left front motor").state, NmtState::stopped);
  EXPECT_EQ(machine.truth("right front motor").state, NmtState::operational);
  EXPECT_EQ(ask("nmt", {{"node", "left front motor"}, {"command", "start"}}).status, 0);
  machine.run_for(1s);
  EXPECT_EQ(machine.truth("left front motor").state, NmtState::operational);

  const auto scan = ask("scan", {{"bus", "reel"}});
  EXPECT_EQ(scan.status, 0) << scan.error;
  EXPECT_NE(scan.json.find("\"configured\":10"), std::string::npos) << scan.json;
  const auto lss = ask("lss find", {{"bus", "left"}});
  EXPECT_EQ(lss.status, 2);
  EXPECT_NE(lss.error.find("Berth has no port on bus"), std::string::npos) << lss.error;
  const auto nobody = ask("sdo read", {{"node", "3/99"}, {"bus", "backbone"}, {"object", "1000h"}});
  EXPECT_NE(nobody.status, 0);
  EXPECT_NE(nobody.error.find("no answer beneath the gateway"), std::string::npos) << nobody.error;
  const auto no_gateway = ask("sdo read", {{"node", "2/5"}, {"bus", "backbone"}, {"object", "1000h"}});
  EXPECT_NE(no_gateway.status, 0) << "the engine is no gateway";
}

}  // namespace berth::test
