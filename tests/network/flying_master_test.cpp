// Flying masters on a simulated bus (CiA 302-2; docs/flying-master.md): devices that boot the same network by their own
// dictionaries, one at a time. Frames by hand from the standard's description.
#include "berth/manager/flying_master.hpp"

#include "berth/base/random.hpp"
#include "berth/co/sdo_client.hpp"
#include "tests/network/masters_rig.hpp"

using namespace berth;
using namespace berth::manager;
using namespace berth::network;
using namespace berth::network::test;
using Frames = std::vector<std::string>;
using Phase = NetworkBoot::Phase;
using namespace std::chrono_literals;

// S5.12: two cold masters. 500 ms after its boot-up the first asks (073h), nobody answers within 100 ms, and it resets
// all. Both ask again, in one instant: one frame. 072h, and 100 ms later (priority 0, node 10) the first claims.
TEST(FlyingMaster, ColdStartOfTwoMasters) {
  MastersRig rig({0, 1});
  rig.stations[1]->on();
  rig.stations[2]->on();
  rig.masters[0]->on();
  rig.world.run_for(40ms);
  rig.masters[1]->on();
  ASSERT_TRUE(rig.run_until_led_by(0, 2s));
  ASSERT_TRUE(rig.run_until_operational(2s));
  auto commands = rig.commands();
  ASSERT_GE(commands.size(), 8U);
  const Frames begin{"073#", "073#", "000#8200", "073#", "072#", "071#000A", "000#8200", "071#000A"};
  EXPECT_EQ(Frames(commands.begin(), commands.begin() + 8), begin);
  EXPECT_EQ(rig.count("000#01"), 2U);
  EXPECT_EQ(rig.count("000#82"), 2U);
  EXPECT_EQ(rig.masters[1]->knows(), NodeId(10));
  EXPECT_EQ(rig.masters[1]->manager->network().phase(), Phase::off);
  EXPECT_EQ(rig.second_starts, 0U);
}

// One that comes later is told by its boot-up: the active master says who it is, and nothing is reset.
TEST(FlyingMaster, ASecondMasterFindsTheActiveOne) {
  MastersRig rig({1, 1});
  for (auto& [id, station] : rig.stations) station->on();
  rig.masters[0]->on();
  ASSERT_TRUE(rig.run_until_operational());
  rig.frames.clear();
  rig.masters[1]->on();
  rig.world.run_for(3s);
  const auto commands = rig.commands();
  ASSERT_GE(commands.size(), 1U);
  EXPECT_EQ(commands[0], "071#010A");
  EXPECT_EQ(rig.count("000#"), 0U);
  EXPECT_EQ(rig.count("073#"), 0U);
  EXPECT_EQ(rig.masters[1]->knows(), NodeId(10));
  EXPECT_TRUE(rig.slaves_operational());
}

// A better one takes over: 073h is answered by a worse priority, so 076h. Both wait and ask, the better one first, as
// its delay began with 076h and not with the end of that frame. 110 ms after 072h it is master. What runs goes on
// running: no reset and no start.
TEST(FlyingMaster, ABetterMasterTakesOverAndNothingStops) {
  MastersRig rig({2, 0});
  for (auto& [id, station] : rig.stations) station->on();
  rig.masters[0]->on();
  ASSERT_TRUE(rig.run_until_operational());
  rig.world.run_for(500ms);
  rig.frames.clear();
  rig.masters[1]->on();
  ASSERT_TRUE(rig.run_until_led_by(1));
  rig.world.run_for(1s);
  EXPECT_EQ(rig.masters[1]->manager->network().phase(), Phase::operational);
  const auto commands = rig.commands();
  const Frames all{"071#020A", "073#", "071#020A", "076#", "073#", "073#", "072#", "071#000B"};
  EXPECT_EQ(commands, all);
  EXPECT_EQ(rig.count("000#"), 0U);
  EXPECT_EQ(rig.masters[0]->knows(), NodeId(11));
  EXPECT_EQ(rig.masters[0]->manager->network().phase(), Phase::off);
  for (const auto& [id, station] : rig.stations) {
    EXPECT_EQ(rig.left_operational[id], 0U);
    EXPECT_EQ(rig.masters[1]->manager->network().find(NodeId(id))->result.status, BootStatus::l);
    EXPECT_TRUE(rig.masters[1]->manager->network().find(NodeId(id))->supervised);
  }
}

TEST(FlyingMaster, TheStandbyTakesOverWhenTheHeartbeatStops) {
  MastersRig rig({0, 1, 2});
  rig.all_on();
  ASSERT_TRUE(rig.run_until_led_by(0));
  ASSERT_TRUE(rig.run_until_operational());
  rig.world.run_for(1s);
  rig.frames.clear();
  rig.masters[0]->off();
  const rt::Time lost = rig.world.now();
  ASSERT_TRUE(rig.run_until_led_by(1));
  // Twice the own heartbeat period, and the slot of priority 1, node 11: 200 ms, 1500 ms + 110 ms.
  EXPECT_LE(rig.world.now() - lost, 1815ms);
  rig.world.run_for(3s);
  EXPECT_EQ(rig.count("000#"), 0U);
  EXPECT_EQ(rig.masters[2]->knows(), NodeId(11));
  EXPECT_TRUE(rig.slaves_operational());

  // The former one returns, is better, and gets its role back: cold, and resets nobody.
  rig.masters[0]->on();
  ASSERT_TRUE(rig.run_until_led_by(0));
  rig.world.run_for(3s);
  EXPECT_EQ(rig.count("000#"), 0U);
  EXPECT_EQ(rig.second_starts, 0U);
  for (const auto& [id, station] : rig.stations) EXPECT_EQ(rig.left_operational[id], 0U);
}

// The new master reads in the devices how far the former one came: the slave whose table was half written has 1020h =
// 0.
TEST(FlyingMaster, TakeOverInTheMiddleOfADownload) {
  MastersRig rig({0, 1});
  for (const std::uint8_t slave : {std::uint8_t{1}, std::uint8_t{2}}) rig.configure(slave, 77, 6000);
  rig.all_on();
  ASSERT_TRUE(rig.world.run_until([&] { return rig.count("601#0") + rig.count("601#1") > 200; }, 10s));
  ASSERT_EQ(rig.leader(), rig.masters[0].get());
  ASSERT_FALSE(rig.slaves_operational());
  rig.masters[0]->off();
  ASSERT_TRUE(rig.run_until_led_by(1));
  ASSERT_TRUE(rig.run_until_operational());
  rig.world.run_for(1s);
  for (const auto& [id, station] : rig.stations) {
    EXPECT_EQ(station->device.values().get_or<std::uint32_t>({0x2000, 0}, 0), 77U);
    EXPECT_EQ(station->device.values().bytes({big_table, 0}).size(), 6000U);
    EXPECT_EQ(rig.starts[id], 1U);
  }
  EXPECT_EQ(rig.second_starts, 0U);
}

// One slave runs, the other is booting: the one is left alone, the other is booted from the beginning.
TEST(FlyingMaster, TakeOverInMidBoot) {
  MastersRig rig({0, 1});
  rig.configure(2, 5, 6000);
  rig.all_on();
  ASSERT_TRUE(rig.world.run_until([&] { return rig.stations[1]->state() == NmtState::operational; }, 10s));
  ASSERT_NE(rig.stations[2]->state(), NmtState::operational);
  rig.frames.clear();
  rig.masters[0]->off();
  ASSERT_TRUE(rig.run_until_operational());
  EXPECT_EQ(rig.count("000#8200"), 0U);
  EXPECT_EQ(rig.count("000#8201"), 0U);
  EXPECT_EQ(rig.count("000#8202"), 1U);
  EXPECT_EQ(rig.left_operational[1], 0U);
  EXPECT_EQ(rig.second_starts, 0U);
}

// 1F80h bit 1: all are started at once; after a take-over only those that do not run.
TEST(FlyingMaster, TakeOverOfANetworkThatIsStartedTogether) {
  constexpr std::uint32_t mandatory = 0x0D;
  MastersRig rig({0, 1}, 2, flying_startup | 2U, mandatory);
  rig.all_on();
  ASSERT_TRUE(rig.run_until_operational());
  EXPECT_EQ(rig.count("000#0100"), 1U);
  rig.world.run_for(500ms);
  rig.stations[2]->off();
  rig.masters[0]->off();
  ASSERT_TRUE(rig.run_until_led_by(1));
  rig.stations[2]->on();
  ASSERT_TRUE(rig.run_until_operational());
  rig.world.run_for(1s);
  EXPECT_EQ(rig.count("000#0100"), 1U);
  EXPECT_EQ(rig.count("000#0102"), 1U);
  EXPECT_EQ(rig.left_operational[1], 0U);
  EXPECT_EQ(rig.second_starts, 0U);
}

// It stops to command at once, also in the middle of a boot-up, refuses requests, and obeys as a slave.
TEST(FlyingMaster, AMasterThatLostItsRoleCommandsNothing) {
  MastersRig rig({1, 1});
  rig.configure(1, 5, 6000);
  rig.masters[1]->on();
  ASSERT_TRUE(rig.run_until_led_by(1));
  rig.stations[1]->on();
  ASSERT_TRUE(rig.world.run_until([&] { return rig.count("601#") > 200; }, 10s));
  // From another node: a master of a better rank is active.
  auto port = rig.wire.attach({});
  can::Dispatcher other(rig.world.executor(), *port);
  rig.frames.clear();
  static_cast<void>(other.send(can::Frame::base(0x71, {0, 50})));
  rig.world.run_for(100ms);
  EXPECT_EQ(rig.masters[1]->knows(), NodeId(50));
  EXPECT_LE(rig.count("601#"), 1U);  // the abort of its transfer
  EXPECT_EQ(rig.count("000#"), 0U);
  co::SdoClient client(other);
  struct Done final : rt::Job {
    void run() noexcept override { done = true; }
    bool done = false;
  } done;
  auto request = client.write(NodeId(11), 0x1F82, 1, std::uint8_t{5});
  ASSERT_FALSE(request.begin(rig.world.executor(), done));
  rig.world.run_for(100ms);
  ASSERT_TRUE(done.done);
  const auto refused = request.await_resume();
  ASSERT_FALSE(refused);
  EXPECT_EQ(refused.error().detail, static_cast<std::uint32_t>(od::AbortCode::device_state));
  static_cast<void>(other.send(can::Frame::base(0, {0x02, 11})));
  rig.world.run_for(10ms);
  EXPECT_EQ(rig.masters[1]->station.state(), NmtState::stopped);
}

// 074h answers 075h, from every master-capable device; an active master says who it is.
TEST(FlyingMaster, AnswersWhoAsks) {
  MastersRig rig({0, 1});
  rig.all_on();
  ASSERT_TRUE(rig.run_until_led_by(0));
  rig.world.run_for(1s);
  auto port = rig.wire.attach({});
  can::Dispatcher other(rig.world.executor(), *port);
  rig.frames.clear();
  static_cast<void>(other.send(can::Frame::base(0x75, {})));
  rig.world.run_for(10ms);
  EXPECT_EQ(rig.commands(), (Frames{"075#", "074#"}));  // both, in one frame
  rig.frames.clear();
  static_cast<void>(other.send(can::Frame::base(0x73, {})));
  rig.world.run_for(10ms);
  EXPECT_EQ(rig.commands(), (Frames{"073#", "071#000A"}));
}

// A bus that is cut has a master on each side; joined, one of them is gone within a cycle of 076h.
TEST(FlyingMaster, CutAndJoined) {
  MastersRig rig({1, 1}, 2);
  rig.all_on();
  ASSERT_TRUE(rig.run_until_led_by(0));
  ASSERT_TRUE(rig.run_until_operational());
  sim::Controller* const other_side[] = {rig.masters[1]->station.controller.get(), rig.stations[2]->controller.get()};
  rig.wire.split(other_side);
  ASSERT_TRUE(rig.world.run_until([&] { return rig.masters[0]->leads() && rig.masters[1]->leads(); }, 10s));
  rig.world.run_for(5s);
  EXPECT_EQ(rig.leader(), nullptr);
  rig.wire.join();
  const rt::Time joined = rig.world.now();
  ASSERT_TRUE(rig.world.run_until([&] { return rig.leader() != nullptr; }, 10s));
  EXPECT_LE(rig.world.now() - joined, 4150ms);
  ASSERT_TRUE(rig.run_until_operational());
  rig.world.run_for(5s);
  EXPECT_EQ(rig.leader(), rig.masters[0].get());
  EXPECT_TRUE(rig.slaves_operational());
}

// A network with a keep-alive slave is not reset by the first master that comes.
TEST(FlyingMaster, AColdMasterLeavesKeepAliveSlavesRunning) {
  MastersRig rig({1}, 2, flying_startup, booted_slave | 0x10U);
  for (auto& [id, station] : rig.stations) station->on();
  rig.world.run_for(10ms);
  for (auto& [id, station] : rig.stations) station->device.apply(co::NmtCommand::start);
  ASSERT_TRUE(rig.slaves_operational());
  rig.masters[0]->on();
  ASSERT_TRUE(rig.run_until_led_by(0));
  rig.world.run_for(2s);
  EXPECT_EQ(rig.count("000#"), 0U);
  EXPECT_TRUE(rig.slaves_operational());
}

TEST(FlyingMaster, ItsObjects) {
  MastersRig rig({1});
  auto& values = rig.masters[0]->station.device.values();
  rig.masters[0]->on();
  const auto number = [&](std::uint8_t sub) { return values.get_or<std::uint16_t>({0x1F90, sub}, 0); };
  EXPECT_EQ(number(1), 100);
  EXPECT_EQ(number(2), 500);
  EXPECT_EQ(number(3), 1);
  EXPECT_EQ(number(4), 1500);
  EXPECT_EQ(number(5), 10);
  auto port = rig.wire.attach({});
  can::Dispatcher other(rig.world.executor(), *port);
  co::SdoClient client(other);
  struct Done final : rt::Job {
    void run() noexcept override { done = true; }
    bool done = false;
  };
  const auto get = [&](auto&& op) {
    Done done;
    if (!op.begin(rig.world.executor(), done)) rig.world.run_for(100ms);
    return op.await_resume();
  };
  rig.world.run_for(100ms);
  const auto cycle = get(client.read<std::uint16_t>(NodeId(10), 0x1F90, 6));
  ASSERT_TRUE(cycle);
  EXPECT_EQ(*cycle, 4100);
  const auto refused = get(client.write(NodeId(10), 0x1F90, 3, std::uint16_t{3}));
  ASSERT_FALSE(refused);
  EXPECT_EQ(refused.error().detail, static_cast<std::uint32_t>(od::AbortCode::invalid_value));
  EXPECT_TRUE(get(client.write(NodeId(10), 0x1F90, 3, std::uint16_t{2})));
  EXPECT_TRUE(get(client.write(NodeId(10), 0x1F80, 0, std::uint32_t{0x21})));
  // Times that overlap: it does not begin, and says why.
  EXPECT_TRUE(get(client.write(NodeId(10), 0x1F90, 4, std::uint16_t{1270})));
  rig.masters[0]->station.device.apply(co::NmtCommand::reset_communication);
  rig.world.run_for(100ms);
  // Reset communication takes the defaults back, so only what is stored would count: nothing is refused.
  EXPECT_FALSE(rig.masters[0]->manager->refused());
}

TEST(FlyingMaster, OptionsThatMakeNoSense) {
  MastersRig rig({1});
  struct Nobody final : FlyingMaster::Owner {
    void role_changed() noexcept override {}
    void reset_all() noexcept override {}
    void overheard(const co::NmtRequest&) noexcept override {}
  } nobody;
  FlyingMaster flying(rig.masters[0]->station.dispatcher, nobody);
  EXPECT_EQ(flying.begin({.own = {1, NodeId()}}, {}).error().code, Errc::invalid);
  EXPECT_EQ(flying.begin({.own = {3, NodeId(1)}}, {}).error().code, Errc::invalid);
  EXPECT_EQ(flying.begin({.own = {1, NodeId(1)}, .timing = {.device_slot = 12ms}}, {}).error().code, Errc::invalid);
  EXPECT_TRUE(flying.begin({.own = {1, NodeId(1)}}, {}));
}

// ---- random worlds --------------------------------------------------------------------------------------------------

namespace {

// Two to four masters of random priorities and two to four slaves; masters and slaves lose power and get it back,
// frames are disturbed or lost by one node, the bus is cut and joined. At the end all is whole for a while.
class RandomWorld {
 public:
  explicit RandomWorld(std::uint64_t seed)
      : random_(seed), rig_(priorities(), slaves(), flying_startup, booted_slave, seed) {
    rig_.world.executor().perturb(seed);
    for (std::uint8_t slave = 1; slave <= rig_.stations.size(); ++slave) {
      rig_.configure(slave, slave, random_.below(2) == 0 ? 0 : 2000);
    }
  }
  void run() {
    rig_.all_on();
    const auto faults = 3 + random_.below(6);
    for (std::uint64_t i = 0; i < faults; ++i) {
      run_for(std::chrono::milliseconds(random_.below(4000)));
      strike();
    }
    mend();
    ASSERT_TRUE(run_to([&] { return rig_.leader() != nullptr && rig_.slaves_operational() && agreed(); }, 90s))
        << state();
    run_for(20s);
    EXPECT_TRUE(rig_.leader() != nullptr && rig_.slaves_operational() && agreed()) << state();
    EXPECT_EQ(rig_.second_starts, 0U) << rig_.second_start << state();
  }

 private:
  std::vector<std::uint8_t> priorities() {
    std::vector<std::uint8_t> all(2 + random_.below(3));
    for (auto& each : all) each = static_cast<std::uint8_t>(random_.below(3));
    return all;
  }
  std::uint8_t slaves() { return static_cast<std::uint8_t>(2 + random_.below(3)); }
  void run_for(rt::Duration time) {
    const rt::Time end = rig_.world.now() + time;
    static_cast<void>(run_to([&] { return rig_.world.now() >= end; }, time));
  }
  template <class Over>
  bool run_to(Over over, rt::Duration limit) {
    const rt::Time end = rig_.world.now() + limit;
    while (rig_.world.now() < end) {
      if (over()) return true;
      rig_.world.run_for(10ms);
      for (sim::Controller* const each : rig_.wire.controllers()) {
        if (each->status().bus_off) each->restart(rig_.wire.bit_rate());  // as every device does, sooner or later
      }
      watch();
    }
    return over();
  }
  // Two active masters that hear each other: no longer than the cycle of 076h of the slower one, since traffic is
  // possible. Not counted while frames are struck at random: 076 is one, and a node may be bus-off.
  void watch() {
    std::size_t leading = 0;
    for (const auto& master : rig_.masters) leading += master->leads() ? 1U : 0U;
    const rt::Time now = rig_.world.now();
    if (leading < 2 || cut_ || noisy_) two_since_ = now;
    const rt::Duration allowed = FlyingTiming{}.cycle_of(NodeId(13)) + 100ms;
    const bool too_long = now - std::max(two_since_, disturbed_) > allowed;
    EXPECT_FALSE(too_long) << "two active masters since " << (now - two_since_) / 1ms << " ms: " << state();
    if (too_long) two_since_ = now;
  }
  void strike() {
    disturbed_ = rig_.world.now();
    switch (random_.below(6)) {
      case 0: {
        auto& master = *rig_.masters[random_.below(rig_.masters.size())];
        return master.powered ? master.off() : master.on();
      }
      case 1: {
        const auto id = static_cast<std::uint8_t>(1 + random_.below(rig_.stations.size()));
        auto& slave = *rig_.stations[id];
        return slave.device.powered() ? slave.off() : slave.on();
      }
      case 2: {
        std::vector<sim::Controller*> side;
        for (const auto& master : rig_.masters) {
          if (random_.below(2) == 0) side.push_back(master->station.controller.get());
        }
        for (const auto& [id, station] : rig_.stations) {
          if (random_.below(2) == 0) side.push_back(station->controller.get());
        }
        cut_ = true;
        return rig_.wire.split(side);
      }
      case 3: cut_ = false; return rig_.wire.join();
      case 4:
        noisy_ = true;
        return rig_.wire.faults().draw_from({.disturbed_per_million = 20'000, .overrun_per_million = 5'000});
      default: noisy_ = false; return rig_.wire.faults().draw_from({});
    }
  }
  void mend() {
    cut_ = noisy_ = false;
    rig_.wire.join();
    rig_.wire.faults().draw_from({});
    for (auto& master : rig_.masters) master->on();
    // A configuration may have failed for a lost frame (J): CiA 302-2 waits for the boot-up message of such a slave.
    for (auto& [id, station] : rig_.stations) {
      if (station->state() != NmtState::operational) station->off();
      if (!station->device.powered()) station->on();
    }
    disturbed_ = rig_.world.now();
  }
  [[nodiscard]] bool agreed() const {
    const auto* const leader = rig_.leader();
    return std::ranges::all_of(rig_.masters,
                               [&](auto& m) { return leader != nullptr && m->knows() == leader->knows(); });
  }
  [[nodiscard]] std::string state() const {
    std::string text = std::to_string(rig_.world.now().time_since_epoch() / 1ms) + " ms";
    for (const auto& m : rig_.masters) {
      const auto port = m->station.controller->status();
      text += std::string(", ") + name(m->manager->flying().state()) + " (TEC " + std::to_string(port.tec) +
              ", queued " + std::to_string(port.queued) + (port.bus_off ? ", bus-off)" : ")");
    }
    for (const auto& [id, s] : rig_.stations)
      text += ", " + std::to_string(id) + " in " + std::to_string(int(s->state()));
    const auto from = rig_.frames.size() > 60 ? rig_.frames.end() - 60 : rig_.frames.begin();
    for (auto f = from; f != rig_.frames.end(); ++f) text += "\n" + *f;
    for (const auto& m : rig_.masters) {
      for (const auto& line : m->told) text += "\n" + std::to_string(m->station.device.node_id().value()) + " " + line;
    }
    return text;
  }

  Random random_;
  MastersRig rig_;
  rt::Time two_since_{}, disturbed_{};
  bool cut_ = false;
  bool noisy_ = false;
};

}  // namespace

TEST(FlyingMasterWorlds, OneActiveMasterAndNoSecondStart) {
  for (std::uint64_t seed = 1; seed <= 30; ++seed) {
    SCOPED_TRACE("seed " + std::to_string(seed));
    RandomWorld(seed).run();
    if (HasFailure()) break;
  }
}
