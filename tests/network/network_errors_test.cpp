// What NetworkBoot does when a slave fails in a running network: 1F80h bits 4 and 6, 1F81h bits 2 to 4.
#include "tests/network/network_rig.hpp"

using namespace berth;
using namespace berth::manager;
using namespace berth::network;
using namespace berth::network::test;
using co::NmtCommand;
using Kind = NetworkEvent::Kind;
using Phase = NetworkBoot::Phase;
using namespace std::chrono_literals;

namespace {

// Slaves 1 (mandatory), 2 (mandatory) and 3 (optional) run.
struct Running : NetworkRig {
  explicit Running(Startup startup = {}, std::uint64_t seed = 0) : NetworkRig(seed) {
    plan.startup = startup;
    plan.startup.master = true;
    add(1, true);
    add(2, true);
    add(3);
  }
  void go() {
    begin();
    ASSERT_TRUE(run_to(Phase::operational));
    run(500ms);
    forget();
  }
  bool all_operational() {
    return std::ranges::all_of(stations, [](auto& s) { return s.second->state() == NmtState::operational; });
  }
};

}  // namespace

// Neither bit 4 nor bit 6: that slave alone. It is reset; who comes back is booted again.
TEST(NetworkErrors, ALostSlaveIsResetAndBootedWhenItComesBack) {
  for (const std::uint8_t id : {std::uint8_t{1}, std::uint8_t{3}}) {
    Running rig;
    rig.go();
    rig.stations[id]->off();
    rig.run(1s);
    EXPECT_EQ(rig.count(Kind::slave_lost, id), 1U);
    EXPECT_EQ(rig.commands(), std::vector<std::string>{"000#810" + std::to_string(id)});
    EXPECT_EQ(rig.status(id).phase, SlavePhase::awaited);
    EXPECT_FALSE(rig.status(id).state);
    EXPECT_EQ(rig.network.phase(), Phase::operational);
    rig.run(1h);
    rig.stations[id]->on();
    rig.run(500ms);
    EXPECT_TRUE(rig.all_operational()) << int{id};
    EXPECT_EQ(rig.count(Kind::slave_ready, id), 1U);
    EXPECT_EQ(rig.status(id).phase, SlavePhase::started);
    EXPECT_TRUE(rig.status(id).supervised);
  }
}

// The cable of one slave was out: it has not heard the reset, and runs on. It is reset and booted now.
TEST(NetworkErrors, ASlaveThatWasCutOffIsResetWhenItIsHeardAgain) {
  Running rig;
  rig.go();
  rig.stations[3]->controller->cable(false);
  rig.run(1s);
  EXPECT_EQ(rig.count(Kind::slave_lost, 3), 1U);
  rig.stations[3]->controller->cable(true);
  rig.run(1s);
  EXPECT_EQ(rig.count(Kind::slave_back, 3), 1U);
  EXPECT_EQ(rig.count("000#8103"), 2U);
  EXPECT_EQ(rig.count("703#00"), 1U);
  EXPECT_EQ(rig.count(Kind::slave_ready, 3), 1U);
  EXPECT_TRUE(rig.all_operational());
}

// A slave that restarts by itself is booted again, and not reset once more.
TEST(NetworkErrors, ASlaveThatRestartsIsBootedAgain) {
  for (std::uint64_t seed = 0; seed < 4; ++seed) {
    Running rig({}, seed);
    rig.go();
    rig.stations[2]->device.power_on();
    rig.run(500ms);
    EXPECT_EQ(rig.count(Kind::slave_rebooted, 2), 1U);
    EXPECT_EQ(rig.count(Kind::slave_lost), 0U);
    EXPECT_EQ(rig.commands(), std::vector<std::string>{"000#0102"});
    EXPECT_TRUE(rig.all_operational());
  }
}

// Another device on its node-ID: its boot-up message begins the checks anew.
TEST(NetworkErrors, AReplacementThatIsWrongIsNotStarted) {
  Running rig;
  rig.rules_of(3).serial = 3;
  rig.go();
  rig.stations[3]->off();
  rig.run(1s);
  rig.stations[3]->device.set_address({0x11, 0x22, 0x0002'0005, 4});
  rig.stations[3]->on();
  rig.run(1s);
  EXPECT_EQ(letter(rig.status(3).result.status), 'O');
  EXPECT_EQ(rig.status(3).phase, SlavePhase::failed);
  EXPECT_EQ(rig.stations[3]->state(), NmtState::pre_operational);
  rig.stations[3]->off();
  rig.stations[3]->device.set_address({0x11, 0x22, 0x0002'0005, 3});
  rig.stations[3]->on();
  rig.run(1s);
  EXPECT_TRUE(rig.all_operational()) << "the right one again";
}

// 1F80h bit 6: all nodes and the master are stopped, and stay so until the application begins anew. Bit 4 does not
// count.
TEST(NetworkErrors, BitSixStopsAll) {
  for (const bool bit_4 : {false, true}) {
    for (const bool rebooted : {false, true}) {
      Running rig({.resets_all_on_error = bit_4, .stops_all_on_error = true});
      rig.go();
      rebooted ? rig.stations[1]->device.power_on() : rig.stations[1]->off();
      rig.run(1s);
      EXPECT_EQ(rig.network.phase(), Phase::stopped);
      EXPECT_EQ(rig.commands(), std::vector<std::string>{"000#0200"});
      EXPECT_EQ(rig.applied, std::vector{NmtCommand::stop}) << "the master too";
      EXPECT_EQ(rig.count(Kind::all_stopped, 1), 1U);
      EXPECT_EQ(rig.stations[2]->state(), NmtState::stopped);
      EXPECT_EQ(rig.stations[3]->state(), NmtState::stopped);
      rig.stations[1]->off();
      rig.stations[1]->on();
      rig.run(5s);
      EXPECT_EQ(rig.commands().size(), 1U) << "nothing by itself";
      ASSERT_TRUE(rig.network.begin(rig.plan));
      ASSERT_TRUE(rig.run_to(Phase::operational));
      rig.run(20ms);
      EXPECT_TRUE(rig.all_operational());
    }
  }
}

// 1F80h bit 4: all nodes and the master are reset; the master begins when it has booted.
TEST(NetworkErrors, BitFourResetsAll) {
  for (const bool rebooted : {false, true}) {
    Running rig({.resets_all_on_error = true});
    rig.applies = [&](NmtCommand command) {
      if (command != NmtCommand::reset_node) return;
      rig.network.end();
      rig.world.after(30ms, [&] { EXPECT_TRUE(rig.network.begin(rig.plan)); });
    };
    rig.go();
    rebooted ? rig.stations[1]->device.power_on() : rig.stations[1]->off();
    ASSERT_TRUE(rig.world.run_until([&] { return rig.count(Kind::all_reset, 1) == 1; }, 1s));
    EXPECT_EQ(rig.network.phase(), Phase::off);
    rig.run(5ms);
    EXPECT_EQ(rig.commands(), std::vector<std::string>{"000#8100"});
    EXPECT_EQ(rig.applied, std::vector{NmtCommand::reset_node});
    if (!rebooted) rig.stations[1]->on();
    ASSERT_TRUE(rig.run_to(Phase::operational));
    rig.run(20ms);
    EXPECT_TRUE(rig.all_operational());
    EXPECT_EQ(rig.count(Kind::all_reset), 1U);
  }
}

// Bits 4 and 6 are for mandatory slaves: an optional one is handled alone.
TEST(NetworkErrors, AnOptionalSlaveIsHandledAlone) {
  for (const bool stops : {false, true}) {
    Running rig({.resets_all_on_error = !stops, .stops_all_on_error = stops});
    rig.go();
    rig.stations[3]->off();
    rig.run(1s);
    EXPECT_EQ(rig.commands(), std::vector<std::string>{"000#8103"});
    EXPECT_EQ(rig.network.phase(), Phase::operational);
    EXPECT_EQ(rig.stations[1]->state(), NmtState::operational);
  }
}

// 1F81h bit 4: a keep-alive slave whose heartbeat was away and that runs is not reset.
TEST(NetworkErrors, AKeepAliveSlaveThatIsLostIsNotReset) {
  Running rig;
  rig.rules_of(3).keep_alive = true;
  rig.go();
  rig.stations[3]->controller->cable(false);
  ASSERT_TRUE(rig.world.run_until([&] { return rig.count(Kind::slave_lost, 3) == 1; }, 1s));
  rig.stations[3]->controller->cable(true);
  rig.run(4s);
  EXPECT_TRUE(rig.commands().empty());
  EXPECT_EQ(letter(rig.status(3).result.status), 'L');
  EXPECT_EQ(rig.status(3).phase, SlavePhase::started);
  EXPECT_TRUE(rig.status(3).supervised);
  EXPECT_EQ(rig.count("703#00"), 0U);
}

// 1F81h bit 2 = 0: on an error event and a boot-up only its error control begins again.
TEST(NetworkErrors, WithoutTheBootBitErrorControlBeginsAgain) {
  Running rig;
  rig.rules_of(3).boots = false;
  rig.go();
  rig.stations[3]->off();
  rig.run(1s);
  rig.stations[3]->on();
  rig.run(1s);
  EXPECT_TRUE(rig.status(3).supervised);
  EXPECT_EQ(rig.count("603#4000100000000000"), 0U);
  EXPECT_EQ(rig.count("000#0103"), 0U);
  rig.forget();
  rig.stations[3]->off();
  rig.run(1s);
  EXPECT_EQ(rig.count(Kind::slave_lost, 3), 1U) << "it is supervised indeed";
}

// Error control by node guarding: bits 31 to 8 of 1F81h.
TEST(NetworkErrors, NodeGuardingLosesASlaveToo) {
  NetworkRig rig;
  rig.add(1, false, false);
  rig.rules_of(1).guard_time = 50ms;
  rig.rules_of(1).retry_factor = 3;
  rig.begin();
  ASSERT_TRUE(rig.run_to(Phase::operational));
  rig.run(1s);
  EXPECT_TRUE(rig.status(1).supervised);
  EXPECT_EQ(rig.status(1).state, NmtState::operational);
  const auto off_at = rig.world.now();
  rig.stations[1]->off();
  ASSERT_TRUE(rig.world.run_until([&] { return rig.count(Kind::slave_lost, 1) == 1; }, 1s));
  EXPECT_LE(rig.world.now() - off_at, 4 * 50ms);
  EXPECT_GE(rig.world.now() - off_at, 2 * 50ms);
  rig.stations[1]->on();
  rig.run(1s);
  EXPECT_EQ(rig.stations[1]->state(), NmtState::operational);
}

// A device that dies and restarts in the middle of its boot-up, at any moment: its boot-up begins anew, once, and it
// ends operational, configured by the boot-up that ended well.
TEST(NetworkErrors, ARestartInTheMiddleOfItsBootUp) {
  struct Writing final : BootSource {
    rt::Task<Result<void>> configure(BootTarget& target, SlaveRules&) override {
      for (std::uint32_t value = 1; value <= 5; ++value) {
        const auto written = co_await target.objects().write_u32(0x2000, 0, value);
        if (!written) co_return written;
        co_await rt::sleep_for(4ms);
      }
      co_return Result<void>{};
    }
  };
  for (int ms = 0; ms < 40; ms += 2) {
    NetworkRig rig(static_cast<std::uint64_t>(ms));
    Writing source;
    rig.add(1, true);
    rig.plan.slaves[0].source = &source;
    rig.begin();
    rig.run(std::chrono::milliseconds(ms));
    rig.stations[1]->device.power_on();
    ASSERT_TRUE(rig.run_to(Phase::operational)) << ms;
    rig.run(3s);
    EXPECT_EQ(rig.stations[1]->state(), NmtState::operational) << ms;
    EXPECT_EQ(rig.stations[1]->device.values().get_or<std::uint32_t>({0x2000, 0}, 0), 5U) << ms;
    EXPECT_EQ(rig.count(Kind::slave_ready, 1), 1U) << ms;
  }
}

// A reset that the master was asked for is no error event.
TEST(NetworkErrors, AResetOnRequestIsNoError) {
  for (const auto command : {NmtCommand::reset_node, NmtCommand::reset_communication}) {
    for (const NodeId node : {NodeId(1), NodeId()}) {
      Running rig({.stops_all_on_error = true});
      rig.go();
      rig.network.command(command, node.configured() ? co::NmtTarget(node) : co::NmtTarget::all());
      rig.run(2s);
      EXPECT_EQ(rig.network.phase(), Phase::operational);
      EXPECT_EQ(rig.count(Kind::slave_rebooted), 0U);
      EXPECT_EQ(rig.count(Kind::slave_lost), 0U);
      EXPECT_EQ(rig.count(Kind::slave_ready), node.configured() ? 1U : 3U);
      EXPECT_TRUE(rig.all_operational());
    }
  }
}

TEST(NetworkErrors, SupervisionByHand) {
  Running rig;
  rig.add(4, false, false);
  rig.go();
  EXPECT_EQ(rig.network.supervise(NodeId(9), true).error().code, Errc::not_found);
  EXPECT_EQ(rig.network.supervise(NodeId(4), true).error().code, Errc::unsupported);
  EXPECT_FALSE(rig.status(4).supervised);
  ASSERT_TRUE(rig.network.supervise(NodeId(3), false));
  rig.stations[3]->off();
  rig.run(2s);
  EXPECT_TRUE(rig.events.empty()) << "nobody looks";
  ASSERT_TRUE(rig.network.supervise(NodeId(3), true));
  rig.run(1s);
  EXPECT_EQ(rig.count(Kind::slave_lost, 3), 1U);
}
