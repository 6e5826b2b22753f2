// AND as Berth speaks it: frames by hand from docs/and.md, slave, master, and the comparison of paper 1.
#include <gtest/gtest.h>
#include <rapidcheck/gtest.h>
#include <cstdint>
#include <set>
#include <string>
#include <vector>

#include "berth/nodeid/paper1_times.hpp"
#include "berth/research/and_master.hpp"
#include "berth/research/and_slave.hpp"
#include "tests/harness/rand_world.hpp"

namespace berth::research::test {
namespace {

using namespace nodeid;
using namespace nodeid::test;

using End = DiscoveryReport::End;
using I = Identification;

constexpr LssAddress odd{0x0102'0304, 0x0506'0708, 0x090A'0B0C, 0x0D0E'0F10};
constexpr std::uint64_t odd_value = 0x0708'0D0E'0F10;

std::string ask(AndSlave& slave, const std::string& text) {
  const auto answer = slave.handle(*can::parse_frame("7C2#" + text));
  return answer ? can::to_string(*answer) : "";
}

TEST(AndFrames, S1_44_AddressIsTwelveNibblesOfProductAndSerial) {
  EXPECT_EQ(AndAddress(odd).value(), odd_value);
  const std::vector<int> nibbles{0, 7, 0, 8, 0, 0xD, 0, 0xE, 0, 0xF, 1, 0};
  for (unsigned i = 0; i < 12; ++i) EXPECT_EQ(AndAddress(odd).nibble(i), nibbles[i]) << i;
  EXPECT_EQ(AndAddress(odd).prefix(0).value(), 0U);
  EXPECT_EQ(AndAddress(odd).prefix(4).value(), 0x0708'0000'0000U);
  EXPECT_EQ(AndAddress(odd).prefix(12).value(), odd_value);
  EXPECT_EQ(AndAddress(odd).with(11, 5).value(), 0x0708'0D0E'0F15U);
  EXPECT_EQ(AndAddress(odd).with(0, 15).value(), 0xF708'0D0E'0F10U);
}

TEST(AndFrames, S1_44_AllAreBaseFramesWithEightBytes) {
  EXPECT_EQ(can::to_string(and_iurs(0, AndAddress(odd))), "7C2#8000000000000000");
  EXPECT_EQ(can::to_string(and_iurs(3, AndAddress(odd))), "7C2#8003070000000000");
  EXPECT_EQ(can::to_string(and_iurs(11, AndAddress(odd))), "7C2#800B07080D0E0F10");
  EXPECT_EQ(can::to_string(and_dirs(AndAddress(odd))), "7C2#800C07080D0E0F10");
  EXPECT_EQ(can::to_string(and_switch_global(I::identified)), "7C2#8101000000000000");
  EXPECT_EQ(can::to_string(and_switch_selective(AndAddress(odd), I::unknown)), "7C2#820007080D0E0F10");
  EXPECT_EQ(can::to_string(and_inquire(1)), "7C2#8301000000000000");
  EXPECT_EQ(can::to_string(and_ius(0)), "7A0#0000000000000000");
  EXPECT_EQ(can::to_string(and_ius(15)), "7AF#0000000000000000");
  EXPECT_EQ(can::to_string(and_dis(9)), "7B9#0000000000000000");
  EXPECT_EQ(can::to_string(and_address(odd, 0)), "7C0#0102030405060708");
  EXPECT_EQ(can::to_string(and_address(odd, 1)), "7C1#090A0B0C0D0E0F10");
}

TEST(AndFrames, NothingElseIsARequestOrAnAnswer) {
  for (const auto* text : {"7C2#80000000000000", "7C2#800D000000000000", "7C2#8000100000000000", "7C2#8003070800000000",
                           "7C2#8102000000000000", "7C2#8101000000000001", "7C2#8202000000000000",
                           "7C2#8302000000000000", "7C2#8300000000000001", "7C2#8400000000000000",
                           "7C2#5100000000000000", "7C2#R8", "7C1#8000000000000000", "000007C2#8000000000000000"}) {
    EXPECT_FALSE(decode_and_request(*can::parse_frame(text))) << text;
  }
  for (const auto* text : {"7A0#", "7A0#00", "7A0#R8", "79F#0000000000000000", "7C2#0000000000000000",
                           "000007A0#0000000000000000", "7E4#4F00000000000000"}) {
    EXPECT_FALSE(decode_and_answer(*can::parse_frame(text))) << text;
  }
}

RC_GTEST_PROP(AndFrames, EveryRequestReadsBack, (std::uint64_t value)) {
  const AndAddress address(value);
  const auto phase = *rc::gen::inRange(0U, 12U);
  const auto i = decode_and_request(and_iurs(phase, address));
  RC_ASSERT(i && i->kind == AndRequest::Kind::identify && i->phase == phase && i->address == address.prefix(phase));
  const auto d = decode_and_request(and_dirs(address));
  RC_ASSERT(d && d->kind == AndRequest::Kind::direct && d->address == address);
  const auto s = decode_and_request(and_switch_selective(address, I::identified));
  RC_ASSERT(s && s->kind == AndRequest::Kind::switch_selective && s->address == address);
}

TEST(AndSlave, S1_44_TwelvePhasesAndADirectIdentification) {
  AndSlave slave(odd);
  EXPECT_EQ(ask(slave, "8000000000000000"), "7A0#0000000000000000");
  EXPECT_EQ(ask(slave, "8001000000000000"), "7A7#0000000000000000");
  EXPECT_EQ(ask(slave, "8002070000000000"), "7A0#0000000000000000");
  EXPECT_EQ(ask(slave, "8003070000000000"), "7A8#0000000000000000");
  EXPECT_EQ(ask(slave, "800B07080D0E0F10"), "7A0#0000000000000000");
  EXPECT_EQ(ask(slave, "800A07080D0E0F00"), "7A1#0000000000000000") << "back: any prefix at any time";
  EXPECT_EQ(ask(slave, "800207F000000000"), "") << "no prefix of two nibbles";
  EXPECT_EQ(ask(slave, "8002060000000000"), "");
  EXPECT_EQ(slave.state(), I::unknown);
  EXPECT_EQ(ask(slave, "800C07080D0E0F11"), "");
  EXPECT_EQ(ask(slave, "8300000000000000"), "") << "not found yet";
  EXPECT_EQ(ask(slave, "800C07080D0E0F10"), "7B0#0000000000000000");
  EXPECT_EQ(slave.state(), I::identified);
  EXPECT_EQ(ask(slave, "8300000000000000"), "7C0#0102030405060708");
  EXPECT_EQ(ask(slave, "8301000000000000"), "7C1#090A0B0C0D0E0F10");
  EXPECT_EQ(ask(slave, "8000000000000000"), "") << "identified";
  EXPECT_EQ(ask(slave, "8300000000000000"), "") << "another request came in between";
  EXPECT_EQ(ask(slave, "820007080D0E0F10"), "");
  EXPECT_EQ(slave.state(), I::unknown);
  EXPECT_EQ(ask(slave, "8101000000000000"), "");
  EXPECT_EQ(slave.state(), I::identified);
  EXPECT_EQ(ask(slave, "820007080D0E0F11"), "");
  EXPECT_EQ(slave.state(), I::identified) << "another's";
  slave.power_on();
  EXPECT_EQ(slave.state(), I::unknown);
}

/// A device that is nothing but an AND slave.
class AndNode final : private can::Handler {
 public:
  AndNode(sim::World& world, sim::Bus& bus, const LssAddress& address, std::function<rt::Duration()> latency)
      : slave(address),
        port(bus.attach({.queue_depth = 16})),
        world_(world),
        latency_(std::move(latency)),
        dispatcher_(world.executor(), *port) {
    dispatcher_.add(and_requests, *this);
  }
  AndSlave slave;
  std::unique_ptr<sim::Controller> port;
  int mute = 0;  // answers not sent, the next ones

 private:
  void received(const can::Frame& frame, rt::Time) noexcept override {
    const auto answer = slave.handle(frame);
    if (!answer) return;
    if (mute > 0) {
      --mute;
      return;
    }
    world_.after(latency_(), [this, f = *answer] { dispatcher_.send(f); });
  }
  sim::World& world_;
  std::function<rt::Duration()> latency_;
  can::Dispatcher dispatcher_;
};

struct AndWorld : World {
  using World::World;
  AndNode& put(const LssAddress& address, std::function<rt::Duration()> latency) {
    slaves.push_back(std::make_unique<AndNode>(world, bus, address, std::move(latency)));
    return *slaves.back();
  }
  AndNode& put(const LssAddress& address, rt::Duration latency = milliseconds(1)) {
    return put(address, [latency] { return latency; });
  }
  Result<AndReport> go() { return run(and_master.discover(and_options)); }
  AndMaster and_master{dispatcher};
  AndOptions and_options;
  std::vector<std::unique_ptr<AndNode>> slaves;
};

std::vector<LssAddress> found(const AndReport& report) {
  std::vector<LssAddress> all;
  for (const auto& d : report.found) all.push_back(d.address.value_or(LssAddress{}));
  return all;
}

constexpr LssAddress a{9, 1, 7, 0x10};
constexpr LssAddress b{9, 1, 7, 0x11};
constexpr LssAddress c{1, 2, 3, 0x05};

// SX.2: AND finds by product and serial number, not by vendor first as RAND and Fastscan do.
TEST(AndMaster, SX_2_FindsAscendingByItsOwnAddress) {
  for (const bool recursive : {false, true}) {
    AndWorld w;
    for (const auto& address : {c, b, a}) w.put(address);
    w.and_options.recursive = recursive;
    const auto report = w.go();
    ASSERT_TRUE(report);
    EXPECT_EQ(report->end, End::complete);
    EXPECT_EQ(found(*report), (std::vector{a, b, c}));
    // Thirteen requests and two inquiries each, and the closing phase 0. Recursive: b shares eleven phases with a and
    // three with c, so b takes its DIRS only, and c phases 4 to 11 and its DIRS.
    EXPECT_EQ(report->requests, recursive ? 13 + 1 + 9 + 3 * 2 + 1U : 3 * 15 + 1U);
    for (const auto& s : w.slaves) EXPECT_EQ(s->slave.state(), I::identified);
  }
}

TEST(AndMaster, NobodyThereIsOneRequest) {
  AndWorld w;
  w.add_witness();
  const Record record(w.bus);
  const auto report = w.go();
  ASSERT_TRUE(report);
  EXPECT_EQ(report->requests, 1U);
  EXPECT_EQ(record.text, std::vector<std::string>{"7C2#8000000000000000"});
  const auto probe = w.run(w.and_master.any_unknown(w.and_options));
  ASSERT_TRUE(probe);
  EXPECT_FALSE(*probe);
}

TEST(AndMaster, TwoDevicesWithOneAndAddressAreTold) {
  for (const unsigned late : {1U, 3U}) {
    AndWorld w;
    w.put({1, 0x0001'0002, 3, 4}, milliseconds(1));
    w.put({2, 0x0002'0002, 3, 4}, milliseconds(late));  // the same 48 bits
    w.put(a);
    const auto report = w.go();
    ASSERT_TRUE(report);
    ASSERT_EQ(report->found.size(), 2U);
    EXPECT_EQ(report->found[0].address, a);
    EXPECT_TRUE(report->found[1].ambiguous) << late;
    EXPECT_FALSE(report->found[1].address);
    EXPECT_EQ(w.bus.statistics().collisions > 0, late == 1) << "two inquiries answered at one instant";
  }
}

// Not at the phase 0 that only this device would answer: to a master that is the end of the discovery (S1.21).
TEST(AndMaster, AnAnswerMissingOnceIsRetried) {
  for (unsigned skip = 0; skip < 12; ++skip) {
    for (const bool recursive : {false, true}) {
      AndWorld w;
      w.put(a);
      auto& n = w.put(b);
      w.and_options.recursive = recursive;
      w.world.after(milliseconds(21 * skip), [&] { n.mute = 1; });
      const auto report = w.go();
      ASSERT_TRUE(report);
      EXPECT_EQ(report->end, End::complete);
      const auto all = found(*report);
      EXPECT_EQ(std::set(all.begin(), all.end()), (std::set{a, b})) << skip << recursive;
    }
  }
}

TEST(AndMaster, SwitchedOffDevicesAreLeftOut) {
  AndWorld w;
  for (const auto& address : {a, b, c}) w.put(address);
  ASSERT_TRUE(w.run(w.and_master.switch_global(I::unknown)));
  ASSERT_TRUE(w.run(w.and_master.switch_selective(AndAddress(b), I::identified)));
  const auto report = w.go();
  ASSERT_TRUE(report);
  EXPECT_EQ(found(*report), (std::vector{a, c}));
  EXPECT_FALSE(w.run(w.and_master.switch_global(I::selected)));
}

TEST(AndMaster, BusErrorAndLimit) {
  AndWorld alone;
  alone.and_options.discovery.send_timeout = milliseconds(50);
  const auto none = alone.go();
  ASSERT_FALSE(none);
  EXPECT_EQ(none.error().code, Errc::bus);
  AndWorld w;
  for (const auto& address : {a, b, c}) w.put(address);
  w.and_options.discovery.most_devices = 2;
  const auto report = w.go();
  ASSERT_TRUE(report);
  EXPECT_EQ(report->end, End::limit);
}

TEST(AndMasterProperty, RandomAddressesAndLatenciesAreAllFound) {
  for (std::uint64_t seed = 1; seed <= 100; ++seed) {
    Random random(seed);
    AndWorld w(125'000, seed);
    std::set<LssAddress> there;
    while (there.size() < 6) {
      there.insert({1, static_cast<std::uint32_t>(random.below(3)), 0,
                    random.chance(500'000) ? static_cast<std::uint32_t>(random.next())
                                           : static_cast<std::uint32_t>(random.below(40))});
    }
    for (const auto& address : there) {
      auto dice = std::make_shared<Random>(random.next());
      w.put(address, [dice] {
        return dice->chance(10'000) ? rt::Duration(milliseconds(8)) : rt::Duration(dice->between(200'000, 2'000'000));
      });
    }
    w.and_options.recursive = random.chance(500'000);
    w.and_options.discovery.t_resp = milliseconds(6);
    const auto report = w.go();
    ASSERT_TRUE(report);
    EXPECT_EQ(report->end, End::complete) << seed;
    const auto all = found(*report);
    EXPECT_EQ(std::set(all.begin(), all.end()), there) << seed;
  }
}

// ---- paper 1's comparison ------------------------------------------------------------------------------------------

double ms(rt::Duration d) { return static_cast<double>(d.count()) / 1e6; }

// S1.44: T_AND = 30 x (12 x 43.7 + 10.4) + 43.7 ms: an IURS and an IUS of 135 bits are 2.7 ms each at 50 kbit/s.
TEST(And, S1_44_Formula16Point088s) {
  EXPECT_NEAR(ms(paper1::t_and_network({})), 30 * (12 * (2.7 + 40 + 1) + (2.7 + 4 + 2.7 + 1)) + 43.7, 0.01);
  EXPECT_NEAR(ms(paper1::t_and_network({})), 16'088, 0.5);
}

// S1.45: "the time is shorter than AND": both on one bus, the same 30 devices, the paper's windows.
TEST(And, S1_45_RandIsFasterThanAndOnTheSameBus) {
  AndWorld w(50'000);
  for (unsigned i = 0; i < 30; ++i) {
    const LssAddress address{1, 2, 0x1'0000, 0x1000 + 37 * i};
    w.add(address, milliseconds(4));
    w.put(address, milliseconds(4));
  }
  w.options.window = DiscoveryOptions::Window::fixed;
  w.options.t_proc = milliseconds(1);
  w.options.direct = microseconds(5'600);  // T_resp and a DIS of 80 bits
  w.and_options.discovery = w.options;
  w.and_options.discovery.direct = microseconds(6'700);  // and one of 135
  w.and_options.inquire = false;
  const auto rand = w.discover();
  w.bus.reset_statistics();
  const auto and_report = w.go();
  ASSERT_TRUE(rand && and_report);
  ASSERT_EQ(rand->found.size(), 30U);
  ASSERT_EQ(and_report->found.size(), 30U);
  const auto t_rand = rand->ended - rand->began;
  const auto t_and = and_report->ended - and_report->began;
  EXPECT_EQ(and_report->requests, 30 * 13 + 1U);
  EXPECT_LT(t_rand, t_and);
  // True lengths: a request of 8 bytes in base format has 111 to 133 bits; all else is the formula's.
  const double fixed = 30 * (12 * 41.0 + 7.7) + 41.0;
  EXPECT_GE(ms(t_and), fixed + 391 * 108 * 0.02);
  EXPECT_LE(ms(t_and), fixed + 391 * 133 * 0.02);
  std::printf("RAND %.1f ms, AND %.1f ms simulated; %.1f and %.1f by formula\n", ms(t_rand), ms(t_and),
              ms(paper1::t_network_id(paper1::published, {})), ms(paper1::t_and_network({})));
}

TEST(AndMaster, AQueueThatIsFullIsWaitedFor) {
  AndWorld w;
  w.put(a);
  while (w.dispatcher.send(can::Frame::base(0x600, {})) == can::Queued::yes) {
  }
  const auto report = w.go();
  ASSERT_TRUE(report) << report.error().text;
  EXPECT_EQ(found(*report), std::vector{a});
}

}  // namespace
}  // namespace berth::research::test
