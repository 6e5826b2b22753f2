// The NMT startup that the machine file asks for (CiA 302-2; `[bus.NAME.startup]`, `mandatory`), seen on the wire.
#include <gtest/gtest.h>

#include <algorithm>
#include <chrono>
#include <memory>
#include <string>
#include <vector>

#include "tests/harness/rig.hpp"

using namespace berth;
using namespace berth::harness;
using operate::EventKind;
using Phase = network::StartupPhase::Phase;
using places::SlotState;

namespace {

constexpr NodeId master{127};

// The NMT commands on the bus, and the states that the master's own heartbeat tells.
class Listener final : private can::Handler {
 public:
  struct Command {
    rt::Time at;
    std::uint8_t command;
    std::uint8_t node;
  };
  explicit Listener(Rig& rig)
      : port_(rig.world().attach_master("backbone")), dispatcher_(rig.world().executor(), *port_) {
    dispatcher_.add(can::only(0), *this);
    dispatcher_.add(can::only(0x700U + master.value()), *this);
  }
  [[nodiscard]] unsigned count(std::uint8_t command, unsigned node) const {
    return static_cast<unsigned>(
        std::ranges::count_if(commands, [&](const Command& c) { return c.command == command && c.node == node; }));
  }
  [[nodiscard]] unsigned count(std::uint8_t command) const {
    return static_cast<unsigned>(std::ranges::count(commands, command, &Command::command));
  }
  std::vector<Command> commands;
  std::uint8_t master_state = 0;

 private:
  void received(const can::Frame& frame, rt::Time at) noexcept override {
    if (frame.id != 0) {
      master_state = frame.data[0];
    } else {
      commands.push_back({at, frame.data[0], frame.data[1]});
    }
  }
  std::unique_ptr<sim::Controller> port_;
  can::Dispatcher dispatcher_;
};

constexpr std::uint8_t nmt_start = 0x01;
constexpr std::uint8_t nmt_stop = 0x02;
constexpr std::uint8_t nmt_reset_node = 0x81;
constexpr std::uint8_t operational = 0x05;
constexpr std::uint8_t pre_operational = 0x7F;
constexpr std::uint8_t stopped = 0x04;

// Those of many slots are alike, but for the mandatory ones.
TypeCode type_of(unsigned id, unsigned count) { return {7, count > 30 && id > 2 ? 3 : id}; }

// Slots 1 to `count`; the first two are mandatory.
design::Machine machine(unsigned count, manager::Startup rules = {}) {
  design::Machine m = one_bus(250'000);
  for (unsigned id = 1; id <= count; ++id) add_slot(m, id, type_of(id, count));
  for (unsigned id = 1; id <= std::min(count, 2U); ++id) m.slots[id - 1].spec.mandatory = true;
  rules.master = true;
  m.buses[0].startup.rules = rules;
  return m;
}

plant::PlantFile startup_plant(unsigned count) {
  auto p = one_bus_plant(11);
  for (unsigned id = 1; id <= count; ++id) add_device(p, "d" + std::to_string(id), type_of(id, count), 0x100 + id);
  return p;
}

bool told(const Rig& rig, const std::string& text) {
  return std::ranges::any_of(rig.events(), [&](const auto& e) {
    return e.kind == EventKind::startup && e.text.find(text) != std::string::npos;
  });
}

std::string reason_of(Rig& rig, unsigned id) {
  for (const auto& slot : rig.network().report()) {
    if (slot.id.value() == id) return slot.reason;
  }
  return {};
}

manager::BootStatus letter_of(Rig& rig, unsigned id) {
  for (const auto& slot : rig.network().report()) {
    if (slot.id.value() == id) return slot.boot;
  }
  return {};
}

rt::Task<void> person(operate::Network& network, co::NmtCommand command, co::NmtTarget target) {
  const auto sent = co_await network.services().nmt.send(command, target);
  EXPECT_TRUE(sent);
  network.commanded(command, target);
}

void command(Rig& rig, co::NmtCommand command, co::NmtTarget target) {
  rt::Scope scope(rig.world().executor());
  scope.spawn(person(rig.network(), command, target));
  rig.run_for(20ms);
}

}  // namespace

TEST(Startup, EachDeviceIsStartedByItselfWhereNothingElseIsAskedFor) {
  for (const unsigned count : {1U, 2U, 30U, 120U, 126U}) {
    Rig rig(machine(count), startup_plant(count));
    const Listener heard(rig);
    rig.begin();
    ASSERT_TRUE(rig.until_operational(120s)) << count << "\n" << rig.log();
    EXPECT_EQ(heard.count(nmt_start, 0), 0U);
    for (unsigned id = 1; id <= count; ++id) EXPECT_GE(heard.count(nmt_start, id), 1U) << count << ": " << id;
    rig.run_for(2s);
    EXPECT_EQ(heard.master_state, operational);
  }
}

// 1F80h bit 1: the master becomes operational, and then one command starts all. What comes later is started by itself.
TEST(Startup, TogetherIsOneStartWhenTheMandatoryOnesAreReady) {
  for (const unsigned count : {2U, 30U, 120U}) {
    Rig rig(machine(count, {.starts_all_at_once = true}), [&] {
      auto p = startup_plant(count);
      p.devices[0].plugged = false;
      return p;
    }());
    const Listener heard(rig);
    rig.begin();
    rig.run_for(30s);
    EXPECT_EQ(heard.count(nmt_start), 0U) << "d1 is mandatory and not there\n" << rig.log();
    EXPECT_EQ(rig.state(2), SlotState::present);
    EXPECT_EQ(reason_of(rig, 2), "ready; it is started when slot \"s1\" is ready, which is mandatory");
    rig.device("d1").plug();
    ASSERT_TRUE(rig.until_operational(60s)) << rig.log();
    EXPECT_EQ(heard.count(nmt_start, 0), 1U) << rig.log();
    EXPECT_EQ(heard.commands.front().node, 0) << "no other start was before it";
    rig.run_for(1s);
    EXPECT_EQ(heard.master_state, operational);
    rig.device("d2").reset();
    rig.run_for(100ms);
    ASSERT_TRUE(rig.until_operational(60s)) << rig.log();
    EXPECT_EQ(heard.count(nmt_start, 0), 1U);
    EXPECT_GE(heard.count(nmt_start, 2), 1U);
  }
}

// CiA 302-2, boot-up of a slave, C: its device type is not the expected one. A mandatory one halts the startup.
TEST(Startup, AMandatoryDeviceOfAnotherTypeHaltsIt) {
  auto m = machine(3, {.starts_all_at_once = true});
  m.slots[0].spec.device_type = 0x0003'0191;
  Rig rig(m, startup_plant(3));
  const Listener heard(rig);
  rig.begin();
  rig.run_for(10s);
  EXPECT_EQ(rig.network().startup(), Phase::halted) << rig.log();
  EXPECT_EQ(rig.state(1), SlotState::wrong_type);
  EXPECT_EQ(letter_of(rig, 1), manager::BootStatus::c);
  EXPECT_NE(reason_of(rig, 1).find("instead of 00030191h"), std::string::npos) << reason_of(rig, 1);
  EXPECT_EQ(rig.state(3), SlotState::present);
  EXPECT_EQ(reason_of(rig, 3), "ready; the startup is halted: slot \"s1\" is mandatory and not ready");
  EXPECT_EQ(heard.count(nmt_start), 0U);
  EXPECT_NE(heard.master_state, operational);
  EXPECT_TRUE(told(rig, "the startup is halted: slot \"s1\", which is mandatory")) << rig.log();
}

// Of an optional one it concerns itself alone.
TEST(Startup, AnotherDeviceTypeIsThatSlotsTroubleAlone) {
  auto m = machine(3);
  m.slots[2].spec.device_type = 0x0003'0191;
  Rig rig(m, startup_plant(3));
  rig.begin();
  ASSERT_TRUE(rig.run_until([&] { return rig.state(3) == SlotState::wrong_type; }, 10s)) << rig.log();
  ASSERT_TRUE(rig.run_until([&] { return rig.state(2) == SlotState::operational; }, 10s)) << rig.log();
  EXPECT_EQ(rig.state(1), SlotState::operational);
  EXPECT_EQ(rig.network().startup(), Phase::operational) << "all mandatory ones are ready\n" << rig.log();
}

// 1F89h. Those that were ready before it was over run; what comes behind it waits until the mandatory one is there.
TEST(Startup, TheBootTimeOverHaltsItAndTheDeviceThatWasMissingLetsItGoOn) {
  auto m = machine(3);
  m.buses[0].startup.boot_time = 4s;
  auto p = startup_plant(3);
  p.devices[0].plugged = p.devices[2].plugged = false;
  Rig rig(m, p);
  const Listener heard(rig);
  rig.begin();
  ASSERT_TRUE(rig.run_until([&] { return rig.state(2) == SlotState::operational; }, 4s)) << rig.log();
  EXPECT_EQ(rig.network().startup(), Phase::booting);
  ASSERT_TRUE(rig.run_until([&] { return rig.network().startup() == Phase::halted; }, 4s)) << rig.log();
  EXPECT_TRUE(told(rig, "slot \"s1\", which is mandatory: it was not ready within the boot time of 4 s")) << rig.log();
  rig.device("d3").plug();
  rig.run_for(10s);
  EXPECT_EQ(rig.state(3), SlotState::present) << rig.log();
  EXPECT_EQ(heard.count(nmt_start, 3), 0U);
  rig.device("d1").plug();
  ASSERT_TRUE(rig.until_operational(60s)) << rig.log();
  EXPECT_TRUE(told(rig, "the startup goes on: slot \"s1\" is ready"));
  rig.run_for(1s);
  EXPECT_EQ(heard.master_state, operational);
}

// 1F80h bit 3.
TEST(Startup, ByHandAPersonStartsWhatIsReady) {
  Rig rig(machine(3, {.application_starts = true}), startup_plant(3));
  const Listener heard(rig);
  rig.begin();
  rig.run_for(10s);
  EXPECT_EQ(heard.count(nmt_start), 0U);
  for (unsigned id = 1; id <= 3; ++id) {
    EXPECT_EQ(reason_of(rig, id), "ready; `berth nmt start` starts it (start = \"by-hand\")") << id;
  }
  command(rig, co::NmtCommand::start, NodeId(2));
  ASSERT_TRUE(rig.run_until([&] { return rig.state(2) == SlotState::operational; }, 2s)) << rig.log();
  EXPECT_EQ(rig.state(1), SlotState::present);
  command(rig, co::NmtCommand::start, co::NmtTarget::all());
  ASSERT_TRUE(rig.until_operational(5s)) << rig.log();
  rig.device("d2").reset();
  rig.run_for(5s);
  EXPECT_EQ(rig.state(2), SlotState::present) << "it booted, and waits for a person again\n" << rig.log();
  EXPECT_EQ(heard.count(nmt_start), 2U);
}

// 1F80h bit 2, and with bit 1: the start of all waits for the master.
TEST(Startup, ByHandTheMasterBecomesOperational) {
  for (const bool together : {false, true}) {
    Rig rig(machine(3, {.starts_all_at_once = together, .application_operates = true}), startup_plant(3));
    const Listener heard(rig);
    rig.begin();
    rig.run_for(15s);
    EXPECT_EQ(heard.master_state, pre_operational);
    EXPECT_EQ(rig.operational(), !together) << rig.log();
    if (together) {
      EXPECT_EQ(reason_of(rig, 3), "ready; it is started when the master is: `berth nmt start 127`");
    }
    command(rig, co::NmtCommand::start, master);
    ASSERT_TRUE(rig.until_operational(10s)) << rig.log();
    rig.run_for(1s);
    EXPECT_EQ(heard.master_state, operational);
    EXPECT_EQ(heard.count(nmt_start, 0), together ? 1U : 0U);
  }
}

// 1F80h bit 4.
TEST(Startup, AMandatoryDeviceThatIsLostResetsAll) {
  Rig rig(machine(5, {.resets_all_on_error = true}), startup_plant(5));
  const Listener heard(rig);
  rig.begin();
  ASSERT_TRUE(rig.until_operational(30s)) << rig.log();
  rig.device("d5").unplug();
  rig.run_for(5s);
  EXPECT_EQ(heard.count(nmt_reset_node, 0), 0U) << "d5 is not mandatory\n" << rig.log();
  rig.device("d5").plug();
  ASSERT_TRUE(rig.until_operational(60s)) << rig.log();
  rig.device("d1").unplug();
  rig.run_for(20s);
  EXPECT_EQ(heard.count(nmt_reset_node, 0), 1U) << rig.log();
  EXPECT_TRUE(told(rig, "slot \"s1\", which is mandatory: heartbeat lost: all devices are reset")) << rig.log();
  EXPECT_EQ(rig.state(3), SlotState::operational) << "each is started by itself again\n" << rig.log();
  EXPECT_NE(heard.master_state, operational) << "a mandatory device is missing";
  rig.device("d1").plug();
  ASSERT_TRUE(rig.until_operational(60s)) << rig.log();
  EXPECT_EQ(heard.count(nmt_reset_node, 0), 1U) << "it is back: that is no error\n" << rig.log();
  rig.run_for(1s);
  EXPECT_EQ(heard.master_state, operational);
}

// A boot-up message that no reset of the master's explains is an error event, one that a person's reset explains is
// none.
TEST(Startup, AMandatoryDeviceThatBootsByItselfResetsAllAndOneThatWasResetDoesNot) {
  Rig rig(machine(4, {.resets_all_on_error = true}), startup_plant(4));
  const Listener heard(rig);
  rig.begin();
  ASSERT_TRUE(rig.until_operational(30s)) << rig.log();
  command(rig, co::NmtCommand::reset_node, NodeId(1));
  rig.run_for(5s);
  ASSERT_TRUE(rig.until_operational(30s)) << rig.log();
  EXPECT_EQ(heard.count(nmt_reset_node, 0), 0U) << rig.log();
  rig.device("d1").reset();
  rig.run_for(5s);
  ASSERT_TRUE(rig.until_operational(30s)) << rig.log();
  EXPECT_EQ(heard.count(nmt_reset_node, 0), 1U) << rig.log();
}

// 1F80h bit 6, which is stronger than bit 4.
TEST(Startup, AMandatoryDeviceThatIsLostStopsAllUntilAPersonStartsThem) {
  Rig rig(machine(4, {.resets_all_on_error = true, .stops_all_on_error = true}), startup_plant(4));
  const Listener heard(rig);
  rig.begin();
  ASSERT_TRUE(rig.until_operational(30s)) << rig.log();
  rig.device("d2").unplug();
  rig.run_for(5s);
  EXPECT_EQ(rig.network().startup(), Phase::stopped) << rig.log();
  EXPECT_EQ(heard.count(nmt_stop, 0), 1U);
  EXPECT_EQ(heard.count(nmt_reset_node), 0U);
  EXPECT_EQ(heard.master_state, stopped);
  EXPECT_EQ(rig.device("d3").truth().state, NmtState::stopped);
  rig.device("d2").plug();
  rig.run_for(20s);
  EXPECT_EQ(rig.state(2), SlotState::present) << rig.log();
  EXPECT_EQ(reason_of(rig, 2), "ready; the network is stopped: `berth nmt start all` starts it");
  EXPECT_EQ(rig.device("d3").truth().state, NmtState::stopped) << "nothing is started behind a person's back";
  command(rig, co::NmtCommand::start, co::NmtTarget::all());
  ASSERT_TRUE(rig.until_operational(30s)) << rig.log();
  rig.run_for(1s);
  EXPECT_EQ(heard.master_state, operational);
  EXPECT_EQ(rig.network().startup(), Phase::operational);
}

// 102Ah: from the end of one command to the queueing of the next.
TEST(Startup, TheInhibitTimeIsBetweenTwoCommands) {
  auto m = machine(12);
  m.buses[0].startup.nmt_inhibit = 40ms;
  Rig rig(m, startup_plant(12));
  const Listener heard(rig);
  rig.begin();
  ASSERT_TRUE(rig.until_operational(60s)) << rig.log();
  ASSERT_GE(heard.commands.size(), 12U);
  for (std::size_t i = 1; i < heard.commands.size(); ++i) {
    EXPECT_GE(heard.commands[i].at - heard.commands[i - 1].at, 40ms) << i;
  }
}

// What runs when Berth comes is left running (L), and counts as ready.
TEST(Startup, DevicesThatRunAlreadyAreReady) {
  Rig rig(machine(3, {.starts_all_at_once = true}), startup_plant(3));
  const Listener heard(rig);
  rig.begin();
  ASSERT_TRUE(rig.until_operational(30s)) << rig.log();
  const auto before = heard.commands.size();
  rig.kill();
  rig.run_for(1s);
  rig.begin();
  ASSERT_TRUE(rig.until_operational(30s)) << rig.log();
  EXPECT_EQ(letter_of(rig, 3), manager::BootStatus::l);
  rig.run_for(2s);
  EXPECT_EQ(heard.master_state, operational);
  EXPECT_EQ(rig.device("d3").truth().state, NmtState::operational);
  for (std::size_t i = before; i < heard.commands.size(); ++i) {
    EXPECT_EQ(heard.commands[i].command, nmt_start) << "nothing else disturbs them";
  }
}
