// Another master is told from devices; no frame passes the gate that may not. Expected values: CiA 301 §7.2.8 (NMT on
// 000h, [command, node]), §7.3.5 (predefined connection set), CiA 305 (7E5h), CiA 302-2 (071h: priority, node-ID).
#include "berth/live/gate.hpp"

#include <gtest/gtest.h>
#include <rapidcheck/gtest.h>
#include <chrono>
#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "berth/can/dispatcher.hpp"
#include "berth/live/reopening_port.hpp"
#include "berth/sim/world.hpp"

namespace berth::live {
namespace {

using namespace std::chrono_literals;
using can::Frame;

constexpr rt::Time t0{};

TEST(ForeignWatch, TellsMasterFramesFromDeviceFrames) {
  const std::pair<Frame, std::optional<Sign>> cases[] = {
      {Frame::base(0x000, {0x01, 0x00}), Sign::nmt},
      {Frame::base(0x000, {}), Sign::nmt},
      {Frame::base(0x080, {}), Sign::sync},
      {Frame::base(0x080, {7}), Sign::sync},
      {Frame::base(0x081, {0, 0, 0, 0, 0, 0, 0, 0}), std::nullopt},  // EMCY of node 1
      {Frame::base(0x071, {0, 1}), Sign::flying_master},
      {Frame::base(0x076, {}), Sign::flying_master},
      {Frame::base(0x070, {}), std::nullopt},
      {Frame::base(0x077, {}), std::nullopt},
      {Frame::base(0x7E5, {0x04, 0, 0, 0, 0, 0, 0, 0}), Sign::lss},
      {Frame::base(0x7E4, {0x4F, 0, 0, 0, 0, 0, 0, 0}), std::nullopt},
      {Frame::base(0x601, {0x40, 0, 0x10, 0, 0, 0, 0, 0}), Sign::sdo},
      {Frame::base(0x67F, {0x40, 0, 0x10, 0, 0, 0, 0, 0}), std::nullopt},  // a client of ours
      {Frame::base(0x600, {}), std::nullopt},
      {Frame::base(0x680, {}), std::nullopt},
      {Frame::base(0x581, {0x43, 0, 0x10, 0, 0, 0, 0, 0}), std::nullopt},
      {Frame::base(0x182, {1, 2}), std::nullopt},
      {Frame::base(0x702, {0x05}), std::nullopt},
      {Frame::base(0x77F, {0x7F}), Sign::heartbeat},  // own node-ID 127
      {Frame::base(0x77F, {0x00}), std::nullopt},     // a device that boots under it
      {Frame::base(0x77F, {}), std::nullopt},
      {Frame::request(0x705, 1), Sign::guarding},
      {Frame::request(0x182, 8), std::nullopt},
      {Frame::ext(0x1F94'0000, {0x80, 0, 0, 0}), Sign::discovery},
      {Frame::ext(0x1F50'0004, {}), std::nullopt},
      {Frame::base(0x7C2, {0x80, 0, 0, 0, 0, 0, 0, 0}), Sign::discovery},
      {Frame::ext(0x000, {0x01, 0x00}), std::nullopt},
      {Frame::ext(0x7E5, {0x04}), std::nullopt},
  };
  for (const auto& [frame, sign] : cases) {
    ForeignWatch watch({.own = NodeId(127)});
    EXPECT_EQ(watch.heard(frame, t0), sign) << can::to_string(frame);
    EXPECT_EQ(watch.foreign(), sign.has_value()) << can::to_string(frame);
  }
}

TEST(ForeignWatch, WhileRunningADeviceUnderOurNodeIdIsNoMaster) {
  ForeignWatch watch({.own = NodeId(127)});
  watch.running();
  EXPECT_FALSE(watch.heard(Frame::base(0x77F, {0x7F}), t0));
  EXPECT_FALSE(watch.heard(Frame::base(0x77F, {0x04}), t0));
  EXPECT_EQ(watch.heard(Frame::base(0x77F, {0x05}), t0), Sign::heartbeat);
}

TEST(ForeignWatch, CountsAndTimes) {
  ForeignWatch watch({.own = NodeId(127)});
  watch.heard(Frame::base(0x000, {0x01, 0x00}), t0 + 200ms);
  watch.heard(Frame::base(0x702, {0x05}), t0 + 300ms);
  watch.heard(Frame::base(0x000, {0x82, 0x05}), t0 + 1400ms);
  watch.heard(Frame::base(0x605, {0x40, 0, 0x10, 0, 0, 0, 0, 0}), t0 + 1500ms);
  const auto evidence = watch.evidence();
  ASSERT_EQ(evidence.size(), 2U);
  EXPECT_EQ(evidence[0].count, 2U);
  const auto text = lines(evidence, t0);
  EXPECT_EQ(text[0], "NMT commands: 2 times from 0.20 s to 1.40 s, first 000#0100");
  EXPECT_EQ(text[1], "SDO requests: 605#4000100000000000 at 1.50 s");
  watch.reset();
  EXPECT_FALSE(watch.foreign());
  EXPECT_TRUE(watch.evidence().empty());
}

TEST(ForeignWatch, SaysWhoTheMasterProbablyIs) {
  ForeignWatch watch({.own = NodeId(127)});
  EXPECT_FALSE(watch.probably().configured());
  // Node 1 beats as operational and is never asked; 5 is a slot of this machine; 6 is asked by SDO.
  for (const unsigned id : {1U, 5U, 6U}) watch.heard(Frame::base(0x700U + id, {0x05}), t0);
  watch.heard(Frame::base(0x606, {0x40, 0, 0x10, 0, 0, 0, 0, 0}), t0);
  const NodeId slots[] = {NodeId(5)};
  EXPECT_EQ(watch.probably(slots), NodeId(1));
  EXPECT_FALSE(watch.probably().configured()) << "5 might be it, too";
  EXPECT_EQ(verdict(watch, slots), "another master is on this bus, probably node 1");
  watch.heard(Frame::base(0x77F, {0x05}), t0);
  EXPECT_EQ(watch.probably(slots), NodeId(127));
  watch.heard(Frame::base(0x071, {0, 9}), t0);
  EXPECT_EQ(watch.probably(slots), NodeId(9));
  watch.heard(Frame::base(0x071, {0, 0xEE}), t0);
  EXPECT_EQ(watch.probably(slots), NodeId(127)) << "238 is no node-ID";
}

TEST(ForeignWatch, ToleratedSignsSayNothing) {
  WatchOptions options{.own = NodeId(127)};
  options.tolerated.set(static_cast<std::size_t>(Sign::sync));
  ForeignWatch watch(options);
  EXPECT_FALSE(watch.heard(Frame::base(0x080, {}), t0));
  EXPECT_FALSE(watch.foreign());
  EXPECT_TRUE(watch.heard(Frame::base(0x000, {1, 0}), t0));
}

TEST(ForeignWatch, EverySignHasAWord) {
  for (std::size_t i = 0; i < sign_count; ++i) {
    const auto sign = static_cast<Sign>(i);
    EXPECT_EQ(sign_named(name(sign)), sign);
  }
  EXPECT_FALSE(sign_named("pdo"));
}

TEST(Roles, FrameByFrame) {
  const Frame start = Frame::base(0x000, {0x01, 0x05});
  const Frame reset = Frame::base(0x000, {0x81, 0x00});
  const Frame reset_comm = Frame::base(0x000, {0x82, 0x05});
  const Frame broken = Frame::base(0x000, {0x01});
  const Frame stop = Frame::base(0x000, {0x02, 0x05});
  const Frame sync = Frame::base(0x080, {});
  const Frame lss = Frame::base(0x7E5, {0x04, 0, 0, 0, 0, 0, 0, 0});
  for (const auto& frame : {start, reset, reset_comm, broken, stop, sync, lss}) {
    EXPECT_TRUE(allowed(Role::master, frame));
    EXPECT_FALSE(allowed(Role::observer, frame));
  }
  for (const auto& frame : {start, reset, reset_comm, broken, sync}) {
    EXPECT_FALSE(allowed(Role::commissioner, frame)) << can::to_string(frame);
  }
  EXPECT_TRUE(allowed(Role::commissioner, stop));
  EXPECT_TRUE(allowed(Role::commissioner, lss));
  EXPECT_TRUE(allowed(Role::commissioner, Frame::ext(0x000, {0x01, 0x05}))) << "29 bit: no NMT";
}

TEST(Roles, AReaderUploadsBySdoAndNothingElse) {
  const auto sdo = [](int first) {
    return Frame::base(0x605, {static_cast<std::uint8_t>(first), 0, 0x10, 0, 0, 0, 0, 0});
  };
  EXPECT_TRUE(allowed(Role::reader, sdo(0x40)));
  EXPECT_TRUE(allowed(Role::reader, sdo(0x60)));
  EXPECT_TRUE(allowed(Role::reader, sdo(0x70)));
  for (const int first : {0x00, 0x20, 0x23, 0x2F, 0x80, 0xA0, 0xC2}) EXPECT_FALSE(allowed(Role::reader, sdo(first)));
  EXPECT_FALSE(allowed(Role::reader, Frame::base(0x605, {0x40})));
  EXPECT_FALSE(allowed(Role::reader, Frame::base(0x000, {0x02, 0x05})));
  EXPECT_FALSE(allowed(Role::reader, Frame::base(0x7E5, {0x40, 0, 0x10, 0, 0, 0, 0, 0})));
  EXPECT_FALSE(allowed(Role::reader, Frame::request(0x605, 8)));
}

TEST(Answers, WhoIsWaitedFor) {
  const auto lss = [](int specifier) {
    return Frame::base(0x7E5, {static_cast<std::uint8_t>(specifier), 0, 0, 0, 0, 0, 0, 0});
  };
  for (const int specifier : {0x04, 0x15, 0x40, 0x41, 0x42, 0x46, 0x47, 0x48, 0x49, 0x4A}) {
    EXPECT_FALSE(expects_answer(lss(specifier))) << specifier;
  }
  for (const int specifier : {0x11, 0x13, 0x17, 0x43, 0x4B, 0x4C, 0x51, 0x5A, 0x5E}) {
    EXPECT_TRUE(expects_answer(lss(specifier))) << specifier;
  }
  EXPECT_TRUE(expects_answer(Frame::base(0x605, {0x40, 0, 0x10, 0, 0, 0, 0, 0})));
  EXPECT_FALSE(expects_answer(Frame::base(0x605, {0x80, 0, 0x10, 0, 0, 0, 4, 5})));
  EXPECT_FALSE(expects_answer(Frame::base(0x000, {1, 0})));
  EXPECT_FALSE(expects_answer(Frame::base(0x77F, {5})));
  EXPECT_TRUE(expects_answer(Frame::request(0x705, 1)));
  EXPECT_TRUE(expects_answer(Frame::ext(0x1F94'0000, {0x80, 0, 0, 0})));
}

// ---- on a simulated bus ----

class Ear final : public can::Listener {
 public:
  void received(const Frame& frame, rt::Time) noexcept override { heard.push_back(can::to_string(frame)); }
  void sent(std::uint32_t tag, rt::Time) noexcept override { confirmed.push_back(tag); }
  void changed(const can::Status& status, rt::Time) noexcept override { statuses.push_back(status); }
  std::vector<std::string> heard;
  std::vector<std::uint32_t> confirmed;
  std::vector<can::Status> statuses;
};

class Log final : public can::Tap {
 public:
  void frame(const Frame& frame, rt::Time, int sender) noexcept override {
    if (sender == whose) sent.push_back(can::to_string(frame));
  }
  int whose = -1;
  std::vector<std::string> sent;
};

constexpr can::IdRange all{0, 0xFFFF'FFFF};

class GateOnABus : public ::testing::Test {
 protected:
  GateOnABus() {
    log.whose = inner->number();
    bus.add_tap(log);
  }
  ~GateOnABus() override { bus.remove_tap(log); }
  Gate& make(GateOptions options) {
    gate = std::make_unique<Gate>(world.executor(), *inner, std::move(options));
    gate->listen(&ear, std::span(&all, 1));
    return *gate;
  }
  static GateOptions as(Role role, rt::Duration listen = 2s) {
    GateOptions options;
    options.role = role;
    options.listen = listen;
    options.watch.own = NodeId(127);
    return options;
  }
  sim::World world{7};
  sim::Bus& bus = world.add_bus("line", 250'000);
  std::unique_ptr<sim::Controller> inner = bus.attach({});
  std::unique_ptr<sim::Controller> other = bus.attach({});
  Log log;
  Ear ear;
  std::unique_ptr<Gate> gate;
};

const Frame nmt_start = Frame::base(0x000, {0x01, 0x00});
const Frame beat = Frame::base(0x705, {0x05});

TEST_F(GateOnABus, ListensBeforeTheFirstFrame) {
  Gate& g = make(as(Role::master));
  EXPECT_EQ(g.state(), GateState::listening);
  EXPECT_TRUE(g.status().listen_only);
  EXPECT_EQ(g.send(nmt_start, 1), can::Queued::listen_only);
  other->send(beat, 0);
  world.run_for(1999ms);
  EXPECT_EQ(g.send(nmt_start, 2), can::Queued::listen_only);
  EXPECT_TRUE(log.sent.empty());
  EXPECT_EQ(ear.heard, std::vector<std::string>{"705#05"});
  world.run_for(1ms);
  EXPECT_EQ(g.state(), GateState::open);
  EXPECT_FALSE(g.status().listen_only);
  EXPECT_EQ(g.send(nmt_start, 9), can::Queued::yes);
  world.run_for(1ms);
  EXPECT_EQ(ear.confirmed, std::vector<std::uint32_t>{9});
  EXPECT_EQ(log.sent, std::vector<std::string>{"000#0100"});
}

TEST_F(GateOnABus, ErrorsThatThePortReportsAreTold) {
  struct Reporting final : can::Port {
    can::Queued send(const Frame&, std::uint32_t) noexcept override { return can::Queued::closed; }
    void withdraw(std::uint32_t) noexcept override {}
    void listen(can::Listener* to, std::span<const can::IdRange>) noexcept override { listener = to; }
    [[nodiscard]] can::Status status() const noexcept override { return {.up = true}; }
    bool restart(std::uint32_t) noexcept override { return false; }
    can::Listener* listener = nullptr;
  };
  auto outside = std::make_unique<Reporting>();
  Reporting& port = *outside;
  ReopeningPort again(
      world.executor(), std::move(outside), [] { return nullptr; }, 1s);
  Gate guarded(world.executor(), again, as(Role::master));
  std::vector<std::uint32_t> told;
  guarded.on_frame({}, [&](const Frame& report, rt::Time) { told.push_back(report.id); });
  Frame report;
  report.id = 0x88;
  port.listener->error(report, world.now());
  EXPECT_EQ(told, std::vector<std::uint32_t>{0x88});
}

TEST_F(GateOnABus, RefusesBesideAnotherMasterAndNamesIt) {
  Gate& g = make(as(Role::master));
  unsigned changes = 0;
  g.on_change([&] { ++changes; });
  world.run_for(100ms);
  other->send(Frame::base(0x7E5, {0x04, 0, 0, 0, 0, 0, 0, 0}), 0);
  other->send(Frame::base(0x701, {0x05}), 0);
  world.run_for(2s);
  EXPECT_EQ(g.state(), GateState::foreign);
  EXPECT_EQ(changes, 1U);
  EXPECT_EQ(g.send(beat, 1), can::Queued::listen_only);
  ASSERT_EQ(g.report().size(), 2U);
  EXPECT_EQ(g.report()[0], "another master is on this bus, probably node 1");
  EXPECT_EQ(g.report()[1], "LSS requests: 7E5#0400000000000000 at 0.10 s");
  world.run_for(1h);
  EXPECT_EQ(g.state(), GateState::foreign) << "it does not open by itself";
  g.listen_again();
  world.run_for(2s);
  EXPECT_EQ(g.state(), GateState::open);
  EXPECT_EQ(log.sent, std::vector<std::string>{});
}

// Ten frames are queued; the other master's frame wins arbitration after the first of them. What the controller sends
// at that moment may be the last.
TEST_F(GateOnABus, AMasterThatAppearsLaterStopsItWithinAFrame) {
  Gate& g = make(as(Role::master));
  world.run_for(3s);
  for (std::uint32_t tag = 1; tag <= 10; ++tag) ASSERT_EQ(g.send(beat, tag), can::Queued::yes);
  world.run_for(50us);
  other->send(nmt_start, 0);
  world.run_for(1s);
  EXPECT_EQ(g.state(), GateState::foreign);
  EXPECT_LE(log.sent.size(), 2U);
  EXPECT_GE(log.sent.size(), 1U);
  EXPECT_EQ(g.send(beat, 11), can::Queued::listen_only);
  ASSERT_FALSE(ear.statuses.empty());
  EXPECT_TRUE(ear.statuses.back().listen_only);
}

// A panel that reads by SDO: Berth goes on, and leaves it the channel of that node for a time.
TEST_F(GateOnABus, AnotherSdoClientIsNoMaster) {
  const Frame read = Frame::base(0x605, {0x40, 0, 0x10, 0, 0, 0, 0, 0});
  const Frame of_another = Frame::base(0x606, {0x40, 0, 0x10, 0, 0, 0, 0, 0});
  Gate& g = make(as(Role::master));
  std::vector<unsigned> told;
  g.clients().on_first([&](NodeId node, const Frame& request) {
    EXPECT_EQ(request, read);
    told.push_back(node.value());
  });
  world.run_for(3s);
  for (int i = 0; i < 3; ++i) {
    other->send(read, 0);
    world.run_for(100ms);
  }
  EXPECT_EQ(g.state(), GateState::open);
  EXPECT_TRUE(g.report().empty());
  EXPECT_EQ(told, std::vector<unsigned>{5}) << "once";
  EXPECT_EQ(g.send(read, 1), can::Queued::full) << "its answer would be taken for the client's";
  EXPECT_EQ(g.send(of_another, 2), can::Queued::yes);
  EXPECT_EQ(g.send(nmt_start, 3), can::Queued::yes);
  world.run_for(OtherClients::pause - 105ms);
  EXPECT_EQ(g.send(read, 4), can::Queued::full) << "not yet";
  world.run_for(10ms);
  EXPECT_EQ(g.send(read, 5), can::Queued::yes) << "it is silent, and Berth goes on by itself";
  world.run_for(10ms);
  other->send(nmt_start, 0);
  world.run_for(1ms);
  EXPECT_EQ(g.state(), GateState::foreign) << "that is a master";
  EXPECT_EQ(g.report().size(), 3U) << "the requests are evidence with it";
}

// 67Fh: whoever reads the manager's own objects, while it listens and behind that.
TEST_F(GateOnABus, AClientOfBerthsOwnNodeIdIsNothing) {
  const Frame read = Frame::base(0x67F, {0x40, 0x22, 0x1F, 1, 0, 0, 0, 0});
  Gate& g = make(as(Role::master));
  g.clients().on_first([](NodeId, const Frame&) { ADD_FAILURE(); });
  other->send(read, 0);
  world.run_for(3s);
  EXPECT_EQ(g.state(), GateState::open);
  other->send(read, 0);
  world.run_for(1s);
  EXPECT_EQ(g.state(), GateState::open);
  EXPECT_EQ(ear.heard.size(), 2U) << "it gets there";
}

TEST_F(GateOnABus, ACommissionerWorksBesideAMaster) {
  Gate& g = make(as(Role::commissioner));
  other->send(nmt_start, 0);
  world.run_for(2s);
  EXPECT_EQ(g.state(), GateState::open);
  EXPECT_EQ(g.send(nmt_start, 1), can::Queued::listen_only);
  EXPECT_EQ(g.send(Frame::base(0x080, {}), 2), can::Queued::listen_only);
  EXPECT_EQ(g.refused(), 2U);
  EXPECT_EQ(g.send(Frame::base(0x605, {0x40, 0, 0x10, 0, 0, 0, 0, 0}), 3), can::Queued::yes);
  other->send(Frame::base(0x080, {}), 0);
  world.run_for(1s);
  EXPECT_EQ(g.state(), GateState::open);
  EXPECT_EQ(log.sent, std::vector<std::string>{"605#4000100000000000"});
}

TEST_F(GateOnABus, AnObserverNeverSends) {
  Gate& g = make(as(Role::observer, 0s));
  world.run_for(5s);
  EXPECT_EQ(g.state(), GateState::observing);
  EXPECT_TRUE(g.decided());
  EXPECT_EQ(g.send(beat, 1), can::Queued::listen_only);
  other->send(beat, 0);
  world.run_for(1s);
  EXPECT_EQ(ear.heard.size(), 1U);
  EXPECT_TRUE(log.sent.empty());
}

TEST_F(GateOnABus, ADryRunSendsNothingAndStopsAtTheFirstQuestion) {
  auto options = as(Role::master);
  options.dry_run = true;
  Gate& g = make(options);
  std::vector<std::string> held;
  g.on_held([&](const Frame& frame, rt::Time) { held.push_back(can::to_string(frame)); });
  world.run_for(2s);
  EXPECT_EQ(g.send(nmt_start, 1), can::Queued::yes);
  EXPECT_EQ(g.send(Frame::base(0x605, {0x40, 0, 0x10, 0, 0, 0, 0, 0}), 2), can::Queued::yes);
  EXPECT_TRUE(ear.confirmed.empty()) << "never from inside send";
  world.run_for(10s);
  EXPECT_EQ(ear.confirmed, std::vector<std::uint32_t>{1});
  EXPECT_EQ(held, (std::vector<std::string>{"000#0100", "605#4000100000000000"}));
  EXPECT_TRUE(log.sent.empty());
}

TEST_F(GateOnABus, WithdrawnFramesDoNotGoOut) {
  Gate& g = make(as(Role::master, 0s));
  EXPECT_EQ(g.state(), GateState::open);
  for (std::uint32_t tag = 1; tag <= 3; ++tag) ASSERT_EQ(g.send(beat, tag), can::Queued::yes);
  g.withdraw(3);
  g.withdraw(77);
  g.withdraw(0);
  world.run_for(1s);
  EXPECT_EQ(ear.confirmed, (std::vector<std::uint32_t>{1, 2}));
  EXPECT_EQ(log.sent.size(), 2U);
}

TEST_F(GateOnABus, OnlyWhatTheListenerAskedForGetsThroughAndTheWatchHearsAll) {
  Gate& g = make(as(Role::master));
  const can::IdRange narrow{0x700, 0x77F};
  g.listen(&ear, std::span(&narrow, 1));
  other->send(Frame::base(0x182, {1}), 0);
  other->send(beat, 0);
  other->send(Frame::base(0x7E5, {0x04}), 0);
  world.run_for(2s);
  EXPECT_EQ(ear.heard, std::vector<std::string>{"705#05"});
  EXPECT_EQ(g.state(), GateState::foreign);
}

// A port that goes down and comes back may hang on another machine now.
class Cable final : public can::Port {
 public:
  can::Queued send(const Frame&, std::uint32_t) noexcept override { return can::Queued::yes; }
  void withdraw(std::uint32_t tag) noexcept override { withdrawn.push_back(tag); }
  void listen(can::Listener* listener, std::span<const can::IdRange>) noexcept override { ear = listener; }
  [[nodiscard]] can::Status status() const noexcept override { return now; }
  bool restart(std::uint32_t) noexcept override { return true; }
  void plug(bool in) {
    now.up = in;
    ear->changed(now, rt::Time{});
  }
  can::Status now{};
  can::Listener* ear = nullptr;
  std::vector<std::uint32_t> withdrawn;
};

TEST(Gate, ListensAnewWhenThePortComesBack) {
  rt::Executor executor;
  Cable cable;
  GateOptions options;
  options.listen = 1s;
  Gate gate(executor, cable, options);
  Ear ear;
  gate.listen(&ear, std::span(&all, 1));
  EXPECT_EQ(gate.state(), GateState::down);
  EXPECT_EQ(gate.send(beat, 1), can::Queued::closed);
  executor.advance(executor.now() + 10s);
  EXPECT_EQ(gate.state(), GateState::down);
  cable.plug(true);
  EXPECT_EQ(gate.state(), GateState::listening);
  executor.advance(executor.now() + 1s);
  EXPECT_EQ(gate.state(), GateState::open);
  cable.plug(false);
  EXPECT_EQ(gate.state(), GateState::down);
  EXPECT_EQ(gate.send(beat, 1), can::Queued::closed);
  cable.plug(true);
  EXPECT_EQ(gate.send(beat, 1), can::Queued::listen_only);
  cable.ear->received(nmt_start, executor.now());
  executor.advance(executor.now() + 1s);
  EXPECT_EQ(gate.state(), GateState::foreign);
}

TEST(Gate, AFrameThatIsNeverConfirmedFillsNothingForEver) {
  rt::Executor executor;
  Cable cable;
  cable.now.up = true;
  GateOptions options;
  options.listen = 0s;
  Gate gate(executor, cable, options);
  for (std::uint32_t tag = 1; tag <= Gate::most_pending; ++tag) ASSERT_EQ(gate.send(beat, tag), can::Queued::yes);
  EXPECT_EQ(gate.send(beat, 9999), can::Queued::full);
  gate.withdraw(5);
  EXPECT_EQ(gate.send(beat, 9999), can::Queued::yes);
  EXPECT_TRUE(gate.restart(125'000));
  EXPECT_EQ(gate.send(beat, 10'000), can::Queued::yes);
}

// A second dispatcher would leave the first deaf: whoever writes that learns it at once.
TEST(GateDeathTest, HasOneListener) {
  GTEST_FLAG_SET(death_test_style, "threadsafe");
  rt::Executor executor;
  Cable cable;
  Gate gate(executor, cable, {});
  can::Dispatcher first(executor, gate);
  EXPECT_DEATH(can::Dispatcher(executor, gate), "listener");
}

TEST(ReopeningPort, AsksForAnotherOneUntilThereIsOne) {
  rt::Executor executor;
  auto first = std::make_unique<Cable>();
  first->now.up = true;
  Cable* const one = first.get();
  Cable* two = nullptr;
  unsigned asked = 0;
  const auto open = [&]() -> std::unique_ptr<can::Port> {
    if (++asked < 3) return nullptr;
    auto next = std::make_unique<Cable>();
    next->now.up = true;
    next->now.errors = 3;
    two = next.get();
    return next;
  };
  ReopeningPort port(executor, std::move(first), open, 1s);
  Ear ear;
  port.listen(&ear, std::span(&all, 1));
  EXPECT_EQ(port.send(beat, 1), can::Queued::yes);
  one->plug(false);
  ASSERT_EQ(ear.statuses.size(), 1U);
  EXPECT_FALSE(port.status().up);
  one->now.errors = 4;
  one->now.lost = 2;
  executor.advance(executor.now() + 2500ms);
  EXPECT_EQ(asked, 2U);
  EXPECT_EQ(port.send(beat, 1), can::Queued::closed);
  executor.advance(executor.now() + 1s);
  ASSERT_NE(two, nullptr);
  ASSERT_EQ(ear.statuses.size(), 2U);
  EXPECT_TRUE(ear.statuses.back().up);
  two->ear->received(beat, executor.now());
  EXPECT_EQ(ear.heard.size(), 1U);
  EXPECT_EQ(port.status().errors, 7U) << "errors and losses count on";
  EXPECT_EQ(ear.statuses.back().lost, 2U);
  two->plug(false);
  two->plug(true);
  executor.advance(executor.now() + 10s);
  EXPECT_EQ(asked, 3U) << "it came back by itself";
}

// Whatever anybody sends: an observer's and a commissioner's frames stay within their roles, and a master that heard a
// sign sends nothing more.
RC_GTEST_PROP(Gate, RolesHoldForAnyFrames, ()) {
  const auto role = static_cast<Role>(*rc::gen::inRange(0, 4));
  rt::Executor executor;
  class Wire final : public can::Port {
   public:
    can::Queued send(const Frame& frame, std::uint32_t) noexcept override {
      out.push_back(frame);
      return can::Queued::yes;
    }
    void withdraw(std::uint32_t) noexcept override {}
    void listen(can::Listener* listener, std::span<const can::IdRange>) noexcept override { ear = listener; }
    [[nodiscard]] can::Status status() const noexcept override {
      can::Status s;
      s.up = true;
      return s;
    }
    bool restart(std::uint32_t) noexcept override { return true; }
    std::vector<Frame> out;
    can::Listener* ear = nullptr;
  } wire;
  GateOptions options;
  options.role = role;
  options.listen = 1s;
  options.watch.own = NodeId(127);
  Gate gate(executor, wire, options);
  bool shut = false;
  for (int step = 0; step < 60; ++step) {
    const bool near = *rc::gen::arbitrary<bool>();
    const auto id = *rc::gen::element<std::uint32_t>(0x000, 0x071, 0x080, 0x182, 0x605, 0x77F, 0x7E5, 0x705);
    const auto first = *rc::gen::element<std::uint8_t>(0x00, 0x01, 0x02, 0x05, 0x7F, 0x80, 0x81, 0x82);
    Frame frame = Frame::base(id, {first, 5});
    if (*rc::gen::inRange(0, 5) == 0) frame = Frame::base(id, {});
    const auto before = wire.out.size();
    if (near) {
      const auto queued = gate.send(frame, 1);
      if (queued == can::Queued::yes) gate.withdraw(1);
      if (wire.out.size() > before) {
        RC_ASSERT(executor.now() >= rt::Time{} + 1s);
        RC_ASSERT(!shut);
        RC_ASSERT(role != Role::observer && role != Role::reader);  // no such frame is long enough for an upload
        const bool command = id == 0x000 && !(frame.size == 2 && (first == 0x02 || first == 0x80));
        RC_ASSERT(role == Role::master || (!command && id != 0x080));
      }
    } else {
      const bool tells = gate.watch().sign_of(frame).has_value();
      wire.ear->received(frame, executor.now());
      shut = shut || (tells && role == Role::master);
    }
    executor.advance(executor.now() + std::chrono::milliseconds(*rc::gen::inRange(0, 100)));
  }
}

}  // namespace
}  // namespace berth::live
