// The NMT startup of CiA 302-2 (docs/protocols/cia302.md §Boot-up of a network) over a simulated bus with whole
// devices.
#include "tests/network/network_rig.hpp"

using namespace berth;
using namespace berth::manager;
using namespace berth::network;
using namespace berth::network::test;
using co::NmtCommand;
using Kind = NetworkEvent::Kind;
using Phase = NetworkBoot::Phase;
using namespace std::chrono_literals;

// S5.15: reset communication, each slave booted, then slaves and master operational.
TEST(NetworkBoot, FromResetToOperational) {
  for (std::uint64_t seed = 0; seed < 4; ++seed) {
    NetworkRig rig(seed);
    for (std::uint8_t id = 1; id <= 5; ++id) rig.add(id, id % 2 == 1);
    rig.begin();
    ASSERT_TRUE(rig.run_to(Phase::operational));
    rig.run(20ms);
    EXPECT_EQ(rig.frames.front(), "000#8200") << "one command for all";
    for (auto& [id, station] : rig.stations) {
      EXPECT_EQ(station->state(), NmtState::operational) << int{id};
      EXPECT_EQ(rig.status(id).phase, SlavePhase::started);
      EXPECT_TRUE(rig.status(id).supervised);
      EXPECT_EQ(rig.count(Kind::slave_ready, id), 1U);
      EXPECT_EQ(rig.count("000#010" + std::to_string(id)), 1U) << "1F80h bit 1 = 0: each by itself";
    }
    EXPECT_EQ(rig.commands().size(), 6U);
    EXPECT_EQ(rig.applied, std::vector{NmtCommand::start}) << "the master";
    EXPECT_EQ(rig.count(Kind::not_sent), 0U);
  }
}

// All at once: the boot-up of 100 devices takes hardly longer than that of one.
TEST(NetworkBoot, SlavesAreBootedSideBySide) {
  const auto time_for = [](std::uint8_t slaves) {
    NetworkRig rig;
    for (std::uint8_t id = 1; id <= slaves; ++id) rig.add(id, true);
    rig.begin();
    const auto began = rig.world.now();
    EXPECT_TRUE(rig.run_to(Phase::operational));
    return rig.world.now() - began;
  };
  const auto one = time_for(1);
  EXPECT_LT(time_for(100), one + 150ms);
}

// S5.12, 1F80h bit 1: one start for all, when the mandatory ones are ready; who is ready later is started by itself.
TEST(NetworkBoot, HC2_10_OneStartForAll) {
  NetworkRig rig;
  rig.plan.startup.starts_all_at_once = true;
  rig.add(1, true);
  rig.add(2, true);
  rig.add(3).off();
  rig.begin();
  ASSERT_TRUE(rig.run_to(Phase::operational));
  rig.run(20ms);
  EXPECT_EQ(rig.commands(), (std::vector<std::string>{"000#8200", "000#0100"}));
  EXPECT_EQ(rig.status(1).phase, SlavePhase::started);
  EXPECT_EQ(rig.count(Kind::slave_started, 2), 1U);
  rig.stations[3]->on();
  rig.run(3s);
  EXPECT_EQ(rig.stations[3]->state(), NmtState::operational);
  EXPECT_EQ(rig.commands().back(), "000#0103");
}

// 1F80h bit 2: the application makes the master operational, here by its own device or by the call.
TEST(NetworkBoot, TheApplicationMakesTheMasterOperational) {
  for (const bool by_call : {true, false}) {
    NetworkRig rig;
    rig.plan.startup.application_operates = true;
    rig.plan.startup.starts_all_at_once = true;
    rig.add(1, true);
    rig.begin();
    ASSERT_FALSE(rig.network.operate()) << "not yet";
    ASSERT_TRUE(rig.run_to(Phase::ready));
    rig.run(5s);
    EXPECT_EQ(rig.stations[1]->state(), NmtState::pre_operational);
    EXPECT_TRUE(rig.applied.empty());
    if (by_call) {
      EXPECT_TRUE(rig.network.operate());
    } else {
      rig.network.own_state(NmtState::operational);
    }
    rig.run(20ms);
    EXPECT_EQ(rig.network.phase(), Phase::operational);
    EXPECT_EQ(rig.stations[1]->state(), NmtState::operational);
    EXPECT_EQ(rig.count("000#0100"), 1U);
  }
}

// 1F80h bit 3: the application starts the slaves.
TEST(NetworkBoot, HC2_10_TheApplicationStartsTheSlaves) {
  for (const bool all_at_once : {true, false}) {
    NetworkRig rig;
    rig.plan.startup.application_starts = true;
    rig.plan.startup.starts_all_at_once = all_at_once;
    rig.add(1, true);
    rig.begin();
    ASSERT_TRUE(rig.run_to(Phase::operational));
    rig.run(2s);
    EXPECT_EQ(rig.commands(), std::vector<std::string>{"000#8200"});
    EXPECT_EQ(rig.status(1).phase, SlavePhase::ready);
    rig.network.command(NmtCommand::start, NodeId(1));
    rig.run(20ms);
    EXPECT_EQ(rig.stations[1]->state(), NmtState::operational);
    EXPECT_EQ(rig.status(1).phase, SlavePhase::started);
  }
}

// S5.13, 1F81h bit 4: with a keep-alive slave every other node-ID is reset by itself, the master's not.
TEST(NetworkBoot, HC2_10_AKeepAliveSlaveThatRunsIsLeftAlone) {
  NetworkRig rig;
  rig.add(1, true);
  auto& alive = rig.add(2, true);
  rig.rules_of(2).keep_alive = true;
  rig.run(50ms);
  alive.device.apply(NmtCommand::start);
  rig.begin();
  ASSERT_TRUE(rig.run_to(Phase::operational));
  rig.run(20ms);
  EXPECT_EQ(rig.count("000#8200"), 0U);
  EXPECT_EQ(rig.count("000#8201"), 1U);
  EXPECT_EQ(rig.count("000#8202"), 0U);
  EXPECT_EQ(rig.count("000#827E"), 1U) << "also those that are in no list";
  EXPECT_EQ(rig.count("000#827F"), 0U) << "the master";
  EXPECT_EQ(rig.count("702#00"), 0U) << "no boot-up";
  EXPECT_EQ(rig.count("000#0102"), 0U) << "L is not started";
  EXPECT_EQ(letter(rig.status(2).result.status), 'L');
  EXPECT_EQ(rig.status(2).phase, SlavePhase::started);
  EXPECT_EQ(alive.state(), NmtState::operational);
}

// A keep-alive slave that is not operational is reset by step 4 of its boot-up: that boot-up message is none of an
// error, and nothing is done twice.
TEST(NetworkBoot, AKeepAliveSlaveThatDoesNotRunIsResetOnce) {
  for (std::uint64_t seed = 0; seed < 4; ++seed) {
    NetworkRig rig(seed);
    rig.add(2, true);
    rig.rules_of(2).keep_alive = true;
    rig.begin();
    ASSERT_TRUE(rig.run_to(Phase::operational));
    rig.run(1s);
    EXPECT_EQ(rig.count("000#8202"), 1U);
    EXPECT_EQ(rig.count("702#00"), 1U);
    EXPECT_EQ(rig.count(Kind::slave_ready, 2), 1U);
    EXPECT_EQ(rig.stations[2]->state(), NmtState::operational);
  }
}

// S5.16: no answer, and mandatory: after the boot time (1F89h) the application is told which and why, and the startup
// is stopped. The others are not started either.
TEST(NetworkBoot, HC2_10_TheBootTimeRunsOutForASilentMandatorySlave) {
  NetworkRig rig;
  rig.plan.startup.starts_all_at_once = true;
  rig.plan.boot_time = 5s;
  rig.add(1, true);
  rig.add(2, true).off();
  rig.begin();
  const auto began = rig.world.now();
  ASSERT_TRUE(rig.run_to(Phase::halted));
  EXPECT_LE(rig.world.now() - began, 5s);
  EXPECT_GT(rig.world.now() - began, 3s);
  ASSERT_EQ(rig.events.back().kind, Kind::halted);
  EXPECT_EQ(rig.events.back().node, NodeId(2));
  EXPECT_EQ(letter(rig.events.back().status), 'B');
  EXPECT_EQ(letter(rig.status(2).result.status), 'B');
  EXPECT_NE(text(rig.events.back()).find("node 2: the startup is halted"), std::string::npos);
  EXPECT_EQ(rig.status(1).phase, SlavePhase::ready);
  rig.run(10s);
  EXPECT_EQ(rig.commands(), std::vector<std::string>{"000#8200"});
  EXPECT_TRUE(rig.applied.empty());
  const auto refused = rig.network.operate();
  ASSERT_FALSE(refused);
  EXPECT_EQ(refused.error().node, 2);
}

// A slave that answers, and whose boot-up takes longer than the boot time, halts the startup as well.
TEST(NetworkBoot, TheBootTimeRunsOutForASlowMandatorySlave) {
  struct Slow final : BootSource {
    rt::Task<Result<void>> configure(BootTarget&, SlaveRules&) override {
      co_await rt::sleep_for(10s);
      co_return Result<void>{};
    }
  } slow;
  NetworkRig rig;
  rig.plan.boot_time = 2s;
  rig.add(1, true);
  rig.plan.slaves[0].source = &slow;
  rig.begin();
  const auto began = rig.world.now();
  ASSERT_TRUE(rig.run_to(Phase::halted));
  EXPECT_EQ(rig.world.now() - began, 2s);
  EXPECT_EQ(rig.events.back().node, NodeId(1));
  EXPECT_NE(text(rig.events.back()).find("1F89h"), std::string::npos);
  rig.run(10s);
  EXPECT_EQ(rig.status(1).phase, SlavePhase::ready) << "it is booted to its end, and not started";
  EXPECT_EQ(rig.count("000#0101"), 0U);
  EXPECT_EQ(rig.network.phase(), Phase::halted);
  ASSERT_TRUE(rig.network.operate()) << "the application goes on";
  rig.run(20ms);
  EXPECT_EQ(rig.stations[1]->state(), NmtState::operational);
}

// Boot time 0: a mandatory slave is waited for as long as it takes.
TEST(NetworkBoot, HC2_10_WithoutABootTimeItWaits) {
  NetworkRig rig;
  rig.add(1, true).off();
  rig.add(2);
  rig.begin();
  rig.run(1h);
  EXPECT_EQ(rig.network.phase(), Phase::booting);
  EXPECT_EQ(rig.stations[2]->state(), NmtState::operational) << "optional, started by itself";
  rig.stations[1]->on();
  ASSERT_TRUE(rig.run_to(Phase::operational, 2s));
}

// Nothing is on the bus when the master comes: its commands and requests are acknowledged by none. Devices that are
// switched on later are booted all the same, mandatory ones too.
TEST(NetworkBoot, DevicesThatAreSwitchedOnAfterTheMaster) {
  NetworkRig rig;
  rig.plan.boot_time = 60s;
  rig.add(1, true).off();
  rig.add(2).off();
  rig.begin();
  rig.run(20s);
  EXPECT_EQ(rig.network.phase(), Phase::booting);
  EXPECT_EQ(rig.count(Kind::not_sent), 1U);
  EXPECT_EQ(rig.count(Kind::slave_failed), 0U);
  rig.stations[1]->on();
  rig.stations[2]->on();
  ASSERT_TRUE(rig.run_to(Phase::operational, 3s));
  rig.run(3s);
  EXPECT_EQ(rig.stations[2]->state(), NmtState::operational);
}

// S5.16: a wrong type: told, this slave stopped; mandatory: the startup too, at once.
TEST(NetworkBoot, AWrongDeviceIsNotStarted) {
  for (const bool mandatory : {false, true}) {
    NetworkRig rig;
    rig.add(1, true);
    rig.add(2, mandatory);
    rig.rules_of(2).vendor = 0x99;
    rig.begin();
    ASSERT_TRUE(rig.run_to(mandatory ? Phase::halted : Phase::operational));
    rig.run(1s);
    EXPECT_EQ(letter(rig.status(2).result.status), 'D');
    EXPECT_EQ(rig.status(2).phase, SlavePhase::failed);
    EXPECT_EQ(rig.count("000#0102"), 0U);
    EXPECT_EQ(rig.stations[2]->state(), NmtState::pre_operational);
    ASSERT_EQ(rig.count(Kind::slave_failed, 2), 1U);
    const auto event = std::ranges::find(rig.events, Kind::slave_failed, &NetworkEvent::kind);
    EXPECT_EQ(text(*event),
              "node 2: not ready: D: its vendor-ID (1018h:01) is not the expected one (1F85h): 00000011h instead of "
              "00000099h; plug in the right maker's device, or correct its slot, or 1F85h");
  }
}

// A halted startup, and the right device is plugged in: the application says go on, or the option does.
TEST(NetworkBoot, AHaltedStartupGoesOnWhenItIsHealed) {
  for (const bool resumes : {false, true}) {
    NetworkRig rig;
    NetworkBoot network(rig.world.executor(), rig.managed, {.resumes = resumes});
    rig.managed.lead_to(&network.error_control());
    rig.plan.boot_time = 3s;
    rig.add(1, true).off();
    rig.add(2, true);
    rig.run(50ms);
    ASSERT_TRUE(network.begin(rig.plan));
    ASSERT_TRUE(rig.world.run_until([&] { return network.phase() == Phase::halted; }, 10s));
    rig.stations[1]->on();
    rig.run(1s);
    EXPECT_TRUE(network.find(NodeId(1))->ready());
    EXPECT_EQ(network.phase(), resumes ? Phase::operational : Phase::halted);
    if (!resumes) {
      ASSERT_TRUE(network.operate());
    }
    rig.run(20ms);
    EXPECT_EQ(network.phase(), Phase::operational);
    EXPECT_EQ(rig.stations[1]->state(), NmtState::operational);
    EXPECT_EQ(rig.stations[2]->state(), NmtState::operational);
  }
}

// S5.13, 1F81h bit 2 = 0: only error control is started; it is not started by itself.
TEST(NetworkBoot, WithoutTheBootBitOnlyErrorControl) {
  NetworkRig rig;
  rig.add(1);
  rig.rules_of(1).boots = false;
  rig.rules_of(1).vendor = 0x99;  // would be D
  rig.begin();
  ASSERT_TRUE(rig.run_to(Phase::operational));
  rig.run(1s);
  EXPECT_TRUE(rig.status(1).supervised);
  EXPECT_EQ(rig.count("601#4000100000000000"), 0U);
  EXPECT_EQ(rig.stations[1]->state(), NmtState::pre_operational);
  EXPECT_EQ(rig.commands(), std::vector<std::string>{"000#8200"});
}

// A boot-up message of a node that is not assigned: A, to the application.
TEST(NetworkBoot, AStrangerIsTold) {
  NetworkRig rig;
  rig.add(1);
  rig.begin();
  ASSERT_TRUE(rig.run_to(Phase::operational));
  Station stranger(rig.world, rig.wire, 9, slave_description());
  stranger.on();
  rig.run(1s);
  ASSERT_EQ(rig.count(Kind::stranger), 1U);
  EXPECT_EQ(rig.count(Kind::stranger, 9), 1U);
  const auto told = std::ranges::find(rig.events, Kind::stranger, &NetworkEvent::kind);
  EXPECT_EQ(letter(told->status), 'A');
  EXPECT_EQ(stranger.state(), NmtState::pre_operational);
}

// 102Ah: between any two commands.
TEST(NetworkBoot, TheInhibitTimeIsKeptBetweenCommands) {
  NetworkRig rig;
  rig.managed.nmt().set_inhibit(7ms);
  for (std::uint8_t id = 1; id <= 6; ++id) rig.add(id, true);
  rig.begin();
  ASSERT_TRUE(rig.run_to(Phase::operational));
  rig.run(100ms);
  rt::Time before{};
  std::size_t seen = 0;
  for (std::size_t i = 0; i < rig.frames.size(); ++i) {
    if (!rig.frames[i].starts_with("000#")) continue;
    EXPECT_TRUE(seen == 0 || rig.times[i] - before >= 7ms) << rig.frames[i];
    ++seen;
    before = rig.times[i];
  }
  EXPECT_EQ(seen, 7U);
}

TEST(NetworkBoot, APlanThatMakesNoSenseIsRefused) {
  NetworkRig rig;
  rig.add(1);
  const auto code = [&](auto&& spoil) {
    NetworkPlan plan = rig.plan;
    spoil(plan);
    const auto begun = rig.network.begin(std::move(plan));
    return begun ? std::optional<Errc>() : begun.error().code;
  };
  EXPECT_EQ(code([](auto& plan) { plan.startup.master = false; }), Errc::invalid);
  EXPECT_EQ(code([](auto& plan) { plan.slaves.push_back(plan.slaves[0]); }), Errc::invalid);
  EXPECT_EQ(code([](auto& plan) { plan.slaves[0].node = NodeId(); }), Errc::invalid);
  EXPECT_EQ(code([](auto& plan) { plan.slaves[0].target = nullptr; }), Errc::invalid);
  EXPECT_EQ(code([](auto& plan) { plan.slaves[0].source = nullptr; }), Errc::invalid);
  rig.run(2s);
  EXPECT_TRUE(rig.commands().empty());
  EXPECT_EQ(rig.network.phase(), Phase::off);
  EXPECT_EQ(code([](auto& plan) { plan.slaves[0].rules = {}; }), std::nullopt) << "not assigned: left out";
  EXPECT_TRUE(rig.world.run_until([&] { return rig.network.phase() == Phase::operational; }, 1s));
  EXPECT_EQ(rig.network.find(NodeId(1)), nullptr);
}

// The end of it, in the middle: nothing more is sent, and it can begin again.
TEST(NetworkBoot, ItEndsAndBeginsAtAnyTime) {
  for (int ms = 0; ms < 60; ++ms) {
    NetworkRig rig(static_cast<std::uint64_t>(ms));
    for (std::uint8_t id = 1; id <= 4; ++id) rig.add(id, true);
    rig.add(5).off();  // would be asked for ever
    rig.begin();
    rig.run(std::chrono::milliseconds(ms));
    rig.network.end();
    rig.run(5ms);
    rig.forget();
    rig.run(3s);
    EXPECT_TRUE(std::ranges::all_of(rig.frames, [](auto& f) { return f.starts_with("70"); })) << "after " << ms;
    ASSERT_TRUE(rig.network.begin(rig.plan));
    rig.run(1ms);
    ASSERT_TRUE(rig.network.begin(rig.plan)) << "twice";
    ASSERT_TRUE(rig.run_to(Phase::operational));
    rig.run(20ms);
    for (std::uint8_t id = 1; id <= 4; ++id) EXPECT_EQ(rig.stations[id]->state(), NmtState::operational) << ms;
  }
}

// Calls from the callback, which stands inside a slave's task.
TEST(NetworkBoot, TheCallbackMayEndAndBeginIt) {
  NetworkRig rig;
  for (std::uint8_t id = 1; id <= 3; ++id) rig.add(id, true);
  unsigned again = 0;
  rig.heard = [&](const NetworkEvent& event) {
    if (event.kind != Kind::slave_ready || again == 5) return;
    ++again;
    rig.network.end();
    EXPECT_TRUE(rig.network.begin(rig.plan));
  };
  rig.begin();
  ASSERT_TRUE(rig.run_to(Phase::operational));
  EXPECT_EQ(again, 5U);
}
