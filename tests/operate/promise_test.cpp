// The promise: a node-ID that may be in a device's memory belongs to that device until it was seen to have lost it, or
// a person gives it away. S1.29, S1.53.
#include <gtest/gtest.h>
#include <cstdint>
#include <optional>
#include <string>
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
