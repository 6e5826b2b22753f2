// The RAND master against RAND slaves on the simulated bus: good days, bad days, and random ones.
#include <gtest/gtest.h>
#include <rapidcheck/gtest.h>
#include <algorithm>
#include <cstdint>
#include <set>
#include <string>
#include <vector>

#include "tests/harness/rand_world.hpp"

namespace berth::nodeid::test {
namespace {

using End = DiscoveryReport::End;

constexpr LssAddress s1{0x0100'0001, 1, 0, 0x0A};
constexpr LssAddress s2{1, 1, 0, 5};
constexpr LssAddress s3{1, 5, 0, 8};
constexpr LssAddress s4{1, 1, 0, 6};
constexpr LssAddress s5{1, 1, 0, 7};

TEST(RandMaster, S1_21_NobodyThereIsOneRequest) {
  World w;
  w.add_witness();
  const Record record(w.bus);
  const auto report = w.discover();
  ASSERT_TRUE(report);
  EXPECT_EQ(report->end, End::complete);
  EXPECT_TRUE(report->found.empty());
  EXPECT_EQ(report->requests, 1U);
  EXPECT_EQ(record.text, std::vector<std::string>{"1F940000#80000000"});
}

// The sequence of Figure 2, written by hand: IURS 0 to 7 each with its IUS, DIRS with its DIS.
TEST(RandMaster, S1_25_OneUnknownSlave) {
  World w;
  w.add({0x0102'0304, 0x0506'0708, 0x090A'0B0C, 0x0D0E'0F10});
  const Record record(w.bus);
  ASSERT_TRUE(w.discover());
  const std::vector<std::string> figure{"1F940000#80000000", "1F500408#", "1F940000#80010102", "1F500C10#",
                                        "1F940000#80020304", "1F501418#", "1F940000#80030506", "1F501C20#",
                                        "1F940000#80040708", "1F502428#", "1F940000#8005090A", "1F502C30#",
                                        "1F940000#80060B0C", "1F503438#", "1F940000#80070D0E", "1F503C40#",
                                        "1F940000#80080F10", "1F903C40#", "1F940000#80000000"};
  EXPECT_EQ(record.text, figure);
}

// A frame of the other procedure's identifiers within a window is not taken for an answer of this one.
TEST(RandMaster, S1_24_DisIsNoIusAndFeedbackIsNoDis) {
  World w;
  w.add_witness();
  auto stranger = w.bus.attach();
  can::Dispatcher voice(w.world.executor(), *stranger);
  w.world.after(milliseconds(2), [&] {
    voice.send(dis(5));
    voice.send(can::Frame::ext(0x1F90'0135, {}));
  });
  const auto probe = w.run(w.master.any_unknown(w.options));
  ASSERT_TRUE(probe);
  EXPECT_FALSE(probe->anybody);
}

TEST(RandMaster, S1_18_FindsTheFiveInAscendingOrder) {
  World w;
  for (const auto& a : {s1, s2, s3, s4, s5}) w.add(a);
  Watch watch;
  const auto report = w.discover(&watch);
  ASSERT_TRUE(report);
  EXPECT_EQ(addresses(*report), (std::vector{s2, s4, s5, s3, s1}));
  EXPECT_EQ(report->requests, 5 * 9 + 1U);
  EXPECT_EQ(report->restarts, 0U);
  EXPECT_EQ(watch.devices.size(), 5U);
  EXPECT_EQ(watch.steps.size(), 46U);
  for (const auto& n : w.nodes) EXPECT_EQ(n->slave.state(), Identification::identified);
  EXPECT_EQ(report->found[0].distinct, (std::array<std::uint16_t, 8>{2, 1, 1, 2, 1, 1, 1, 3}));
}

TEST(RandMaster, S1_48_All127WithOneRequestLineEach) {
  World w;
  for (unsigned i = 0; i < 127; ++i) w.add({1 + i % 3, i % 5, 7, 1000 + i}, microseconds(100 + 37 * i));
  const auto report = w.discover();
  ASSERT_TRUE(report);
  EXPECT_EQ(report->found.size(), 127U);
  EXPECT_EQ(report->requests, 127 * 9 + 1U);
  EXPECT_TRUE(std::ranges::is_sorted(addresses(*report)));
}

// S1.41: the window: the paper's fixed 40 ms, or until nothing was heard for T_resp.
TEST(RandMaster, S1_41_FixedWindowLastsItsTimeAndQuietWindowEndsAfterTheLastAnswer) {
  World w(50'000);
  w.add(s1, milliseconds(4));
  w.options.window = DiscoveryOptions::Window::fixed;
  Watch fixed;
  ASSERT_TRUE(w.discover(&fixed));
  for (const auto window : fixed.windows) EXPECT_EQ(window, milliseconds(40));
  ASSERT_TRUE(w.run(w.master.switch_global(Identification::unknown)));
  w.options.window = DiscoveryOptions::Window::quiet;
  w.options.t_resp = milliseconds(10);
  Watch quiet;
  ASSERT_TRUE(w.discover(&quiet));
  // Answer at 4 ms plus its own length of 72 to 76 bits (1.44 to 1.52 ms, less the 3 of intermission), then 10 ms.
  for (std::size_t i = 0; i + 1 < quiet.windows.size(); ++i) {
    EXPECT_GE(quiet.windows[i], microseconds(15'300));
    EXPECT_LE(quiet.windows[i], microseconds(15'600));
  }
  EXPECT_EQ(quiet.windows.back(), milliseconds(10)) << "silence";
}

TEST(RandMaster, S1_41_QuietWindowHasAnUpperBound) {
  World w;
  w.add(s1);
  auto babbler = w.bus.attach();
  can::Dispatcher voice(w.world.executor(), *babbler);
  std::function<void()> babble = [&] {
    voice.send(ius(0xFFFF));
    w.world.after(milliseconds(3), babble);
  };
  babble();
  w.options.most = milliseconds(60);
  w.options.retries = 1;
  w.options.widen = false;
  Watch watch;
  const auto report = w.discover(&watch);
  ASSERT_TRUE(report);
  EXPECT_EQ(report->end, End::gave_up) << "phase 0 is always answered";
  for (std::size_t i = 0; i < watch.windows.size(); ++i) EXPECT_LE(watch.windows[i], milliseconds(60)) << i;
  EXPECT_EQ(addresses(*report), std::vector{s1}) << "the true one is found all the same";
}

TEST(RandMaster, PaperConditionsTakeThePapersPhaseTimes) {
  // S1.43 with real frame lengths: T_collect 40 ms from `sent`, T_proc 1 ms; the window itself is the paper's.
  World w(50'000);
  w.add(s2, milliseconds(4));
  w.options.window = DiscoveryOptions::Window::fixed;
  w.options.direct = microseconds(6'900);  // T_resp + T_DIS
  w.options.t_proc = milliseconds(1);
  const auto report = w.discover();
  ASSERT_TRUE(report);
  const auto time = report->ended - report->began;
  // 9 phases of 40 ms, one direct of 6.9, T_proc each, and 10 requests of 96 to 118 bits of 20 us.
  const auto fixed = 9 * milliseconds(40) + microseconds(6'900) + 10 * milliseconds(1);
  EXPECT_GE(time, fixed + 10 * 93 * microseconds(20));
  EXPECT_LE(time, fixed + 10 * 118 * microseconds(20));
}

TEST(RandMaster, S1_31_KnownDevicesAreLeftOut) {
  World w;
  for (const auto& a : {s1, s2, s3}) w.add(a);
  w.nodes[0]->slave.handle(switch_identification_global(Identification::identified), false);  // from another plant
  ASSERT_TRUE(w.run(w.master.switch_global(Identification::unknown)));
  ASSERT_TRUE(w.run(w.master.switch_selective(s2)));
  const auto report = w.discover();
  ASSERT_TRUE(report);
  EXPECT_EQ(addresses(*report), (std::vector{s3, s1}));
  EXPECT_FALSE(w.run(w.master.switch_global(Identification::selected)));
}

// S1.31: the steps as frames, in the paper's order: everybody unknown, the registered ones identified one by one, then
// phases until nobody answers. s2 and s3 are registered; s1 comes from another plant, where it was identified.
TEST(RandMaster, S1_31_TheStepsOfTheDiscovery) {
  World w;
  for (const auto& a : {s1, s2, s3}) w.add(a);
  w.nodes[0]->slave.handle(switch_identification_global(Identification::identified), false);
  const Record record(w.bus);
  ASSERT_TRUE(w.run(w.master.switch_global(Identification::unknown)));
  for (const auto& a : {s2, s3}) ASSERT_TRUE(w.run(w.master.switch_selective(a)));
  ASSERT_TRUE(w.discover());
  const std::vector<std::string> expected{
      "1F940000#81000000",
      // vendor, product, revision, serial, big-endian as all of RAND (docs/rand.md); 0: to identified
      "1F940000#8200000000000001", "1F940000#8300000000000001", "1F940000#8400000000000000",
      "1F940000#8500000000000005", "1F940000#8200000000000001", "1F940000#8300000000000005",
      "1F940000#8400000000000000", "1F940000#8500000000000008",
      // s1 alone
      "1F940000#80000000", "1F500400#", "1F940000#80010100", "1F500004#", "1F940000#80020001", "1F500000#",
      "1F940000#80030000", "1F500004#", "1F940000#80040001", "1F500000#", "1F940000#80050000", "1F500000#",
      "1F940000#80060000", "1F500000#", "1F940000#80070000", "1F500028#", "1F940000#8008000A", "1F900028#",
      // until nobody answers
      "1F940000#80000000"};
  EXPECT_EQ(record.text, expected);
}

// S1.19: equal chunks answered at one instant are one frame on the bus.
TEST(RandMaster, S1_19_EqualAnswersMergeOrRepeat) {
  World w;
  for (unsigned i = 0; i < 8; ++i) w.add({1, 1, 0, 100 + i}, milliseconds(2));
  Watch watch;
  const auto report = w.discover(&watch);
  ASSERT_TRUE(report);
  EXPECT_EQ(report->found.size(), 8U);
  EXPECT_GT(w.bus.statistics().merged, 0U);
  EXPECT_EQ(watch.steps[0].chunks, std::vector<std::uint16_t>{0});
}

// S1.20: no answer in a phase > 0: start anew at phase 0.
TEST(RandMaster, S1_20_AnAnswerMissingOnceInAnyPhaseIsRetried) {
  for (int phase = 1; phase <= 8; ++phase) {
    World w;
    auto& n = w.add(s2);
    w.add(s1);
    n.mute_at = phase;
    n.mute_times = 1;
    Watch watch;
    const auto report = w.discover(&watch);
    ASSERT_TRUE(report);
    EXPECT_EQ(report->end, End::complete);
    EXPECT_EQ(addresses(*report), (std::vector{s2, s1})) << phase;
    EXPECT_EQ(report->restarts, 1U);
    EXPECT_EQ(watch.restarts, std::vector<unsigned>{static_cast<unsigned>(phase)});
    EXPECT_FALSE(report->found[0].possible_clone);
  }
}

TEST(RandMaster, S1_20_ADeviceThatDiesInAnyPhaseDoesNotHoldUpTheOthers) {
  for (int phase = 0; phase <= 8; ++phase) {
    World w;
    w.add(s2).dies_at = phase;
    w.add(s1);
    w.add(s4);
    const auto report = w.discover();
    ASSERT_TRUE(report);
    EXPECT_EQ(report->end, End::complete);
    EXPECT_EQ(addresses(*report), (std::vector{s4, s1})) << phase;
  }
}

TEST(RandMaster, S1_20_RetriesAreBounded) {
  World w;
  auto& n = w.add(s2);
  n.mute_at = 3;
  n.mute_times = 1'000'000;
  w.add(s1);
  w.options.retries = 2;
  const auto report = w.discover();
  ASSERT_TRUE(report);
  EXPECT_EQ(report->end, End::gave_up);
  EXPECT_EQ(report->restarts, 3U);
}

// A late answer would shift what is found by one phase; restarts widen the window until everybody is heard.
TEST(RandMaster, SlowDevicesAreFoundByWideningTheWindow) {
  World w;
  w.add(s2, milliseconds(70));
  w.add(s1, milliseconds(1));
  w.add(s4, milliseconds(33));
  w.options.t_resp = milliseconds(20);
  const auto report = w.discover();
  ASSERT_TRUE(report);
  const auto found = addresses(*report);
  EXPECT_EQ(std::set(found.begin(), found.end()), (std::set{s1, s2, s4}));
}

TEST(RandMaster, AStuckDeviceEndsTheDiscovery) {
  World w;
  w.add(s2).forgets = true;
  w.add(s1);
  const auto report = w.discover();
  ASSERT_TRUE(report);
  EXPECT_EQ(report->end, End::stuck);
  EXPECT_EQ(report->found.front().address, s2);
  EXPECT_GT(report->found.front().times_found, 1U);
}

TEST(RandMaster, LimitStopsTheDiscovery) {
  World w;
  for (const auto& a : {s1, s2, s3}) w.add(a);
  w.options.most_devices = 2;
  const auto report = w.discover();
  ASSERT_TRUE(report);
  EXPECT_EQ(report->end, End::limit);
  EXPECT_EQ(report->found.size(), 2U);
}

// S1.22, HC3.3: duplicate full 128-bit identities.
TEST(RandMaster, S1_22_ClonesAreMarkedAndBothIdentified) {
  World w;
  w.add(s2, milliseconds(1));
  w.add(s2, milliseconds(4));
  w.add(s1);
  Watch watch;
  const auto report = w.discover(&watch);
  ASSERT_TRUE(report);
  EXPECT_EQ(addresses(*report), (std::vector{s2, s1}));
  EXPECT_TRUE(report->found[0].possible_clone);
  EXPECT_EQ(report->found[0].dis_frames, 2U);
  EXPECT_FALSE(report->found[1].possible_clone);
  for (const auto& n : w.nodes) EXPECT_EQ(n->slave.state(), Identification::identified);
  EXPECT_EQ(std::ranges::count(watch.steps, PhaseEvent::Kind::confirm, &Watch::Step::kind), 9);
}

TEST(RandMaster, S1_22_ADisThatCanDeliveredTwiceIsNoClone) {
  World w;
  w.add(s2);
  w.add(s1);
  sim::Fault fault{.kind = sim::Fault::Kind::dominant};
  fault.trigger.when = [](const sim::FrameStart& f) {
    return decode_rand_answer(f.frame) && decode_rand_answer(f.frame)->direct;
  };
  fault.where = sim::from_end(0);
  fault.spare_senders = false;
  fault.victims = {w.nodes[0]->port.get()};  // the sender sees the error, repeats; the master has it already
  w.bus.inject(fault);
  const auto report = w.discover();
  ASSERT_TRUE(report);
  EXPECT_EQ(addresses(*report), (std::vector{s2, s1}));
  EXPECT_EQ(report->found[0].dis_frames, 2U) << "the fault did not strike as planned";
  EXPECT_FALSE(report->found[0].possible_clone);
}

TEST(RandMaster, S1_22_WithoutConfirmationTheFirstSignIsEnough) {
  World w;
  w.add(s2, milliseconds(1));
  w.add(s2, milliseconds(4));
  w.options.confirm_clones = false;
  const auto report = w.discover();
  ASSERT_TRUE(report);
  ASSERT_EQ(report->found.size(), 1U);
  EXPECT_TRUE(report->found[0].possible_clone);
  EXPECT_EQ(report->requests, 10U);
}

TEST(RandMaster, ADeviceThatResetsDuringTheDiscoveryIsNoClone) {
  World w;
  auto& n = w.add(s2);
  w.add(s1);
  Watch watch;
  watch.on_phase = [&] {
    if (watch.steps.size() == 12) n.slave.power_on();
  };
  const auto report = w.discover(&watch);
  ASSERT_TRUE(report);
  EXPECT_EQ(report->end, End::complete);
  EXPECT_EQ(report->found.size(), 2U);
  EXPECT_EQ(report->found[0].times_found, 2U);
  EXPECT_FALSE(report->found[0].possible_clone);
}

TEST(RandMaster, ProbeAsksOnceAndDoesNotDisturbTheNextDiscovery) {
  World w;
  w.add_witness();
  auto probe = w.run(w.master.any_unknown(w.options));
  ASSERT_TRUE(probe);
  EXPECT_FALSE(probe->anybody);
  w.add(s1);
  w.add(s2);
  probe = w.run(w.master.any_unknown(w.options));
  ASSERT_TRUE(probe);
  EXPECT_TRUE(probe->anybody);
  ASSERT_EQ(probe->heard.size(), 2U);
  EXPECT_EQ(probe->heard[0].chunk, 0x0000);
  EXPECT_EQ(probe->heard[1].chunk, 0x0100);
  // S1.17, the gap: phase 0 while selected is answered again.
  EXPECT_EQ(w.nodes[0]->slave.state(), Identification::selected);
  EXPECT_TRUE(w.run(w.master.any_unknown(w.options))->anybody);
  EXPECT_EQ(addresses(*w.discover()), (std::vector{s2, s1}));
  EXPECT_FALSE(w.run(w.master.any_unknown(w.options))->anybody);
}

TEST(RandMaster, DevicesThatArriveDuringADiscoveryAreFound) {
  World w;
  w.add(s1);
  w.add(s3);
  w.world.after(milliseconds(300), [&] { w.add(s2); });
  const auto report = w.discover();
  ASSERT_TRUE(report);
  const auto found = addresses(*report);
  EXPECT_EQ(std::set(found.begin(), found.end()), (std::set{s1, s2, s3}));
}

TEST(RandMaster, AnswersBeforeSentBelongToTheRequestBefore) {
  World w;
  w.add_witness();
  auto stranger = w.bus.attach();
  can::Dispatcher voice(w.world.executor(), *stranger);
  World::Done done;
  auto task = w.master.any_unknown(w.options);
  task.start(w.world.executor(), done);
  voice.send(ius(1));  // outranks the IURS: on the wire before it
  ASSERT_TRUE(w.world.run_until([&] { return done.done; }, seconds(5)));
  const auto probe = task.take();
  ASSERT_TRUE(probe);
  EXPECT_FALSE(probe->anybody);
}

TEST(RandMaster, OneProcedureAtATime) {
  World w;
  w.add(s1);
  World::Done done;
  auto task = w.master.discover(w.options);
  task.start(w.world.executor(), done);
  const auto second = w.run(w.master.any_unknown(w.options));
  ASSERT_FALSE(second);
  EXPECT_EQ(second.error().code, Errc::invalid);
  EXPECT_EQ(w.run(w.master.switch_global(Identification::unknown)).error().code, Errc::invalid);
  ASSERT_TRUE(w.world.run_until([&] { return done.done; }, seconds(5)));
  EXPECT_EQ(task.take()->found.size(), 1U);
  EXPECT_TRUE(w.run(w.master.any_unknown(w.options))) << "free again";
}

TEST(RandMaster, MayBeCancelledAtAnyTimeAndBegunAnew) {
  for (int step = 0; step < 80; ++step) {
    World w;
    for (const auto& a : {s1, s2, s4}) w.add(a);
    World::Done done;
    {
      auto task = w.master.discover(w.options);
      task.start(w.world.executor(), done);
      w.world.run_for(microseconds(3'700) * step);
    }
    ASSERT_TRUE(w.run(w.master.switch_global(Identification::unknown)));
    const auto report = w.discover();
    ASSERT_TRUE(report);
    EXPECT_EQ(addresses(*report), (std::vector{s2, s4, s1})) << step;
  }
}

TEST(RandMaster, ABusThatDoesNotAcknowledgeIsAnError) {
  World w;
  auto report = w.discover();
  ASSERT_FALSE(report);
  EXPECT_EQ(report.error().code, Errc::bus);
  w.port->power(false);
  report = w.discover();
  ASSERT_FALSE(report);
  EXPECT_EQ(report.error().code, Errc::bus);
  EXPECT_EQ(w.run(w.master.switch_selective(s1)).error().code, Errc::bus);
}

TEST(RandMaster, TheCableCutInTheMiddleEnds) {
  World w;
  w.add(s1);
  w.world.after(milliseconds(100), [&] { w.port->cable(false); });
  const auto report = w.discover();
  ASSERT_FALSE(report);
  EXPECT_EQ(report.error().code, Errc::bus);
}

// S1.31, literal slaves: nothing is heard until everybody is in LSS configuration.
TEST(RandMaster, S1_31_LiteralSlavesNeedConfiguration) {
  World w;
  w.nodes.push_back(std::make_unique<Node>(w.world, w.bus, RandSlaveOptions{.address = s1, .literal = true},
                                           [] { return rt::Duration(milliseconds(1)); }));
  EXPECT_TRUE(w.discover()->found.empty());
  w.nodes[0]->in_lss_configuration = true;
  EXPECT_EQ(addresses(*w.discover()), std::vector{s1});
}

// ---- random sets ------------------------------------------------------------------------------------------------

/// Up to 30 distinct addresses that share prefixes: each chunk is drawn from few values.
std::set<LssAddress> random_addresses(Random& random) {
  const auto count = 1 + random.below(30);
  const auto values = 1 + random.below(4);
  std::set<LssAddress> set;
  for (unsigned i = 0; i < 200 && set.size() < count; ++i) {
    const auto part = [&] {
      static constexpr std::uint16_t chunks[] = {0, 1, 0xFFFF, 0x8000};
      const auto chunk = [&]() -> std::uint32_t { return chunks[random.below(values)]; };
      return chunk() << 16 | chunk();
    };
    set.insert({part(), part(), part(), part() + static_cast<std::uint32_t>(random.below(values > 1 ? 2 : 40))});
  }
  return set;
}

RC_GTEST_PROP(RandMasterProperty, S1_18_AllAreFoundInAscendingOrderWith9NPlus1Requests, ()) {
  Random random(*rc::gen::arbitrary<std::uint64_t>());
  static constexpr std::uint32_t rates[] = {50'000, 125'000, 1'000'000};
  World w(rates[random.below(3)], random.next());
  if (random.chance(500'000)) w.world.executor().perturb(random.next());
  const auto set = random_addresses(random);
  w.options.t_resp = milliseconds(15);
  for (const auto& a : set) {
    // Each its own, or all the same: frames that merge.
    const auto latency =
        random.chance(500'000) ? nanoseconds(milliseconds(2)) : nanoseconds(random.between(0, 9'000'000));
    w.add(a, latency);
  }
  const auto report = w.discover();
  RC_ASSERT(report.has_value());
  RC_ASSERT(report->end == End::complete);
  RC_ASSERT(addresses(*report) == std::vector(set.begin(), set.end()));
  RC_ASSERT(report->requests == 9 * set.size() + 1);
  RC_ASSERT(report->restarts == 0U);
  for (const auto& d : report->found) RC_ASSERT(!d.possible_clone);
}

// Outliers, lost answers, disturbed frames, clones: what is found is really there, nothing hangs, and everybody who
// can be found is found.
RC_GTEST_PROP(RandMasterProperty, S1_20_S1_22_BadLuckEndsInAClearState, ()) {
  Random random(*rc::gen::arbitrary<std::uint64_t>());
  World w(250'000, random.next());
  w.world.executor().perturb(random.next());
  const auto set = random_addresses(random);
  std::set<LssAddress> cloned;
  for (const auto& a : set) {
    const auto seed = random.next();
    w.add(a, [r = Random(seed)]() mutable -> rt::Duration {
      return r.chance(5'000) ? nanoseconds(r.between(20'000'000, 90'000'000)) : nanoseconds(r.between(0, 8'000'000));
    });
    if (random.chance(100'000)) {
      w.nodes.back()->mute_at = static_cast<int>(random.below(9));
      w.nodes.back()->mute_times = 1;
    }
    if (random.chance(50'000)) {
      cloned.insert(a);
      w.add(a, nanoseconds(random.between(0, 8'000'000)));
    }
  }
  w.bus.faults().draw_from({.disturbed_per_million = 2'000, .overrun_per_million = 500});
  w.options.retries = 12;
  std::set<LssAddress> found;
  // A lost answer to phase 0 may end a discovery early: as in a running machine, ask until a whole one is empty.
  for (int round = 0; round < 6; ++round) {
    const auto report = w.discover();
    RC_ASSERT(report.has_value());
    RC_ASSERT(report->end == End::complete || report->end == End::gave_up || report->end == End::stuck);
    for (const auto& d : report->found) {
      RC_ASSERT(set.contains(d.address));
      if (d.possible_clone) RC_ASSERT(cloned.contains(d.address));
      found.insert(d.address);
    }
  }
  RC_ASSERT(found == set);
}

TEST(RandMaster, AQueueThatIsFullIsWaitedFor) {
  World w;
  w.add({0x0102'0304, 0x0506'0708, 0x090A'0B0C, 0x0D0E'0F10});
  while (w.dispatcher.send(can::Frame::base(0x600, {})) == can::Queued::yes) {
  }
  const auto report = w.discover();
  ASSERT_TRUE(report) << report.error().text;
  EXPECT_EQ(report->found.size(), 1U);
}

}  // namespace
}  // namespace berth::nodeid::test
