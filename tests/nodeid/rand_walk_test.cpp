// The walk of the tree of chunks against RAND slaves on the simulated bus: paper slaves, resuming slaves, both.
#include "berth/nodeid/rand_walk.hpp"

#include <gtest/gtest.h>
#include <algorithm>
#include <cstdint>
#include <cstdio>
#include <set>
#include <string>
#include <vector>

#include "tests/harness/rand_world.hpp"

namespace berth::nodeid::test::rand_walk_tests {
namespace {

using End = DiscoveryReport::End;

struct WalkWorld : World {
  using World::World;
  Node& put(const LssAddress& address, bool resume, std::function<rt::Duration()> latency) {
    nodes.push_back(
        std::make_unique<Node>(world, bus, RandSlaveOptions{.address = address, .resume = resume}, std::move(latency)));
    return *nodes.back();
  }
  Node& put(const LssAddress& address, bool resume, rt::Duration latency = milliseconds(1)) {
    return put(address, resume, [latency] { return latency; });
  }
  Result<WalkReport> go(std::vector<WalkKind> kinds = {}) { return run(walk.discover(kinds, walk_options)); }
  RandWalk walk{dispatcher};
  WalkOptions walk_options;
};

std::set<LssAddress> found(const WalkReport& report) {
  std::set<LssAddress> all;
  for (const auto& d : report.found) all.insert(d.address);
  EXPECT_EQ(all.size(), report.found.size()) << "an address twice";
  return all;
}
std::set<LssAddress> there(const WalkWorld& w) {
  std::set<LssAddress> all;
  for (const auto& n : w.nodes) {
    if (!n->dead) all.insert(n->slave.address());
  }
  return all;
}
void expect_silent(const WalkWorld& w) {
  for (const auto& n : w.nodes) {
    if (n->dead) continue;
    EXPECT_EQ(n->slave.state(), Identification::identified);
  }
}

constexpr LssAddress s1{0x0100'0001, 1, 0, 0x0A};
constexpr LssAddress s2{1, 1, 0, 5};
constexpr LssAddress s3{1, 5, 0, 8};
constexpr LssAddress s4{1, 1, 0, 6};
constexpr LssAddress s5{1, 1, 0x1'0000, 7};

TEST(RandWalk, NobodyThere) {
  for (const bool resume : {false, true}) {
    WalkWorld w;
    w.add_witness();
    w.walk_options.resume = resume;
    const auto report = w.go();
    ASSERT_TRUE(report);
    EXPECT_EQ(report->end, End::complete);
    EXPECT_TRUE(report->found.empty());
    EXPECT_EQ(report->requests, resume ? 2U : 1U);
  }
}

// One paper slave: the frames of the published procedure and nothing else.
TEST(RandWalk, S1_25_OnePaperSlaveSeesTheFramesOfThePaper) {
  WalkWorld w;
  w.put({0x0102'0304, 0x0506'0708, 0x090A'0B0C, 0x0D0E'0F10}, false);
  w.walk_options.resume = false;
  const Record record(w.bus);
  ASSERT_TRUE(w.go());
  const std::vector<std::string> figure{"1F940000#80000000", "1F500408#", "1F940000#80010102", "1F500C10#",
                                        "1F940000#80020304", "1F501418#", "1F940000#80030506", "1F501C20#",
                                        "1F940000#80040708", "1F502428#", "1F940000#8005090A", "1F502C30#",
                                        "1F940000#80060B0C", "1F503438#", "1F940000#80070D0E", "1F503C40#",
                                        "1F940000#80080F10", "1F903C40#", "1F940000#80000000"};
  EXPECT_EQ(record.text, figure);
}

TEST(RandWalk, PaperResumingAndMixedSlavesAreAllFoundAndIdentified) {
  for (unsigned mask = 0; mask < 32; ++mask) {
    for (const bool known : {false, true}) {
      WalkWorld w;
      unsigned i = 0;
      for (const auto& a : {s1, s2, s3, s4, s5}) {
        w.put(a, (mask >> i & 1U) != 0, microseconds(300 + 200 * i));
        ++i;
      }
      std::vector<WalkKind> kinds;
      if (known) kinds = {{.type = {1, 1}, .revision = 0}, {.type = {1, 5}}, {.type = {7, 7}}};
      const auto report = w.go(kinds);
      ASSERT_TRUE(report);
      EXPECT_EQ(report->end, End::complete) << mask;
      EXPECT_EQ(found(*report), there(w)) << mask << known;
      expect_silent(w);
      for (const auto& d : report->found) {
        EXPECT_FALSE(d.possible_clone);
        EXPECT_EQ(d.times_found, 1U);
      }
      EXPECT_EQ(report->dropped, 0U);
      EXPECT_LE(report->known, report->silenced);
      EXPECT_LE(report->silenced, report->ended);
    }
  }
}

struct Steps {
  rt::Duration time{};  // until all are known
  std::set<LssAddress> found, there;
  unsigned rounds = 0;
};
Steps walk_steps(const std::vector<std::uint32_t>& serials) {
  WalkWorld w;
  for (const auto serial : serials) w.put({1, 2, 3, serial}, false, microseconds(300));
  const auto report = w.go();
  if (!report || report->end != End::complete) return {};
  expect_silent(w);
  return {report->known - report->began, found(*report), there(w), report->rounds};
}

// Serial numbers in steps too large for two under one prefix: two differences that agree tell the next ones.
TEST(RandWalk, SerialNumbersInEqualStepsAreGuessed) {
  std::vector<std::uint32_t> equal;
  std::vector<std::uint32_t> uneven;
  for (std::uint32_t i = 0; i < 15; ++i) {
    equal.push_back(0x8000'1234 + i * 0x1'0010);
    uneven.push_back(0x8000'1234 + i * 0x1'0000 + 0x1F * (i * i));
  }
  const auto guessed = walk_steps(equal);
  const auto led = walk_steps(uneven);
  EXPECT_EQ(guessed.there.size(), 15U);
  EXPECT_EQ(guessed.found, guessed.there);
  EXPECT_EQ(led.found, led.there);
  EXPECT_LT(3 * guessed.time, 2 * led.time);
}

// Where several serial numbers can lie under one prefix, none is guessed: the others would cost another round.
TEST(RandWalk, SmallStepsAreNotGuessed) {
  std::vector<std::uint32_t> serials;
  for (std::uint32_t i = 0; i < 30; ++i) serials.push_back(0xFFF0 + i);
  const auto steps = walk_steps(serials);
  EXPECT_EQ(steps.found, steps.there);
  EXPECT_EQ(steps.rounds, 2U);
}

// The guess is right, and hides a second device under its prefix; or it is wrong, once, twice and again.
TEST(RandWalk, AGuessedSerialNumberHidesNoDevice) {
  const std::uint32_t a = 0x1000'0007;
  const std::uint32_t d = 0x2'0000;
  const std::vector<std::vector<std::uint32_t>> all{
      {a, a + d, a + 2 * d, a + 3 * d, a + 3 * d + 1, a + 4 * d},
      {a, a + d, a + 2 * d, a + 3 * d + 1, a + 4 * d},
      {a, a + d, a + 2 * d, a + 3 * d + 1, a + 4 * d + 2, a + 5 * d + 3, a + 6 * d + 4, a + 7 * d + 4},
      {0xFFFD'0000, 0xFFFE'0000, 0xFFFF'0000, 0xFFFF'FFFF},
  };
  for (const auto& serials : all) {
    const auto steps = walk_steps(serials);
    EXPECT_EQ(steps.there.size(), serials.size());
    EXPECT_EQ(steps.found, steps.there);
  }
}

// Resuming slaves: each node of the tree once, and two requests when type and revision are known.
// Its DIS is lost: it is identified, answers nothing any more, and the master does not know it.
TEST(RandWalk, AGuessedSerialNumberWhoseAnswerIsLostIsFound) {
  for (unsigned lost = 3; lost < 8; ++lost) {
    WalkWorld w;
    for (std::uint32_t i = 0; i < 8; ++i) w.put({1, 2, 3, 0x8000'1234 + i * 0x1'0010}, false, microseconds(300));
    w.nodes[lost]->mute_at = 8;
    w.nodes[lost]->mute_times = 1;
    const auto report = w.go();
    ASSERT_TRUE(report);
    EXPECT_EQ(report->end, End::complete);
    EXPECT_EQ(found(*report), there(w)) << lost;
    expect_silent(w);
  }
}

// The requests before it followed each other at once, and the device is silent: it is asked again in the same round.
TEST(RandWalk, ABranchThatWasAskedTooFastIsAskedAgain) {
  WalkWorld w;
  w.put({1, 1, 0, 5}, false);
  auto& second = w.put({1, 1, 0x1'0000, 5}, false);
  second.mute_at = 5;
  second.mute_times = 1;
  const auto report = w.go();
  ASSERT_TRUE(report);
  EXPECT_EQ(found(*report), there(w));
  EXPECT_EQ(report->dead_branches, 1U);
  EXPECT_EQ(report->rounds, 2U) << "the way on, and phase 0 that nobody answers";
}

TEST(RandWalk, ResumingSlavesOfAKnownTypeTakeTwoRequests) {
  WalkWorld w;
  for (unsigned i = 0; i < 30; ++i) w.put({1, 2, 3, 0x4000 + i}, true);
  const auto report = w.go({{.type = {1, 2}, .revision = 3}});
  ASSERT_TRUE(report);
  EXPECT_EQ(found(*report), there(w));
  EXPECT_EQ(report->requests, 2 + 30 + 1U) << "chunk(6), chunk(7), a DIRS each, the closing phase 0";
  for (const auto& d : report->found) EXPECT_TRUE(d.proven && d.resumes);
}

TEST(RandWalk, AMasterOfThePaperFindsResumingSlaves) {
  WalkWorld w;
  for (const auto& a : {s1, s2, s3, s4, s5}) w.put(a, true);
  const auto report = w.discover();
  ASSERT_TRUE(report);
  EXPECT_EQ(addresses(*report), (std::vector{s2, s4, s5, s3, s1}));
  EXPECT_EQ(report->requests, 5 * 9 + 1U);
}

// HC3.3, S1.22: two with one address.
TEST(RandWalk, S1_22_ClonesAreMarkedAndBothIdentified) {
  for (const bool resume : {false, true}) {
    WalkWorld w;
    w.put(s2, resume, milliseconds(1));
    w.put(s2, resume, milliseconds(4));
    w.put(s1, resume);
    w.put(s4, resume);
    const auto report = w.go();
    ASSERT_TRUE(report);
    EXPECT_EQ(report->end, End::complete);
    EXPECT_EQ(found(*report), there(w));
    for (const auto& d : report->found) EXPECT_EQ(d.possible_clone, d.address == s2) << resume;
    expect_silent(w);
  }
}

TEST(RandWalk, ADeviceThatForgetsEndsTheWalkAsStuck) {
  for (const bool resume : {false, true}) {
    WalkWorld w;
    w.put(s2, resume).forgets = true;
    w.put(s1, resume);
    const auto report = w.go();
    ASSERT_TRUE(report);
    EXPECT_TRUE(report->end == End::stuck || report->end == End::gave_up);
    EXPECT_EQ(found(*report), there(w));
  }
}

// Speaks half: never answers one phase.
TEST(RandWalk, ADeviceThatNeverAnswersOnePhaseDoesNotHoldUpTheOthers) {
  for (int phase = 1; phase <= 8; ++phase) {
    WalkWorld w;
    auto& half = w.put(s2, false);
    half.mute_at = phase;
    half.mute_times = 1'000'000;
    w.put(s1, false);
    w.put(s4, true);
    w.put(s3, false);
    w.walk_options.retries = 2;
    const auto report = w.go();
    ASSERT_TRUE(report);
    // Others of its branch may answer in its place: then it is found all the same.
    EXPECT_TRUE(found(*report).contains(s2) || report->end == End::gave_up) << phase;
    for (const auto& a : {s1, s3, s4}) EXPECT_TRUE(found(*report).contains(a)) << phase;
    for (const auto& a : found(*report)) EXPECT_TRUE(there(w).contains(a));
  }
}

TEST(RandWalk, AnAnswerMissingOnceCostsARoundOnly) {
  for (int phase = 0; phase <= 8; ++phase) {
    WalkWorld w;
    auto& n = w.put(s2, false);
    n.mute_at = phase;
    n.mute_times = 1;
    w.put(s1, false);
    w.put(s4, false);
    const auto report = w.go();
    ASSERT_TRUE(report);
    EXPECT_EQ(report->end, End::complete) << phase;
    EXPECT_EQ(found(*report), there(w)) << phase;
    expect_silent(w);
  }
}

TEST(RandWalk, ADeviceThatDiesAtAnyRequestLeavesTheOthers) {
  for (int phase = 0; phase <= 8; ++phase) {
    WalkWorld w;
    w.put(s2, false).dies_at = phase;
    w.put(s1, false);
    w.put(s4, false);
    const auto report = w.go();
    ASSERT_TRUE(report);
    EXPECT_EQ(report->end, End::complete) << phase;
    for (const auto& a : {s1, s4}) EXPECT_TRUE(found(*report).contains(a)) << phase;
    for (const auto& d : report->found) EXPECT_TRUE(d.address != s2 || !d.proven || phase > 8);
  }
}

// S1.20: the window has been learnt from many fast answers; one device's chunk(6) comes when it is over. The last chunk
// is asked only when nothing of it can be under way, else 0100 would be taken for a serial number under 0001.
TEST(RandWalk, ALateChunkIsNoSerialNumber) {
  for (std::uint64_t seed = 1; seed <= 20; ++seed) {
    WalkWorld w(125'000, seed);
    for (std::uint32_t i = 0; i < 16; ++i) {
      auto dice = std::make_shared<Random>(100 * seed + i);
      w.put({1, 1, 0, 0x0001'0005 + i}, false, [dice] { return rt::Duration(dice->between(200'000, 2'000'000)); });
    }
    auto answers = std::make_shared<int>(0);
    w.put({1, 1, 0, 0x0100'0007}, false,
          [answers] { return rt::Duration(++*answers == 7 ? milliseconds(8) : microseconds(500)); });
    w.walk_options.longest = milliseconds(10);
    const auto report = w.go();
    ASSERT_TRUE(report);
    EXPECT_EQ(found(*report), there(w)) << seed;
  }
}

// One that is late with its chunk(1) and deaf meanwhile does not hear that another way is gone, and goes it to its end:
// its DIS ends an address whose first part is the other's (seed 800130 of `planner-rand`).
TEST(RandWalk, AWayThatADeafDeviceHasJoinedProvesNothing) {
  struct Deafness final : can::Tap {
    Deafness(WalkWorld& world, Node& node) : w(&world), who(&node), voice(world.bus.attach()) { w->bus.add_tap(*this); }
    ~Deafness() { w->bus.remove_tap(*this); }
    void frame(const can::Frame& frame, rt::Time, int) noexcept override {
      if (frame.data[0] != 0x80 || frame.data[1] != 1 || joined) return;
      const bool its_own = frame.data[2] == 0 && frame.data[3] == 0;
      w->world.after(microseconds(1), [this, its_own] { who->port->deaf(its_own); });
      deaf = deaf || its_own;
      joined = deaf && !its_own;
      if (!joined) return;
      w->world.after(milliseconds(1), [this] { voice->send(ius(1), 0); });
    }
    WalkWorld* w;
    Node* who;
    std::unique_ptr<sim::Controller> voice;
    bool deaf = false;
    bool joined = false;
  };
  WalkWorld w;
  w.put({0x40FB'5B65, 0x81BB'3212, 0xC085'19D3, 0x10FC}, false);
  Node& late = w.put({1, 0x041A'FBAF, 0xBE2E'1956, 0x10FB}, false);
  late.mute_at = late.mute_times = 1;
  const Deafness deafness(w, late);
  w.walk_options.prove_all = true;
  const auto report = w.go();
  ASSERT_TRUE(report);
  EXPECT_TRUE(deafness.joined);
  EXPECT_EQ(found(*report), there(w));
}

TEST(RandWalk, LimitAndBusErrors) {
  WalkWorld w;
  for (const auto& a : {s1, s2, s3}) w.put(a, false);
  w.walk_options.most_devices = 1;
  const auto report = w.go();
  ASSERT_TRUE(report);
  EXPECT_EQ(report->end, End::limit);
  WalkWorld alone;
  alone.walk_options.send_timeout = milliseconds(50);
  const auto none = alone.go();
  ASSERT_FALSE(none);
  EXPECT_EQ(none.error().code, Errc::bus);
}

// ---- bad luck, seeded ----------------------------------------------------------------------------------------------

std::vector<LssAddress> draw_addresses(Random& random, unsigned count) {
  std::set<LssAddress> all;
  const bool consecutive = random.chance(500'000);
  while (all.size() < count) {
    const auto serial = consecutive ? static_cast<std::uint32_t>(0xFFF0 + random.below(2 * count))
                                    : static_cast<std::uint32_t>(random.next());
    all.insert({1 + static_cast<std::uint32_t>(random.below(2)), 1 + static_cast<std::uint32_t>(random.below(3)),
                static_cast<std::uint32_t>(random.below(2)) << 16, serial});
  }
  return {all.begin(), all.end()};
}

// 1 % of the answers come after 8 ms instead of 0.2 to 2: no wrong address, and all are found.
void outliers(std::uint64_t seed) {
  Random random(seed);
  WalkWorld w(125'000, seed);
  for (const auto& a : draw_addresses(random, 2 + static_cast<unsigned>(random.below(9)))) {
    auto dice = std::make_shared<Random>(random.next());
    w.put(a, random.chance(500'000), [dice] {
      return dice->chance(10'000) ? rt::Duration(milliseconds(8)) : rt::Duration(dice->between(200'000, 2'000'000));
    });
  }
  w.walk_options.longest = milliseconds(10);
  std::vector<WalkKind> kinds;
  if (random.chance(500'000)) kinds.push_back({.type = {1, 1}, .revision = 0});
  const auto report = w.go(kinds);
  ASSERT_TRUE(report);
  EXPECT_EQ(report->end, End::complete) << seed;
  EXPECT_EQ(found(*report), there(w)) << seed;
  for (const auto& d : report->found) EXPECT_FALSE(d.possible_clone) << seed;
  expect_silent(w);
}
TEST(RandWalkProperty, OnePercentOutliersOf8ms1000Seeds) {
  for (std::uint64_t seed = 1; seed <= 1000 && !testing::Test::HasFailure(); ++seed) outliers(seed);
}

// Somebody repeats old answers, invents chunks of other phases and doubles frames at random times.
void forged(std::uint64_t seed) {
  Random random(seed);
  WalkWorld w(250'000, seed);
  const auto all = draw_addresses(random, 2 + static_cast<unsigned>(random.below(5)));
  for (const auto& a : all) w.put(a, random.chance(500'000), microseconds(random.between(100, 3000)));
  auto liar = w.bus.attach();
  can::Dispatcher voice(w.world.executor(), *liar);
  int lies = 12;
  std::function<void()> lie = [&] {
    const auto& a = all[random.below(all.size())];
    const auto chunk = a.chunk(static_cast<unsigned>(random.below(8)));
    voice.send(random.chance(800'000) ? ius(chunk) : dis(chunk));
    if (--lies > 0) w.world.after(microseconds(random.between(500, 30'000)), lie);
  };
  w.world.after(microseconds(random.between(100, 5000)), lie);
  w.walk_options.prove_all = true;
  const auto report = w.go();
  ASSERT_TRUE(report);
  EXPECT_EQ(report->end, End::complete) << seed;
  EXPECT_EQ(found(*report), there(w)) << seed;
  lies = 0;
  w.world.run_for(milliseconds(50));
}
TEST(RandWalkProperty, ForgedLateAndDoubledAnswersGiveNoWrongAddress) {
  for (std::uint64_t seed = 1; seed <= 200 && !testing::Test::HasFailure(); ++seed) forged(seed);
}

TEST(RandWalkProperty, ADeviceThatJoinsAtAnyTimeIsFound) {
  for (std::uint64_t seed = 1; seed <= 100; ++seed) {
    Random random(seed);
    WalkWorld w(125'000, seed);
    for (const auto& a : draw_addresses(random, 5)) w.put(a, random.chance(500'000));
    const LssAddress late{1, 1, 0, static_cast<std::uint32_t>(random.below(0x2'0000))};
    w.world.after(microseconds(random.between(0, 300'000)), [&] { w.put(late, seed % 2 == 0); });
    const auto report = w.go();
    ASSERT_TRUE(report);
    EXPECT_EQ(report->end, End::complete) << seed;
    if (w.nodes.size() < 6 || there(w).size() < 6) continue;                    // came after the end, or drawn twice
    if (w.nodes.back()->slave.state() != Identification::identified) continue;  // after the last phase 0
    EXPECT_EQ(found(*report), there(w)) << seed;
  }
}

// Frames of the requests are lost at single devices: a slave that missed one never answers for another's prefix.
TEST(RandWalkProperty, LostRequestsGiveNoWrongAddress) {
  for (std::uint64_t seed = 1; seed <= 150; ++seed) {
    Random random(seed);
    WalkWorld w(250'000, seed);
    for (const auto& a : draw_addresses(random, 6)) w.put(a, random.chance(500'000), microseconds(700));
    for (unsigned i = 0; i < 12; ++i) {
      auto* node = w.nodes[random.below(w.nodes.size())].get();
      const auto at = microseconds(random.between(0, 250'000));
      w.world.after(at, [node] { node->port->deaf(true); });
      w.world.after(at + milliseconds(3), [node] { node->port->deaf(false); });
    }
    w.walk_options.retries = 8;
    const auto report = w.go();
    ASSERT_TRUE(report);
    EXPECT_EQ(report->end, End::complete) << seed;
    auto all = found(*report);
    EXPECT_TRUE(std::ranges::includes(there(w), all)) << seed;
    // Who was deaf at the closing phase 0 is still unknown, and the next walk finds it.
    w.world.run_for(milliseconds(300));
    const auto again = w.go();
    ASSERT_TRUE(again);
    for (const auto& a : found(*again)) all.insert(a);
    EXPECT_EQ(all, there(w)) << seed;
    expect_silent(w);
  }
}

// ---- the aim -------------------------------------------------------------------------------------------------------

double ms(rt::Duration d) { return static_cast<double>(d.count()) / 1e6; }

struct Case {
  bool random_serials, resume, known;
  double least;  // times less bus time than published
};
// 30 blank slaves of one type, 50 kbit/s, 4 ms response; both sides close a window 4 ms after the last answer.
void against_published(const Case& c) {
  const auto fill = [&](WalkWorld& w) {
    Random random(7);
    for (unsigned i = 0; i < 30; ++i) {
      const auto serial = c.random_serials ? static_cast<std::uint32_t>(random.next()) : 0x0001'2340 + i;
      w.put({0x0100'0001, 0x0001'0002, 0x0001'0000, serial}, c.resume, milliseconds(4));
    }
  };
  const rt::Duration first = milliseconds(4) + microseconds(1'600);  // the response, and an IUS of 80 bits
  WalkWorld published(50'000);
  fill(published);
  published.options.t_resp = milliseconds(4);
  published.options.first = first;
  const auto nine = published.discover();
  ASSERT_TRUE(nine);
  ASSERT_EQ(nine->found.size(), 30U);
  const auto until_known = nine->found.back().at - nine->began;
  WalkWorld walk(50'000);
  fill(walk);
  walk.walk_options.longest = first;
  walk.walk_options.after_last = milliseconds(4);
  std::vector<WalkKind> kinds;
  if (c.known) kinds.push_back({.type = {0x0100'0001, 0x0001'0002}});
  const auto once = walk.go(kinds);
  ASSERT_TRUE(once);
  EXPECT_EQ(found(*once), there(walk));
  const auto ratio = ms(until_known) / ms(once->known - once->began);
  std::printf(
      "%-11s serials, %-6s slaves, type %-7s: published %7.1f ms, walk %7.1f ms, %5.1f times less; "
      "all silenced %7.1f, closed %7.1f of %7.1f ms\n",
      c.random_serials ? "random" : "consecutive", c.resume ? "resume" : "paper", c.known ? "known" : "unknown",
      ms(until_known), ms(once->known - once->began), ratio, ms(once->silenced - once->began),
      ms(once->ended - once->began), ms(nine->ended - nine->began));
  EXPECT_GE(ratio, c.least);
}
TEST(RandWalkAim, ConsecutiveSerialsTwentyTimesLess) {
  for (const bool known : {false, true}) {
    against_published({false, false, known, 20});
    against_published({false, true, known, 20});
  }
}
TEST(RandWalkAim, RandomSerialsFiveTimesLessWithTheExtension) {
  for (const bool known : {false, true}) {
    against_published({true, true, known, 5});
    against_published({true, false, known, 1.6});  // what unmodified slaves allow
  }
}

}  // namespace
}  // namespace berth::nodeid::test::rand_walk_tests
