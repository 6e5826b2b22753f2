// The promise: a node-ID that may be in a device's memory belongs to that device until it was seen to have lost it, or
// a person gives it away. S1.29, S1.53.
#include <gtest/gtest.h>
#include <cstdint>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "tests/harness/rig.hpp"

using namespace berth;
using namespace berth::harness;
using places::SlotState;
using Seats = std::vector<std::pair<unsigned, std::uint32_t>>;

namespace {

// Takes the device's power at the instant at which this LSS frame is on the wire. Its answer to store (17h): its memory
// has the node-ID, and `04 00` never reaches it.
class CutAfter final : public can::Tap {
 public:
  CutAfter(Rig& rig, std::string device, std::uint32_t id = 0x7E4, std::uint8_t command = 0x17)
      : rig_(&rig), device_(std::move(device)), id_(id), command_(command) {
    rig.device(device_).bus().add_tap(*this);
  }
  ~CutAfter() { rig_->device(device_).bus().remove_tap(*this); }
  CutAfter(const CutAfter&) = delete;
  CutAfter& operator=(const CutAfter&) = delete;
  [[nodiscard]] bool done() const noexcept { return done_; }

 private:
  void frame(const can::Frame& frame, rt::Time, int) noexcept override {
    const bool fits =
        !frame.extended && frame.id == id_ && frame.data[0] == command_ && (id_ != 0x7E4 || frame.data[1] == 0);
    if (!fits || done_) return;
    done_ = true;
    rig_->world().sim().after(1us, [this] { rig_->device(device_).unplug(); });
  }
  Rig* rig_;
  std::string device_;
  std::uint32_t id_;
  std::uint8_t command_;
  bool done_ = false;
};

struct OneSlot {
  OneSlot() : rig(machine(), plant()) {}
  static design::Machine machine() {
    design::Machine m = one_bus(125'000);
    add_slot(m, 2, type_b);
    return m;
  }
  static plant::PlantFile plant() {
    auto p = one_bus_plant(1);
    add_device(p, "x", type_b, 1);
    add_device(p, "y", type_b, 2).plugged = false;
    return p;
  }
  // X has the node-ID in its memory, and is away; its slot waits for it.
  void cut_x() {
    const CutAfter cut(rig, "x");
    rig.begin();
    EXPECT_TRUE(rig.run_until([&] { return cut.done() && !rig.device("x").plugged(); }, 20s)) << rig.log();
    EXPECT_EQ(rig.device("x").truth().persistent, NodeId(2));
  }
  // False: two devices held one node-ID meanwhile, or Y was given X's.
  bool quiet_for(rt::Duration time) {
    for (rt::Duration t{0}; t < time; t += 5ms) {
      rig.run_for(5ms);
      const auto y = rig.device("y").truth();
      if (!rig.world().duplicates().empty() || y.active == NodeId(2) || y.persistent == NodeId(2)) return false;
    }
    return true;
  }
  [[nodiscard]] std::string reason() const {
    const auto slots = const_cast<Rig&>(rig).network().report();
    return slots.front().reason;
  }
  Rig rig;
};

// Calls back at each frame with 11-bit identifier, whose first bytes are these.
class At final : public can::Tap {
 public:
  using Act = std::function<void()>;
  At(Rig& rig, std::uint32_t id, std::vector<std::uint8_t> bytes, Act act)
      : rig_(&rig), id_(id), bytes_(std::move(bytes)), act_(std::move(act)) {
    rig.world().bus("backbone")->add_tap(*this);
  }
  ~At() { rig_->world().bus("backbone")->remove_tap(*this); }
  At(const At&) = delete;
  At& operator=(const At&) = delete;

 private:
  void frame(const can::Frame& frame, rt::Time, int) noexcept override {
    const bool fits =
        !frame.extended && frame.id == id_ && std::equal(bytes_.begin(), bytes_.end(), frame.data.begin());
    if (fits) rig_->world().sim().after(1us, act_);
  }
  Rig* rig_;
  std::uint32_t id_;
  std::vector<std::uint8_t> bytes_;
  Act act_;
};

}  // namespace

// An earlier run asked X to store, and ended before it heard an answer. X is found again and leaves as it is selected:
// what it has in memory is as open as before, so its slot is not free for Y.
TEST(Promise, S1_53_AFruitlessRetryDoesNotFreeTheSlot) {
  OneSlot o;
  o.rig.begin();
  ASSERT_TRUE(o.rig.run_until([&] { return o.rig.device("x").truth().pending == NodeId(2); }, 20s)) << o.rig.log();
  o.rig.kill();
  o.rig.run_for(100ms);
  const CutAfter cut(o.rig, "x", 0x7E5, 0x40);
  o.rig.begin();
  ASSERT_TRUE(o.rig.run_until([&] { return cut.done() && !o.rig.device("x").plugged(); }, 20s)) << o.rig.log();
  o.rig.run_for(5s);
  o.rig.device("y").plug();
  EXPECT_TRUE(o.quiet_for(40s)) << o.rig.log();
  EXPECT_EQ(o.rig.state(2), SlotState::absent) << o.rig.log();
}

// Without a serial number: it takes 11h, is deaf to 17h and to all that takes the node-ID back, and uses it from `04
// 00` on. Its memory has none, so that it is not confirmed there before it has stored it.
TEST(Promise, S1_53_OneThatMissedTheStoreIsNotConfirmedWhereItSits) {
  auto p = one_bus_plant(1);
  add_device(p, "x", type_b, 0);
  Rig rig(OneSlot::machine(), p);
  bool missed = false;
  rig.on_step([&](const std::string&, const places::Binding& binding) {
    if (binding.step() == places::Step::store && !std::exchange(missed, true)) rig.device("x").controller().deaf(true);
    if (binding.step() == places::Step::release) rig.device("x").controller().deaf(false);
  });
  rig.begin();
  bool used = false;
  for (rt::Duration t{0}; t < 60s && !rig.operational(); t += 5ms) {
    rig.run_for(5ms);
    const auto x = rig.device("x").truth();
    used = used || (x.active == NodeId(2) && x.persistent != NodeId(2));
    ASSERT_TRUE(rig.seats().empty() || x.persistent == NodeId(2)) << rig.log();
  }
  EXPECT_TRUE(missed && used) << "this case is not the one that is meant";
  EXPECT_TRUE(rig.operational()) << rig.log();
}

// A run ended between 11h and 17h: its device is in LSS configuration with a node-ID pending. The next run takes that
// back before its first `04 00`, which would bring it into use with nobody knowing.
TEST(Promise, S1_53_TheOpeningTakesBackWhatIsPending) {
  OneSlot o;
  const auto pending = [&] { return o.rig.device("x").truth().pending; };
  o.rig.begin();
  ASSERT_TRUE(o.rig.run_until([&] { return pending() == NodeId(2); }, 20s)) << o.rig.log();
  o.rig.kill();
  o.rig.run_for(100ms);
  ASSERT_EQ(pending(), NodeId(2));
  ASSERT_FALSE(o.rig.device("x").truth().active.configured());
  o.rig.begin();
  ASSERT_TRUE(
      o.rig.run_until([&] { return pending() != NodeId(2) || o.rig.device("x").truth().active == NodeId(2); }, 20s));
  EXPECT_FALSE(o.rig.device("x").truth().active.configured()) << "taken into use by `04 00`";
  EXPECT_FALSE(pending().configured());
  ASSERT_TRUE(o.rig.until_operational(60s)) << o.rig.log();
}

TEST(Promise, S1_53_ANodeIdThatWasStoredIsNotGivenToAnother) {
  OneSlot o;
  o.cut_x();
  o.rig.device("y").plug();
  EXPECT_TRUE(o.quiet_for(75s)) << o.rig.log();
  EXPECT_EQ(o.rig.state(2), SlotState::absent) << o.rig.log();
  EXPECT_NE(o.reason().find("berth replace s2"), std::string::npos) << o.reason();
  EXPECT_NE(o.reason().find("00000001"), std::string::npos) << "whose it is: " << o.reason();
  o.rig.device("x").plug();
  EXPECT_TRUE(o.quiet_for(10s)) << o.rig.log();
  ASSERT_TRUE(o.rig.until_operational(20s)) << o.rig.log();
  EXPECT_EQ(o.rig.seats(), (Seats{{2, 1}}));
}

TEST(Promise, S1_53_NorAfterAnyNumberOfRestarts) {
  OneSlot o;
  o.cut_x();
  o.rig.device("y").plug();
  for (int restart = 0; restart < 4; ++restart) {
    o.rig.kill();
    o.rig.begin();
    EXPECT_TRUE(o.quiet_for(12s)) << restart << "\n" << o.rig.log();
  }
  o.rig.device("x").plug();
  EXPECT_TRUE(o.quiet_for(10s)) << o.rig.log();
  ASSERT_TRUE(o.rig.until_operational(20s)) << o.rig.log();
  EXPECT_EQ(o.rig.seats(), (Seats{{2, 1}}));
}

// A device that a person named, and that is not there yet, is waited for.
TEST(Promise, ADeviceThatAPersonNamedKeepsItsSlotUntilItComes) {
  OneSlot o;
  o.rig.device("x").unplug();
  o.rig.begin();
  o.rig.run_for(3s);
  ASSERT_TRUE(o.rig.network().replace("s2", LssAddress{type_b.vendor, type_b.product, 0, 1}));
  o.rig.device("y").plug();
  EXPECT_TRUE(o.quiet_for(20s)) << o.rig.log();
  o.rig.device("x").plug();
  ASSERT_TRUE(o.rig.until_operational(20s)) << o.rig.log();
  EXPECT_EQ(o.rig.seats(), (Seats{{2, 1}}));
}

// What ends it: a person. The device that comes back all the same gives the node-ID up, and the running one has it
// again within a second.
TEST(Promise, APersonEndsItAndTheOldDeviceIsIsolatedWhenItComesBack) {
  OneSlot o;
  o.cut_x();
  o.rig.device("y").plug();
  EXPECT_TRUE(o.quiet_for(10s)) << o.rig.log();
  ASSERT_TRUE(o.rig.network().replace("s2", std::nullopt));
  ASSERT_TRUE(o.rig.until_operational(30s)) << o.rig.log();
  ASSERT_EQ(o.rig.seats(), (Seats{{2, 2}}));
  o.rig.run_for(20s);
  o.rig.device("x").plug();
  rt::Duration doubled{0};
  for (int i = 0; i < 1000; ++i) {
    o.rig.run_for(5ms);
    if (!o.rig.world().duplicates().empty()) doubled += 5ms;
  }
  EXPECT_LT(doubled, 1s) << o.rig.log();
  EXPECT_FALSE(o.rig.device("x").truth().active.configured()) << o.rig.log();
  EXPECT_FALSE(o.rig.device("x").truth().persistent.configured()) << "a power failure must not bring it back";
  ASSERT_TRUE(o.rig.until_operational(20s)) << o.rig.log();
  EXPECT_EQ(o.rig.seats(), (Seats{{2, 2}}));
}

// Another device, with the slot's node-ID stored; it is plugged in when it hurts.
void add_late_two(plant::PlantFile& p) {
  auto& y = add_device(p, "y", type_c, 2);
  y.source = plant::NodeIdSource::nonvolatile;
  y.node_id = NodeId(2);
  y.boot = 3ms;
  y.plugged = false;
}

// X comes with a node-ID of elsewhere, and has stored that of its slot. Before the reset that brings it into use
// another device boots under it: X is not reset, and nothing is started.
TEST(Promise, ANodeIdThatBootsElsewhereBeforeTheResetIsNotBroughtIntoUse) {
  design::Machine m = one_bus(125'000);
  add_slot(m, 2, type_b);
  auto p = one_bus_plant(1);
  auto& x = add_device(p, "x", type_b, 1);
  x.source = plant::NodeIdSource::nonvolatile;
  x.node_id = NodeId(9);
  add_late_two(p);
  Rig rig(m, p);
  bool stored = false;
  const At stores(rig, 0x7E4, {0x17, 0x00}, [&] { stored = true; });
  const At released(rig, 0x7E5, {0x04, 0x00}, [&] {
    if (stored && !rig.device("y").plugged()) rig.device("y").plug();
  });
  rig.begin();
  ASSERT_TRUE(rig.run_until([&] { return rig.device("y").truth().active == NodeId(2); }, 20s)) << rig.log();
  for (int i = 0; i < 2000; ++i) {
    rig.run_for(5ms);
    ASSERT_TRUE(rig.world().duplicates().empty()) << i << "\n" << rig.log();
  }
  ASSERT_TRUE(rig.until_operational(40s)) << rig.log();
  EXPECT_EQ(rig.seats(), (Seats{{2, 1}}));
}

// A device boots under X's node-ID while X is proven alone: X is told nothing, for Berth could end before it took it
// back.
TEST(Promise, ANodeIdThatBootsElsewhereIsNotTold) {
  design::Machine m = one_bus(125'000);
  add_slot(m, 2, type_b);
  auto p = one_bus_plant(1);
  add_device(p, "x", type_b, 1);
  add_late_two(p);
  Rig rig(m, p);
  const At selected(rig, 0x7E4, {0x44}, [&] { rig.device("y").plug(); });
  unsigned told = 0;
  const At tells(rig, 0x7E5, {0x11, 0x02}, [&] { told += rig.device("y").truth().active == NodeId(2) ? 1U : 0U; });
  rig.begin();
  ASSERT_TRUE(rig.until_operational(40s)) << rig.log();
  ASSERT_TRUE(rig.device("y").plugged());
  EXPECT_EQ(told, 0U) << rig.log();
  EXPECT_EQ(rig.seats(), (Seats{{2, 1}}));
}

// Y hears neither the `04 00` that ends its binding nor the proof that X is alone, and then the 11h for X. That they
// have none is what both are told to store then, and it is waited for from both: a device that is still storing
// executes no further 17h, and its late answer would be taken for that of the next.
TEST(Promise, WhatTwoDevicesAreToldToStoreIsWaitedForFromBoth) {
  design::Machine m = one_bus(125'000);
  m.buses.front().timing.boot_timeout = 1s;
  add_slot(m, 2, type_a);
  add_slot(m, 3, type_b);
  auto p = one_bus_plant(1);
  add_device(p, "y", type_a, 1).storing.time = 2s;
  add_device(p, "x", type_b, 2).storing.time = 5ms;
  Rig rig(m, p);
  plant::SimDevice& y = rig.device("y");
  int stores = 0;
  const At stored(rig, 0x7E4, {0x17, 0x00}, [&] { y.controller().deaf(++stores == 1); });
  const At proven(rig, 0x7E4, {0x5E}, [&] { y.controller().deaf(false); });
  bool both = false;
  const At taken(rig, 0x7E5, {0x11, 0xFF}, [&] { both = both || y.truth().pending == NodeId(3); });
  std::vector<NodeId> before;
  const At told(rig, 0x7E5, {0x11, 0x02}, [&] { before.push_back(y.truth().persistent); });
  rig.begin();
  ASSERT_TRUE(rig.until_operational(30s)) << rig.log();
  ASSERT_TRUE(both) << "this case is not the one that is meant";
  EXPECT_EQ(before, (std::vector<NodeId>{NodeId(), NodeId()}));
  EXPECT_EQ(rig.seats(), (Seats{{2, 1}, {3, 2}}));
  for (const auto& t : rig.world().truth()) EXPECT_EQ(t.persistent, t.active) << t.name;
}

// Y hears neither the `04 00` that ends its binding, nor the proof that X is alone, nor the first 11h for X, of which
// the answer is lost: the repetition is Y's too, and both answer it in one frame. X is not told to store before it is
// alone.
TEST(Promise, S1_53_ARepeated11hIsProvenBeforeAnythingIsStored) {
  design::Machine m = one_bus(125'000);
  add_slot(m, 2, type_a);
  add_slot(m, 3, type_b);
  auto p = one_bus_plant(1);
  add_device(p, "y", type_a, 1);
  add_device(p, "x", type_b, 2);
  Rig rig(m, p);
  plant::SimDevice& y = rig.device("y");
  bool first = true;
  const At stored(rig, 0x7E4, {0x17, 0x00}, [&] { y.controller().deaf(std::exchange(first, false)); });
  int told = 0;
  const At given(rig, 0x7E5, {0x11, 0x03}, [&] {
    if (++told != 1) return;
    y.controller().deaf(false);
    plant::PlantEvent lost;
    lost.action = plant::Action::overrun;
    lost.bus = "backbone";
    lost.nodes = {std::string(plant::master_name)};
    lost.strike.id = 0x7E4;
    EXPECT_TRUE(rig.world().perform(lost));
  });
  bool both = false;
  const At taken(rig, 0x7E4, {0x11, 0x00}, [&] { both = both || y.truth().pending == NodeId(3); });
  bool foreign = false;
  const At stores(rig, 0x7E5, {0x17}, [&] { foreign = foreign || y.truth().pending == NodeId(3); });
  rig.begin();
  ASSERT_TRUE(rig.until_operational(30s)) << rig.log();
  ASSERT_TRUE(both) << "this case is not the one that is meant";
  EXPECT_FALSE(foreign) << rig.log();
  EXPECT_EQ(rig.seats(), (Seats{{2, 1}, {3, 2}}));
}

// Y hears neither the `04 00` that ends its binding nor the proof that X is alone, but what comes behind X's 17h, of
// which the answer is lost: the node-ID that X had, and has again, is X's alone.
TEST(Promise, WhatADeviceHadIsGivenBackToItAlone) {
  design::Machine m = one_bus(125'000);
  add_slot(m, 2, type_a);
  add_slot(m, 3, type_b);
  auto p = one_bus_plant(1);
  add_device(p, "y", type_a, 1);
  auto& x = add_device(p, "x", type_b, 2);
  x.source = plant::NodeIdSource::nonvolatile;
  x.node_id = NodeId(9);
  Rig rig(m, p);
  plant::SimDevice& y = rig.device("y");
  int stores = 0;
  const At stored(rig, 0x7E4, {0x17, 0x00}, [&] { y.controller().deaf(stores == 1); });
  const At asked(rig, 0x7E5, {0x17}, [&] {
    if (++stores != 2) return;
    y.controller().deaf(false);
    plant::PlantEvent lost;
    lost.action = plant::Action::overrun;
    lost.bus = "backbone";
    lost.nodes = {std::string(plant::master_name)};
    lost.strike.id = 0x7E4;
    EXPECT_TRUE(rig.world().perform(lost));
  });
  rig.begin();
  ASSERT_TRUE(rig.run_until([&] { return stores > 1; }, 20s)) << rig.log();
  ASSERT_FALSE(y.truth().active.configured()) << "it heard `04 00`: not the case that is meant";
  for (int i = 0; i < 4000; ++i) {
    rig.run_for(5ms);
    ASSERT_TRUE(rig.world().duplicates().empty()) << i << "\n" << rig.log();
  }
  ASSERT_TRUE(rig.until_operational(40s)) << rig.log();
  EXPECT_EQ(rig.seats(), (Seats{{2, 1}, {3, 2}}));
}

// Of a device that leaves and one that comes under its node-ID while the four parts of the identity are read none is
// made that does not exist: a slot would wait for it for ever.
TEST(Promise, NoDeviceIsPutTogetherOfTwo) {
  design::Machine m = one_bus(125'000);
  add_slot(m, 2, type_b);
  auto p = one_bus_plant(1);
  const auto with_two = [&](const char* name, std::uint32_t revision, std::uint32_t serial) -> plant::PlantDevice& {
    auto& d = add_device(p, name, type_b, serial);
    d.address.revision = revision;
    d.source = plant::NodeIdSource::nonvolatile;
    d.node_id = NodeId(2);
    return d;
  };
  with_two("x", 1, 0x11).boot = 1ms;
  auto& y = with_two("y", 2, 0x22);
  y.boot = 1ms;
  y.plugged = false;
  Rig rig(m, p);
  const At third(rig, 0x602, {0x40, 0x18, 0x10, 0x03}, [&] { rig.device("y").plug(); });
  const At fourth(rig, 0x602, {0x40, 0x18, 0x10, 0x04}, [&] { rig.device("x").unplug(); });
  rig.begin();
  ASSERT_TRUE(rig.until_operational(40s)) << rig.log();
  const LssAddress none{type_b.vendor, type_b.product, 1, 0x22};
  EXPECT_EQ(rig.log().find(to_string(none)), std::string::npos) << rig.log();
  EXPECT_EQ(rig.seats(), (Seats{{2, 0x22}}));
}

// The same when both stay, and the other one answers the last question only, and first (seed 132376).
TEST(Promise, NoDeviceIsPutTogetherOfTwoWhenTheLastAnswerIsTheOthers) {
  design::Machine m = one_bus(125'000);
  add_slot(m, 2, type_b);
  auto p = one_bus_plant(1);
  const auto with_two = [&](const char* name, std::uint32_t revision, std::uint32_t serial) -> plant::PlantDevice& {
    auto& d = add_device(p, name, type_b, serial);
    d.address.revision = revision;
    d.source = plant::NodeIdSource::nonvolatile;
    d.node_id = NodeId(2);
    d.boot = 1ms;
    return d;
  };
  with_two("x", 1, 0x11).response = {6ms, 6ms, 0, 0ms};
  with_two("y", 2, 0x22).plugged = false;
  Rig rig(m, p);
  unsigned thirds = 0;
  const At third(rig, 0x602, {0x40, 0x18, 0x10, 0x03}, [&] {
    if (++thirds > 1) return;
    rig.device("y").plug();
    rig.device("y").deaf(34ms);  // until behind the same question of the second reading: x takes 8 ms for each
  });
  rig.begin();
  rig.run_for(20s);
  const LssAddress none{type_b.vendor, type_b.product, 1, 0x22};
  EXPECT_EQ(rig.log().find(to_string(none)), std::string::npos) << rig.log();
}

// The store is the last judge: an intention is never replaced by another device's.
TEST(Promise, TheStoreRefusesASecondIntentionForOneSlot) {
  places::MemoryStore store;
  const auto slot = store.declare({"m", "b", "s2"});
  ASSERT_TRUE(slot);
  const LssAddress x{1, 1, 0, 1};
  const LssAddress y{1, 1, 0, 2};
  ASSERT_TRUE(store.ask(*slot, {x, NodeId(2)}, ""));
  EXPECT_EQ(store.ask(*slot, {y, NodeId(2)}, "").error().code, Errc::duplicate);
  EXPECT_TRUE(store.ask(*slot, {x, NodeId(2)}, "again"));
  ASSERT_TRUE(store.clear(*slot, std::string(places::by_a_person)));
  EXPECT_TRUE(store.ask(*slot, {y, NodeId(2)}, ""));
}
