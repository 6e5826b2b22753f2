// Spares that are listed or were used before, and devices that return after their slot was given away.
#include <gtest/gtest.h>
#include <algorithm>
#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "tests/harness/rig.hpp"

using namespace berth;
using namespace berth::harness;
using places::SlotState;
using Seats = std::vector<std::pair<unsigned, std::uint32_t>>;

namespace spares_tests {
namespace {

bool heard(const Rig& rig, const std::string& kind) {
  return std::ranges::any_of(rig.events(), [&](const auto& e) { return name(e.kind) == kind; });
}
bool heard(const Rig& rig, const std::string& kind, const std::string& part) {
  return std::ranges::any_of(
      rig.events(), [&](const auto& e) { return name(e.kind) == kind && e.text.find(part) != std::string::npos; });
}
bool odd(Rig& rig, const std::string& kind, const std::string& part) {
  return std::ranges::any_of(rig.network().planning().plan().oddities, [&](const auto& o) {
    return name(o.kind) == kind && o.text.find(part) != std::string::npos;
  });
}

// How often a device in LSS configuration is told its node-ID, or to have none (CiA 305, 11h).
struct ToldNodeIds final : can::Tap {
  int count = 0;
  void frame(const can::Frame& f, rt::Time, int) noexcept override {
    count += f.id == 0x7E5 && f.size == 8 && f.data[0] == 0x11 ? 1 : 0;
  }
};

// One slot whose first device `a` left and whose second, `b`, runs there now.
struct Given {
  explicit Given(const std::function<void(plant::PlantFile&)>& change = {}, TypeCode type = type_b)
      : rig(machine_of(type), plant_of(type, change)) {
    rig.begin();
    EXPECT_TRUE(rig.until_operational(30s)) << rig.log();
    hand_over("a", "b");
  }
  // `from` leaves, a person gives the slot away, and `to` comes.
  void hand_over(const std::string& from, const std::string& to) {
    rig.device(from).unplug();
    EXPECT_TRUE(rig.run_until([this] { return rig.state(5) == SlotState::absent; }, 10s)) << rig.log();
    EXPECT_TRUE(rig.network().replace("s5", std::nullopt));
    rig.device(to).plug();
    EXPECT_TRUE(rig.until_operational(30s)) << rig.log();
  }
  static design::Machine machine_of(TypeCode type) {
    design::Machine m = one_bus(125'000);
    add_slot(m, 5, type);
    return m;
  }
  static plant::PlantFile plant_of(TypeCode type, const std::function<void(plant::PlantFile&)>& change) {
    auto p = one_bus_plant(1);
    add_device(p, "a", type, 1);
    add_device(p, "b", type, 2).plugged = false;
    add_device(p, "c", type, 3).plugged = false;
    if (change) change(p);
    return p;
  }
  // How long two devices held one node-ID, in steps of 5 ms.
  rt::Duration doubled_for(rt::Duration limit) {
    rt::Duration sum{0};
    for (rt::Duration t{0}; t < limit; t += 5ms) {
      rig.run_for(5ms);
      if (!rig.world().duplicates().empty()) sum += 5ms;
    }
    return sum;
  }
  Rig rig;
};

}  // namespace

TEST(Returning, TheOldDeviceIsIsolatedAndNamedWhileTheNewOneRuns) {
  Given g;
  ASSERT_EQ(g.rig.seats(), (Seats{{5, 2}}));
  ASSERT_EQ(g.rig.device("a").truth().persistent, NodeId(5)) << "it comes back under the slot's node-ID";
  g.rig.device("a").plug();
  EXPECT_LT(g.doubled_for(10s), 2s) << g.rig.log();
  EXPECT_TRUE(g.rig.world().duplicates().empty());
  EXPECT_FALSE(g.rig.device("a").truth().persistent.configured()) << "a power failure must not bring it back";
  EXPECT_TRUE(heard(g.rig, "returned", "sat in slot s5 until")) << g.rig.log();
  EXPECT_TRUE(odd(g.rig, "returned", "00000001")) << g.rig.log();
  ASSERT_TRUE(g.rig.until_operational(20s)) << g.rig.log();
  EXPECT_EQ(g.rig.seats(), (Seats{{5, 2}}));
  EXPECT_EQ(g.rig.device("b").truth().state, NmtState::operational);
  EXPECT_NE(g.rig.device("a").truth().state, NmtState::operational);
}

TEST(Returning, AnLssDeviceWithoutRandIsFoundByItsHistory) {
  Given g([](plant::PlantFile& p) {
    auto& a = p.devices[0];
    a.speaks = {plant::Speaks::lss};
    a.source = plant::NodeIdSource::nonvolatile;
    a.node_id = NodeId(5);
  });
  g.rig.device("a").plug();
  EXPECT_LT(g.doubled_for(10s), 2s) << g.rig.log();
  EXPECT_TRUE(g.rig.world().duplicates().empty());
  ASSERT_TRUE(g.rig.until_operational(20s)) << g.rig.log();
}

// A person must take it off the bus: LSS cannot change a node-ID that switches set.
TEST(Returning, OneWithSwitchesIsNotToldAgainAndAgainToLeave) {
  Given g([](plant::PlantFile& p) {
    p.devices[0].source = plant::NodeIdSource::switches;
    p.devices[0].node_id = NodeId(5);
  });
  ToldNodeIds told;
  g.rig.world().bus("backbone")->add_tap(told);
  g.rig.device("a").plug();
  g.rig.run_for(120s);
  EXPECT_TRUE(heard(g.rig, "returned", "take it off the bus")) << g.rig.log();
  EXPECT_LE(told.count, 1) << "it refuses, and that is known then\n" << g.rig.log();
  g.rig.world().bus("backbone")->remove_tap(told);
  g.rig.device("a").unplug();
  EXPECT_TRUE(g.rig.until_operational(30s)) << g.rig.log();
  EXPECT_EQ(g.rig.seats(), (Seats{{5, 2}}));
}

// At any moment: while the new one boots, is bound, is started, runs.
TEST(Returning, AtAnyTime) {
  for (const auto delay : {0ms, 30ms, 60ms, 120ms, 250ms, 400ms, 700ms, 1300ms}) {
    Rig rig(Given::machine_of(type_b), Given::plant_of(type_b, {}));
    rig.begin();
    ASSERT_TRUE(rig.until_operational(30s));
    rig.device("a").unplug();
    ASSERT_TRUE(rig.run_until([&] { return rig.state(5) == SlotState::absent; }, 10s));
    ASSERT_TRUE(rig.network().replace("s5", LssAddress{type_b.vendor, type_b.product, 0, 2}));
    rig.device("b").plug();
    rig.run_for(delay);
    rig.device("a").plug();
    rig.run_for(20s);
    EXPECT_TRUE(rig.world().duplicates().empty()) << delay.count() << "\n" << rig.log();
    EXPECT_TRUE(rig.until_operational(20s)) << delay.count() << "\n" << rig.log();
    EXPECT_EQ(rig.seats(), (Seats{{5, 2}})) << delay.count();
    EXPECT_FALSE(rig.device("a").truth().active.configured()) << delay.count() << "\n" << rig.log();
  }
}

TEST(Returning, WhileBerthWasAway) {
  Given g;
  g.rig.kill();
  g.rig.device("a").plug();
  g.rig.run_for(2s);
  g.rig.begin();
  g.rig.run_for(30s);
  EXPECT_TRUE(g.rig.world().duplicates().empty()) << g.rig.log();
  EXPECT_TRUE(g.rig.until_operational(20s)) << g.rig.log();
  EXPECT_EQ(g.rig.seats(), (Seats{{5, 2}}));
}

TEST(Spares, AListedOneTakesASilentDevicesSlotWithoutAQuestion) {
  auto m = Given::machine_of(type_b);
  m.slots[0].spec.spares = {3};
  Rig rig(m, Given::plant_of(type_b, {}));
  rig.begin();
  ASSERT_TRUE(rig.until_operational(30s)) << rig.log();
  rig.device("a").unplug();
  ASSERT_TRUE(rig.run_until([&] { return rig.state(5) == SlotState::absent; }, 10s));
  rig.device("b").plug();  // a device like another: the slot is still its old device's
  rig.run_for(10s);
  EXPECT_EQ(rig.seats(), (Seats{{5, 1}})) << rig.log();
  rig.device("c").plug();
  ASSERT_TRUE(rig.until_operational(30s)) << rig.log();
  EXPECT_EQ(rig.seats(), (Seats{{5, 3}}));
  EXPECT_FALSE(heard(rig, "question"));
}

TEST(Spares, AUsedOneIsAskedAboutAndRestoredFirst) {
  Given g({}, type_pump);
  // It sat here, was given away by a person, and is the only one left.
  g.rig.device("b").unplug();
  ASSERT_TRUE(g.rig.run_until([&] { return g.rig.state(5) == SlotState::absent; }, 10s));
  ASSERT_TRUE(g.rig.network().replace("s5", std::nullopt));
  g.rig.device("a").plug();
  g.rig.run_for(15s);
  EXPECT_EQ(g.rig.state(5), SlotState::question) << g.rig.log();
  EXPECT_TRUE(heard(g.rig, "question", "sat in slot s5 until")) << g.rig.log();
  EXPECT_TRUE(g.rig.seats().empty());
  EXPECT_NE(g.rig.device("a").truth().active, NodeId(5)) << "it waits, and not under the slot's node-ID";
  ASSERT_TRUE(g.rig.network().replace("s5", std::nullopt, true));
  ASSERT_TRUE(g.rig.until_operational(30s)) << g.rig.log();
  EXPECT_EQ(g.rig.seats(), (Seats{{5, 1}}));
  EXPECT_TRUE(heard(g.rig, "restored", "has its factory settings")) << g.rig.log();
  const LssAddress a{type_pump.vendor, type_pump.product, 0, 1};
  const auto lines = g.rig.store().history_of({a, {"rig", "backbone"}});
  EXPECT_TRUE(std::ranges::any_of(*lines, [](const auto& l) { return l.event == "restored"; }));
  EXPECT_TRUE(g.rig.store().marked(places::Mark::restore).value().empty());
}

TEST(Spares, NobodyWaitsThatCouldBeUsed) {
  Given g;
  EXPECT_EQ(g.rig.network().replace("s5", std::nullopt, true).error().code, Errc::not_found);
  EXPECT_EQ(g.rig.seats(), (Seats{{5, 2}})) << "a refused command changes nothing";
}

// replacement = "auto": Berth itself freed the slot, so the same device back there is no news.
TEST(Spares, ADeviceThatWasOnlySilentGoesHomeWithoutAQuestion) {
  auto m = Given::machine_of(type_b);
  add_slot(m, 6, type_b);
  for (auto& slot : m.slots) slot.spec.replacement = places::Replacement::automatic;
  auto p = Given::plant_of(type_b, {});
  p.devices[1].plugged = true;
  p.devices.pop_back();
  m.slots[0].spec.when_ambiguous = m.slots[1].spec.when_ambiguous = places::WhenAmbiguous::ascending;
  Rig rig(m, p);
  rig.begin();
  ASSERT_TRUE(rig.until_operational(30s)) << rig.log();
  ASSERT_EQ(rig.seats(), (Seats{{5, 1}, {6, 2}}));
  rig.device("a").unplug();
  rig.device("b").unplug();
  ASSERT_TRUE(rig.run_until([&] { return rig.seats().empty(); }, 20s)) << rig.log();
  rig.device("b").plug();
  rig.run_for(5s);
  rig.device("a").plug();
  ASSERT_TRUE(rig.until_operational(30s)) << rig.log();
  EXPECT_EQ(rig.seats(), (Seats{{5, 1}, {6, 2}})) << "each where it sat";
  EXPECT_FALSE(heard(rig, "question")) << rig.log();
}

TEST(Spares, RevisionsAndSuccessors) {
  auto m = Given::machine_of(type_b);
  auto& spec = m.slots[0].spec;
  spec.revision = 0x00020000;
  spec.rule = places::RevisionRule::major;
  spec.also = {{type_c, 0x00010000}};
  auto p = one_bus_plant(1);
  add_device(p, "old", type_b, 1).address.revision = 0x00010005;
  add_device(p, "next", type_c, 2).address.revision = 0x00010007;
  p.devices[1].plugged = false;
  Rig rig(m, p);
  rig.begin();
  rig.run_for(10s);
  EXPECT_TRUE(rig.seats().empty()) << rig.log();
  EXPECT_TRUE(odd(rig, "wrong revision", "00010005")) << rig.log();
  rig.device("next").plug();
  ASSERT_TRUE(rig.until_operational(30s)) << rig.log();
  EXPECT_EQ(rig.seats(), (Seats{{5, 2}})) << "the successor type, of the right major revision";
}

}  // namespace spares_tests
