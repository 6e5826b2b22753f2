// What is left unfinished ends, and is never taken for done: a device that was to give its node-ID up and left, a lent
// node-ID whose return was not confirmed, a main job that is stopped in the middle.
#include <gtest/gtest.h>
#include <cstdint>
#include <string>
#include <vector>

#include "tests/harness/rig.hpp"

using namespace berth;
using namespace berth::harness;
using places::SlotState;
using Seats = std::vector<std::pair<unsigned, std::uint32_t>>;

namespace unfinished_tests {
namespace {

constexpr LssAddress stranger{type_c.vendor, type_c.product, 0, 9};

design::Machine one_slot() {
  design::Machine m = one_bus(125'000);
  add_slot(m, 5, type_b);
  return m;
}

// A stranger holds the slot's node-ID, and the slot's device comes later.
plant::PlantFile held_by_a_stranger() {
  auto p = one_bus_plant(1);
  auto& holder = add_device(p, "stranger", type_c, stranger.serial);
  holder.source = plant::NodeIdSource::nonvolatile;
  holder.node_id = NodeId(5);
  holder.speaks = {plant::Speaks::lss};
  holder.heartbeat = 100ms;
  add_device(p, "own", type_b, 1).plugged = false;
  return p;
}

// What the master sends by LSS: 11h with a node-ID, and selections of one product code.
struct LssEar final : can::Tap {
  void frame(const can::Frame& f, rt::Time, int) noexcept override {
    if (f.extended || f.id != 0x7E5) return;
    if (f.data[0] == 0x11 && f.data[1] == 0xFF) ++blanks;
    last_is_blank = f.data[0] == 0x11 && f.data[1] == 0xFF;
    const bool product = f.data[0] == 0x41 && f.data[1] == (type_c.product & 0xFFU);
    selections += product ? 1U : 0U;
  }
  unsigned blanks = 0;
  unsigned selections = 0;  // of the stranger's type
  bool last_is_blank = false;
};

class Ears {
 public:
  explicit Ears(Rig& rig) : bus_(*rig.world().bus("backbone")) { bus_.add_tap(ear); }
  ~Ears() { bus_.remove_tap(ear); }
  Ears(const Ears&) = delete;
  Ears& operator=(const Ears&) = delete;
  LssEar ear;

 private:
  sim::Bus& bus_;
};

const places::Oddity* unfinished(Rig& rig) {
  for (const auto& o : rig.network().planning().plan().oddities) {
    if (o.kind == places::OddityKind::unfinished) return &o;
  }
  return nullptr;
}

}  // namespace

// It leaves when it was told to give its node-ID up: that is named, costs next to nothing, and a person can end it.
TEST(Unfinished, ABlankOfADepartedDeviceIsNamedAndCanBeDropped) {
  Rig rig(one_slot(), held_by_a_stranger());
  Ears ears(rig);
  rig.begin();
  ASSERT_TRUE(rig.run_until([&] { return ears.ear.last_is_blank; }, 30s)) << rig.log();
  rig.device("stranger").unplug();
  rig.device("own").plug();
  ASSERT_TRUE(rig.until_operational(40s)) << rig.log();
  ASSERT_EQ(rig.store().unfinished_blanks().value(),
            (std::vector<places::UnfinishedBlank>{{stranger, "rig", "backbone", NodeId(5)}}));
  ASSERT_NE(unfinished(rig), nullptr) << rig.log();
  EXPECT_NE(unfinished(rig)->text.find("berth forget " + to_string(stranger)), std::string::npos);
  const unsigned asked = ears.ear.selections;
  rig.run_for(60s);
  const unsigned often = ears.ear.selections;
  EXPECT_LE(often, asked + 12) << "it may have been storing: three looks, of two questions twice";
  rig.run_for(60s);
  EXPECT_LE(ears.ear.selections, often) << "a machine that runs does not search for it for ever";
  EXPECT_EQ(rig.network().forget({1, 2, 3, 4}).error().code, Errc::not_found);
  ASSERT_TRUE(rig.network().forget(stranger));
  EXPECT_EQ(unfinished(rig), nullptr);
  EXPECT_TRUE(rig.store().unfinished_blanks().value().empty());
  // The next start has nothing to finish.
  const unsigned blanks = ears.ear.blanks;
  const unsigned selections = ears.ear.selections;
  rig.kill();
  rig.begin();
  ASSERT_TRUE(rig.until_operational(20s)) << rig.log();
  EXPECT_EQ(ears.ear.blanks, blanks);
  EXPECT_EQ(ears.ear.selections, selections);
}

TEST(Unfinished, ABlankIsFinishedWhenTheDeviceComesBack) {
  Rig rig(one_slot(), held_by_a_stranger());
  Ears ears(rig);
  rig.begin();
  ASSERT_TRUE(rig.run_until([&] { return ears.ear.last_is_blank; }, 30s)) << rig.log();
  rig.device("stranger").unplug();
  rig.device("own").plug();
  ASSERT_TRUE(rig.until_operational(40s)) << rig.log();
  rig.device("stranger").plug();
  rig.run_for(10s);
  EXPECT_FALSE(rig.device("stranger").truth().active.configured()) << rig.log();
  EXPECT_FALSE(rig.device("stranger").truth().persistent.configured()) << rig.log();
  EXPECT_TRUE(rig.store().unfinished_blanks().value().empty());
  EXPECT_EQ(unfinished(rig), nullptr) << rig.log();
  ASSERT_TRUE(rig.until_operational(20s)) << rig.log();
  EXPECT_EQ(rig.seats(), (Seats{{5, 1}}));
}

TEST(Unfinished, ABlankOfAnotherBusIsNotThisOnes) {
  Rig rig(one_slot(), held_by_a_stranger());
  rig.device("stranger").unplug();
  ASSERT_TRUE(rig.store().ask_blank({stranger, "rig", "other", NodeId(5)}, "elsewhere"));
  Ears ears(rig);
  rig.device("own").plug();
  rig.begin();
  ASSERT_TRUE(rig.until_operational(40s)) << rig.log();
  EXPECT_EQ(ears.ear.blanks, 0U);
  EXPECT_EQ(ears.ear.selections, 0U);
  EXPECT_EQ(unfinished(rig), nullptr);
  EXPECT_EQ(rig.store().unfinished_blanks().value().size(), 1U);
}

// The answer to the 11h that takes a lent node-ID back is lost: the device has it still, and is asked again.
TEST(Unfinished, ALentNodeIdIsTakenBackWhenThatIsConfirmed) {
  design::Machine m = one_slot();
  m.slots[0].spec.when_ambiguous = places::WhenAmbiguous::ask;
  auto p = one_bus_plant(1);
  for (const auto* name : {"a", "b"}) {
    add_device(p, name, type_b, name[0] == 'a' ? 1 : 2).speaks = {plant::Speaks::lss, plant::Speaks::fastscan};
  }
  Rig rig(m, p);
  Ears ears(rig);
  rig.begin();
  sim::Fault lost;
  lost.kind = sim::Fault::Kind::overrun;
  lost.trigger.when = [&](const sim::FrameStart& start) {
    return start.frame.id == 0x7E4 && start.frame.data[0] == 0x11 && ears.ear.last_is_blank;
  };
  lost.victims = {&rig.port()};
  rig.world().bus("backbone")->inject(std::move(lost));
  ASSERT_TRUE(rig.run_until([&] { return rig.state(5) == SlotState::question; }, 30s)) << rig.log();
  rig.run_for(6s);
  EXPECT_GE(ears.ear.blanks, 3U) << "two devices, and one of them twice";
  for (const auto& t : rig.world().truth()) {
    EXPECT_FALSE(t.active.configured()) << t.name << "\n" << rig.log();
    EXPECT_FALSE(t.persistent.configured()) << t.name;
  }
}

// A device with the master's node-ID comes late, and does not hear that it shall store that it has none: it is told
// again, though every slot has its device (seed 17883 of `berth_faults`).
TEST(Unfinished, ADeviceThatKeepsTheMastersNodeIdIsToldAgain) {
  design::Machine m = one_slot();
  auto p = one_bus_plant(1);
  add_device(p, "own", type_b, 1);
  auto& late = add_device(p, "late", type_b, 2);
  late.source = plant::NodeIdSource::nonvolatile;
  late.node_id = m.buses.front().master;
  late.plugged = false;
  Rig rig(m, p);
  rig.begin();
  ASSERT_TRUE(rig.until_operational(30s)) << rig.log();
  unsigned losses = 0;
  sim::Fault lost;
  lost.kind = sim::Fault::Kind::overrun;
  lost.trigger.when = [&](const sim::FrameStart& start) {
    const bool store = start.frame.id == 0x7E5 && start.frame.data[0] == 0x17;
    losses += store ? 1U : 0U;
    return store;
  };
  lost.trigger.times = 3;
  lost.victims = {&rig.device("late").controller()};
  rig.world().bus("backbone")->inject(std::move(lost));
  rig.device("late").plug();
  ASSERT_TRUE(rig.run_until([&] { return !rig.device("late").truth().persistent.configured(); }, 60s)) << rig.log();
  EXPECT_GE(losses, 3U);
  rig.run_for(5s);
  EXPECT_FALSE(rig.device("late").truth().active.configured()) << rig.log();
  EXPECT_EQ(rig.state(5), SlotState::operational);
}

// Stopped at any moment of a round, it begins again: the turn is free.
TEST(Unfinished, AMainJobThatWasStoppedInTheMiddleCanBeStartedAgain) {
  for (rt::Duration at = 0ms; at < 3s; at += 170ms) {
    Rig rig(five_slots(), five_slaves());
    rig.begin();
    rig.run_for(at);
    rig.network().stop();
    EXPECT_FALSE(rig.network().services().turn.taken()) << at.count();
    rig.run_for(100ms);
    rig.network().start();
    ASSERT_TRUE(rig.until_operational(60s)) << at.count() << "\n" << rig.log();
  }
}

// A stopped device speaks no SDO: it is one device, known by guarding or heartbeat and by LSS, and no duplicate.
TEST(Unfinished, AScanAfterNmtStopShowsEachDeviceOnce) {
  Rig rig(five_slots(), five_slaves());
  rig.begin();
  ASSERT_TRUE(rig.until_operational(60s)) << rig.log();
  rig.network().commanded(co::NmtCommand::stop, co::NmtTarget::all());
  rig.network().services().nmt.queue(co::NmtCommand::stop, co::NmtTarget::all());
  rig.run_for(3s);
  rt::Scope scope(rig.world().executor());
  std::vector<operate::Seen> seen;
  bool over = false;
  struct Scan {
    static rt::Task<void> run(operate::Network& network, std::vector<operate::Seen>& into, bool& done) {
      const auto found = co_await network.scan(operate::ScanRange::all);
      if (found) into = *found;
      done = true;
    }
  };
  scope.spawn(Scan::run(rig.network(), seen, over));
  ASSERT_TRUE(rig.run_until([&] { return over; }, 60s));
  EXPECT_EQ(seen.size(), 5U);
  for (const auto& s : seen) {
    EXPECT_FALSE(s.duplicate) << unsigned{s.id.value()};
    EXPECT_TRUE(s.device.has_value()) << unsigned{s.id.value()};
    EXPECT_TRUE(s.id.configured());
  }
}

}  // namespace unfinished_tests
