// What Berth brings into the gateways' own dictionaries: whether a bus beneath is mandatory, the layout of emergencies,
// and which hardware version the master beneath expects of whom. It holds when another master starts the machine.
#include <chrono>
#include <string>

#include "../pch.hpp"
#include "berth/co/emcy.hpp"
#include "berth/co/nmt_master.hpp"
#include "berth/rt/scope.hpp"
#include "berth/tree/gateway_settings.hpp"
#include "objects.hpp"
#include "rig.hpp"

namespace berth::tree_tests {
namespace {

using namespace std::chrono_literals;
using places::SlotState;
using Lines = std::vector<std::string>;

std::string replaced(std::string text, const std::string& from, const std::string& to) {
  const auto at = text.find(from);
  EXPECT_NE(at, std::string::npos) << from;
  return text.replace(at, from.size(), to);
}

// The machine's bus 1 needs its valve: when that does not come in 2 s, its master's boot-up has failed.
Chain needs_its_valve(int gateways, int bus, const std::string& mandatory) {
  auto made = chain(gateways);
  const auto name = "bus" + std::to_string(bus);
  const std::string above = bus == 1 ? "top" : "bus" + std::to_string(bus - 1);
  made.machine = replaced(made.machine, "gateway = { bus = \"" + above + "\", slot = 3 }\n",
                          "gateway = { bus = \"" + above + "\", slot = 3" + mandatory + " }\n");
  made.machine += "[bus." + name + ".startup]\nboot_time = \"2 s\"\n";
  made.machine = replaced(made.machine, "name = \"valve " + std::to_string(bus) + "\"\n",
                          "name = \"valve " + std::to_string(bus) + "\"\nmandatory = true\n");
  return made;
}

// Emergencies of one node, as they are on the bus.
class Emergencies final : private co::EmcyConsumer::Observer {
 public:
  explicit Emergencies(can::Dispatcher& dispatcher) : consumer_(dispatcher, *this) { consumer_.hear_all(); }
  std::vector<std::uint16_t> codes;

 private:
  void emergency(NodeId, const co::Emcy& message, rt::Time) noexcept override { codes.push_back(message.code); }
  co::EmcyConsumer consumer_;
};

// Berth has ended, the machine is switched off and on without a device beneath, and another master starts the gateway.
struct AnotherMaster {
  explicit AnotherMaster(Rig& of) : rig(of), dispatcher(rig.world().executor(), rig.port()), nmt(dispatcher) {
    rig.device("valve 1").unplug();
    rig.device("gateway 1").power(false);
    rig.run_for(2s);
    rig.device("gateway 1").power(true);
    rig.run_for(10s);
    EXPECT_EQ(rig.device("gateway 1").truth().state, NmtState::pre_operational);
    nmt.queue(co::NmtCommand::start, NodeId(3));
    rig.run_for(2s);
  }
  Rig& rig;
  can::Dispatcher dispatcher;
  Emergencies told{dispatcher};
  co::NmtMaster nmt;
};

}  // namespace

// S3.7, S3.9, paper 3 Figure 1: the gateway tells FF01h and stops.
TEST(GatewaySlot, AMandatoryBusThatFailsStopsItsGateway) {
  const auto made = needs_its_valve(1, 1, "");
  Rig rig(made.machine, made.plant);
  ASSERT_TRUE(rig.up()) << rig.log();
  rig.end();
  const AnotherMaster other(rig);
  EXPECT_EQ(other.told.codes, (std::vector<std::uint16_t>{0xFF01}));
  EXPECT_EQ(rig.device("gateway 1").truth().state, NmtState::stopped);
}

// S3.8, Figure 2: FF02h, and it stays operational.
TEST(GatewaySlot, AnOptionalBusThatFailsIsToldOnly) {
  const auto made = needs_its_valve(1, 1, ", mandatory = false");
  Rig rig(made.machine, made.plant);
  ASSERT_TRUE(rig.up()) << rig.log();
  ASSERT_TRUE(rig.run_until([&] { return rig.state("valve 1") == SlotState::operational; }, 30s)) << rig.log();
  rig.end();
  const AnotherMaster other(rig);
  EXPECT_EQ(other.told.codes, (std::vector<std::uint16_t>{0xFF02}));
  EXPECT_EQ(rig.device("gateway 1").truth().state, NmtState::operational);
}

// The same value in a gateway beneath a gateway: the master above it brings it in (1F22h).
TEST(GatewaySlot, GatewaysBeneathGetItToo) {
  const auto made = chain(3);
  Rig rig(made.machine, made.plant);
  ASSERT_TRUE(rig.up(5min)) << rig.log();
  for (const char* const name : {"gateway 1", "gateway 2", "gateway 3"}) {
    const auto& values = rig.device(name).device().values();
    EXPECT_EQ(values.get<std::uint8_t>({0x5F00, 1}), 1) << name;
    EXPECT_EQ(values.get<std::uint8_t>({0x5F03, 0}), 8) << name << ": four levels";
  }
  // What goes through a gateway is no change of its own configuration.
  rig.run_for(10s);
  for (const char* const name : {"gateway 1", "gateway 2", "gateway 3"}) {
    EXPECT_NE(rig.device(name).device().values().get<std::uint32_t>({0x1020, 1}), 0U) << name;
  }
  rig.forget_events();
  rig.begin();
  ASSERT_TRUE(rig.up()) << rig.log();
  rig.run_for(10s);
  EXPECT_EQ(rig.log().find("written"), std::string::npos) << "a later run writes nothing\n" << rig.log();
  EXPECT_EQ(rig.log().find("saving"), std::string::npos) << rig.log();
  EXPECT_EQ(rig.log().find("new network list"), std::string::npos) << rig.log();
}

// A gateway that stopped itself is started again when the bus beneath it runs again: on Berth's bus by Berth, beneath
// another gateway by that one's master, whom Berth asks.
TEST(GatewaySlot, AGatewayThatStoppedItselfIsStartedAgain) {
  for (const int level : {1, 2}) {
    SCOPED_TRACE(level);
    const auto made = needs_its_valve(2, level, "");
    Rig rig(made.machine, made.plant);
    ASSERT_TRUE(rig.up()) << rig.log();
    rig.run_for(5s);
    const auto number = std::to_string(level);
    auto& gateway = rig.device("gateway " + number);
    rig.device("valve " + number).unplug();
    rig.device("port " + number).reset();  // its bus boots anew, and fails
    ASSERT_TRUE(rig.run_until([&] { return gateway.truth().state == NmtState::stopped; }, 60s)) << rig.log();
    const bool starts = rig.run_until([&] { return gateway.truth().state == NmtState::operational; }, 15s);
    EXPECT_FALSE(starts) << "nobody starts it while its bus fails\n" << rig.log();
    EXPECT_FALSE(rig.session().operational());
    rig.device("valve " + number).plug();
    ASSERT_TRUE(rig.up()) << rig.log();
    EXPECT_EQ(gateway.truth().state, NmtState::operational);
  }
}

// A gateway that a person stopped stays stopped.
TEST(GatewaySlot, AGatewayThatAPersonStoppedStaysSo) {
  const auto made = chain(2);
  Rig rig(made.machine, made.plant);
  ASSERT_TRUE(rig.up()) << rig.log();
  rig.run_for(5s);
  rig.device("gateway 2").device().apply(co::NmtCommand::stop);
  rig.run_for(20s);
  EXPECT_EQ(rig.device("gateway 2").truth().state, NmtState::stopped);
}

// S3.16, S3.17: by the depth of the tree, Figure 9, 8 and 7.
TEST(GatewaySlot, TheLayoutIsChosenByTheDepthOfTheTree) {
  using multilevel::EmcyLayout;
  const auto layout = [](int gateways) {
    const auto machine = design::read_machine(chain(gateways).machine, "machine.toml", {}).machine;
    return tree::layout_of(*machine, "top");
  };
  EXPECT_EQ(layout(1), EmcyLayout::complete);
  EXPECT_EQ(layout(2), EmcyLayout::source_and_exit);
  EXPECT_EQ(layout(3), EmcyLayout::source_and_exit);
  EXPECT_EQ(layout(4), EmcyLayout::source);
  EXPECT_EQ(layout(5), EmcyLayout::source);
}

// Five levels: an emergency of the deepest node names all of its path, and the end of it too.
TEST(GatewaySlot, AnEmergencyFromTheFifthLevel) {
  const auto made = chain(4);
  Rig rig(made.machine, made.plant);
  ASSERT_TRUE(rig.up(10min)) << rig.log();
  rig.run_for(5s);
  rig.forget_events();
  auto& errors = rig.device("valve 4").device().errors();
  errors.raise(0x2310, co::error_register::current);
  rig.run_for(2s);
  errors.clear(0x2310);
  rig.run_for(2s);
  const auto lines = rig.told("valve 4");
  ASSERT_EQ(lines.size(), 2U) << rig.log();
  EXPECT_TRUE(lines[0].starts_with("EMCY 3/3/3/3/5: 2310h")) << lines[0];
  EXPECT_TRUE(lines[1].starts_with("EMCY 3/3/3/3/5: error 2310h gone")) << lines[1];
}

// ---- numeric hardware versions (S3.10)

// S3.10: of a gateway, checked by Berth, and of a device beneath, checked by the gateway's master: each before it is
// started.
TEST(GatewaySlot, ANumericHardwareVersionIsCheckedAtBoot) {
  for (const bool beneath : {false, true}) {
    for (const int has : {3, 4, 0}) {
      SCOPED_TRACE(std::to_string(beneath) + " has " + std::to_string(has));
      const std::string name = beneath ? "valve 1" : "gateway 1";
      auto made = chain(1);
      made.machine = replaced(made.machine, "name = \"" + name + "\"\n", "name = \"" + name + "\"\nhardware = 3\n");
      if (has != 0) {
        made.plant = replaced(made.plant, "name = \"" + name + "\"\n",
                              "name = \"" + name + "\"\nhardware = " + std::to_string(has) + "\n");
      }
      Rig rig(made.machine, made.plant);
      const bool right = has == 3;
      EXPECT_EQ(rig.up(60s), right) << rig.log();
      EXPECT_EQ(rig.device(name).truth().state == NmtState::operational, right);
      if (right || beneath) continue;
      EXPECT_EQ(rig.state(name), SlotState::failed);
      EXPECT_EQ(rig.slot(name).reason.substr(0, 2), "N:") << rig.slot(name).reason;
    }
  }
}

// ---- the objects of a machine that Berth brought up, from the backbone (S3.5, S3.37)

// S3.5: each bus's own master describes the bus below it, and is read and written from the backbone: 1F81h, 1F84h to
// 1F89h, one gateway down and two.
TEST(GatewaySlot, TheMastersBeneathAreReadAndWrittenFromTheBackbone) {
  auto made = needs_its_valve(2, 2, "");
  Rig rig(made.machine, made.plant);
  ASSERT_TRUE(rig.up()) << rig.log();
  rig.run_for(2s);
  Objects objects(rig);
  const std::vector<ObjectRef> all{{0x1F81, 5}, {0x1F84, 5}, {0x1F85, 5}, {0x1F86, 5},
                                   {0x1F87, 5}, {0x1F88, 5}, {0x1F89, 0}};
  using Values = std::vector<std::uint32_t>;
  EXPECT_EQ(objects.read("3/1", all), (Values{0x05, 0, 1, 7, 0, 0, 0}));
  EXPECT_EQ(objects.read("3/3/1", all), (Values{0x0D, 0, 1, 7, 0, 0, 2000}));
  for (const char* const path : {"3/1", "3/3/1"}) {
    std::uint32_t value = 0x1000;
    for (const ObjectRef object : all) {
      if (object.index == 0x1F81) continue;
      EXPECT_TRUE(objects.write(path, object, ++value)) << std::hex << object.index;
      EXPECT_EQ(objects.read(path, {object}), Values{value}) << std::hex << object.index;
    }
  }
}

// S3.37: NMT master: expected hardware versions, the bus beneath mandatory or optional, a sub-index of 1029h for its
// heartbeats. Slave: its hardware version, and the three entries of the SDO gateway.
TEST(GatewaySlot, TheObjectsOfMasterAndSlave) {
  auto made = chain(1);
  made.machine = replaced(made.machine, "name = \"valve 1\"\n", "name = \"valve 1\"\nhardware = 3\n");
  made.plant = replaced(made.plant, "name = \"valve 1\"\n", "name = \"valve 1\"\nhardware = 3\n");
  Rig rig(made.machine, made.plant);
  ASSERT_TRUE(rig.up()) << rig.log();
  rig.run_for(2s);
  Objects objects(rig);
  using Values = std::vector<std::uint32_t>;
  EXPECT_EQ(objects.read("3", {{0x5F00, 1}, {0x5F03, 0}, {0x1029, 0xF1}}), (Values{1, 9, 1}));
  EXPECT_EQ(objects.read("3/1", {{0x5F02, 5}, {0x5F02, 6}}), (Values{3, 0}));
  EXPECT_EQ(objects.read("3/5", {{0x5F01, 0}}), Values{3});
  const auto& upper = rig.device("gateway 1").device().values().description();
  for (const std::uint16_t index : {std::uint16_t{0x5F30}, std::uint16_t{0x5F31}, std::uint16_t{0x5F32}})
    EXPECT_NE(upper.find(index), nullptr) << index;
}

}  // namespace berth::tree_tests
