// The main job and each operation of a network, destroyed after any frame: nothing is left behind (the address
// sanitizer looks on), the bus goes on, and whoever begins afterwards comes to the same end.
#include <gtest/gtest.h>
#include <algorithm>
#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "berth/live/census.hpp"
#include "berth/live/gate.hpp"
#include "berth/rt/scope.hpp"
#include "berth/tree/session.hpp"
#include "tests/harness/rig.hpp"

using namespace berth;
using namespace berth::harness;
using Seats = std::vector<std::pair<unsigned, std::uint32_t>>;

namespace {

class Counter final : can::Tap {
 public:
  explicit Counter(Rig& rig) : bus_(rig.world().bus("backbone")) { bus_->add_tap(*this); }
  ~Counter() { bus_->remove_tap(*this); }
  std::size_t frames = 0;

 private:
  void frame(const can::Frame&, rt::Time, int) noexcept override { ++frames; }
  sim::Bus* bus_;
};

design::Machine two_slots() {
  design::Machine m = one_bus(125'000);
  add_slot(m, 1, type_a);
  add_slot(m, 2, type_b);
  return m;
}

// Beside them a pump, whose configuration there is much to compare of.
design::Machine with_a_pump() {
  design::Machine m = two_slots();
  add_slot(m, 5, type_pump);
  m.slots.back().spec.config = example_eds("pump.dcf");
  return m;
}

// d3 is on the shelf.
plant::PlantFile three_slaves() {
  plant::PlantFile p = one_bus_plant(1);
  add_device(p, "d1", type_a, 0x0A);
  add_device(p, "d2", type_b, 5);
  add_device(p, "d3", type_b, 6).plugged = false;
  return p;
}

// Every frame of the beginning, then every seventh.
std::size_t next(std::size_t frames) { return frames + (frames < 60 ? 1 : 7); }

/// Berth dies, and a new one on the same store and bus comes to the same end.
void expect_the_same_end(Rig& rig, const Seats& seats) {
  rig.kill();
  rig.run_for(1s);
  rig.begin();
  ASSERT_TRUE(rig.until_operational(60s)) << rig.log();
  ASSERT_EQ(rig.seats(), seats) << rig.log();
}

using Run = rt::Task<void> (*)(operate::Network&, bool& done);

rt::Task<void> scan(operate::Network& network, bool& done) {
  const auto end = co_await network.scan(operate::ScanRange::all);
  static_cast<void>(end);
  done = true;
}
rt::Task<void> bind(operate::Network& network, bool& done) {
  const auto end = co_await network.bind_once();
  static_cast<void>(end);
  done = true;
}
rt::Task<void> bind_from_scratch(operate::Network& network, bool& done) {
  const auto end = co_await network.bind_from_scratch(true);
  static_cast<void>(end);
  done = true;
}
rt::Task<void> configure(operate::Network& network, bool& done) {
  const auto end = co_await network.configure("", true);
  static_cast<void>(end);
  done = true;
}
rt::Task<void> locate(operate::Network& network, bool& done) {
  const LssAddress device{type_a.vendor, type_a.product, 0, 0x0A};
  const auto end = co_await network.locate(device, 1s, true);
  static_cast<void>(end);
  done = true;
}
rt::Task<void> ask(live::Census& census, bool everybody, bool& done) {
  live::CensusOptions options;
  options.everybody = everybody;
  const auto end = co_await census.ask(options);
  static_cast<void>(end);
  done = true;
}

struct Operation {
  const char* name;
  Run run;
};
void PrintTo(const Operation& operation, std::ostream* out) { *out << operation.name; }

}  // namespace

TEST(Destroyed, TheMainJobAfterEachFrame) {
  bool whole = false;
  for (std::size_t frames = 0; !whole; frames = next(frames)) {
    SCOPED_TRACE(frames);
    Rig rig(two_slots(), three_slaves());
    Counter bus(rig);
    rig.begin();
    ASSERT_TRUE(rig.run_until([&] { return bus.frames > frames || (rig.operational() && rig.idle()); }, 60s));
    whole = rig.operational() && rig.idle();
    ASSERT_NO_FATAL_FAILURE(expect_the_same_end(rig, {{1, 0x0A}, {2, 5}}));
  }
}

TEST(Destroyed, AReplacementAfterEachFrame) {
  bool whole = false;
  for (std::size_t frames = 0; !whole; frames = next(frames)) {
    SCOPED_TRACE(frames);
    Rig rig(two_slots(), three_slaves());
    rig.begin();
    ASSERT_TRUE(rig.until_operational(60s));
    rig.device("d2").unplug();
    ASSERT_TRUE(rig.run_until([&] { return rig.state(2) == places::SlotState::absent; }, 20s)) << rig.log();
    rig.device("d3").plug();
    Counter bus(rig);
    ASSERT_TRUE(rig.network().replace("s2", std::nullopt));
    ASSERT_TRUE(rig.run_until([&] { return bus.frames > frames || (rig.operational() && rig.idle()); }, 60s));
    whole = rig.operational() && rig.idle();
    ASSERT_NO_FATAL_FAILURE(expect_the_same_end(rig, {{1, 0x0A}, {2, 6}}));
  }
}

class DestroyedOperation : public ::testing::TestWithParam<Operation> {};
INSTANTIATE_TEST_SUITE_P(Each, DestroyedOperation,
                         ::testing::Values(Operation{"scan", scan}, Operation{"bind", bind},
                                           Operation{"bind_from_scratch", bind_from_scratch},
                                           Operation{"configure", configure}, Operation{"locate", locate}),
                         [](const auto& each) { return std::string(each.param.name); });

// The network stays: it has its turn back, does another operation, and all devices run in the end.
TEST_P(DestroyedOperation, AfterEachFrame) {
  bool whole = false;
  std::size_t frames = 0;
  for (; !whole; frames = next(frames)) {
    SCOPED_TRACE(frames);
    auto plant = three_slaves();
    add_device(plant, "pump", type_pump, 9);
    Rig rig(with_a_pump(), plant);
    rig.begin();
    ASSERT_TRUE(rig.until_operational(60s));
    Counter bus(rig);
    std::optional<rt::Scope> scope(rig.world().executor());
    scope->spawn(GetParam().run(rig.network(), whole));
    ASSERT_TRUE(rig.run_until([&] { return bus.frames > frames || whole; }, 60s)) << rig.log();
    scope.reset();
    bool scanned = false;
    rt::Scope again(rig.world().executor());
    again.spawn(scan(rig.network(), scanned));
    ASSERT_TRUE(rig.run_until([&] { return scanned; }, 120s)) << "it kept the turn\n" << rig.log();
    ASSERT_NO_FATAL_FAILURE(expect_the_same_end(rig, {{1, 0x0A}, {2, 5}, {5, 9}}));
  }
  EXPECT_GT(frames, 20U) << "it was hardly destroyed anywhere";
}

// What `berth adopt --all` asks.
TEST(Destroyed, ACensusAfterEachFrame) {
  bool whole = false;
  for (std::size_t frames = 0; !whole; frames = next(frames)) {
    SCOPED_TRACE(frames);
    Rig rig(two_slots(), three_slaves());
    rig.begin();
    ASSERT_TRUE(rig.until_operational(60s));
    const auto port = rig.world().attach_master("backbone");
    can::Dispatcher dispatcher(rig.world().executor(), *port);
    live::Census census(dispatcher);
    Counter bus(rig);
    std::optional<rt::Scope> scope(rig.world().executor());
    scope->spawn(ask(census, true, whole));
    ASSERT_TRUE(rig.run_until([&] { return bus.frames > frames || whole; }, 120s));
    scope.reset();
    bool asked = false;
    rt::Scope again(rig.world().executor());
    again.spawn(ask(census, true, asked));
    ASSERT_TRUE(rig.run_until([&] { return asked; }, 120s));
    ASSERT_GE(census.nodes().size(), 2U);
  }
}

namespace {

/// What `berth adopt` has of a bus: a reader's gate, a session that does not begin, and a census on its dispatcher.
class Adoption {
 public:
  explicit Adoption(plant::World& world) : machine_(one_bus(125'000)) {
    machine_.buses.front().role = design::Role::commissioner;
    port_ = world.attach_master("backbone");
    live::GateOptions reader;
    reader.role = live::Role::reader;
    gate_ = std::make_unique<live::Gate>(world.executor(), *port_, reader);
    session_ = std::make_unique<tree::Session>(world.executor(), machine_, store_);
    if (!session_->connect("backbone", *gate_) || !session_->open()) std::abort();
    census_.emplace(session_->network("backbone")->services().dispatcher);
    scope_.emplace(world.executor());
  }
  void begin(bool& done) { scope_->spawn(ask(*census_, false, done)); }
  /// What the command does at a signal: the questions end, and what was learnt so far is looked at.
  [[nodiscard]] std::vector<live::NodeSeen> end() {
    scope_.reset();
    return census_->nodes();
  }

 private:
  design::Machine machine_;
  places::MemoryStore store_;
  std::unique_ptr<sim::Controller> port_;
  std::unique_ptr<live::Gate> gate_;
  std::unique_ptr<tree::Session> session_;
  std::optional<live::Census> census_;
  std::optional<rt::Scope> scope_;
};

/// The serial numbers that were learnt, each with its node-ID.
Seats learnt(const std::vector<live::NodeSeen>& nodes) {
  Seats seats;
  for (const auto& node : nodes) {
    if (node.identity) seats.emplace_back(node.id.value(), node.identity->address.serial);
  }
  return seats;
}

}  // namespace

// `berth adopt` of a machine that its master runs, from its first moment of listening on. What was learnt by then is
// true, the machine runs on (its master may see that another asked, and nothing else), and the next one learns all.
TEST(Destroyed, AnAdoptionAfterEachFrame) {
  const Seats devices{{1, 0x0A}, {2, 5}};
  const std::pair<unsigned, std::uint32_t> master{127, 0};
  constexpr rt::Duration listening = 3s;  // longer than the gate's, and than two heartbeats
  bool whole = false;
  std::size_t frames = 0;
  for (; !whole; frames = next(frames)) {
    SCOPED_TRACE(frames);
    Rig rig(two_slots(), three_slaves());
    rig.begin();
    ASSERT_TRUE(rig.until_operational(60s));
    const auto events = static_cast<std::ptrdiff_t>(rig.events().size());
    Counter bus(rig);
    {
      Adoption adoption(rig.world());
      const bool while_listening = rig.run_until([&] { return bus.frames > frames; }, listening);
      if (!while_listening) {
        adoption.begin(whole);
        ASSERT_TRUE(rig.run_until([&] { return bus.frames > frames || whole; }, 120s));
      }
      for (const auto& seat : learnt(adoption.end())) {
        EXPECT_TRUE(seat == master || std::ranges::find(devices, seat) != devices.end()) << seat.first;
      }
    }
    ASSERT_TRUE(rig.operational()) << rig.log();
    ASSERT_TRUE(rig.until_operational(60s)) << rig.log();
    for (auto told = rig.events().begin() + events; told != rig.events().end(); ++told) {
      ASSERT_NE(told->text.find("another SDO client is on the bus"), std::string::npos) << rig.log();
    }
    rig.kill();  // a master that asks at the same time is left its nodes
    bool asked = false;
    Adoption again(rig.world());
    rig.run_for(listening);
    again.begin(asked);
    ASSERT_TRUE(rig.run_until([&] { return asked; }, 120s));
    ASSERT_EQ(learnt(again.end()), devices);
  }
  EXPECT_GT(frames, 60U) << "it was hardly destroyed anywhere";
}
