// Where node-IDs come from (paper 4, S4.2, S4.21): hard-coded, switches, connector, stored, dynamic, and objects.
#include <gtest/gtest.h>
#include <algorithm>
#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "berth/rt/scope.hpp"
#include "tests/harness/rig.hpp"

using namespace berth;
using namespace berth::harness;
using places::SlotState;
using plant::NodeIdSource;
using Seats = std::vector<std::pair<unsigned, std::uint32_t>>;

namespace {

bool odd(Rig& rig, const std::string& kind, const std::string& part) {
  return std::ranges::any_of(rig.network().planning().plan().oddities, [&](const auto& o) {
    return name(o.kind) == kind && o.text.find(part) != std::string::npos;
  });
}

// Counts what LSS writes: 11h, 13h, 17h.
struct Writes final : can::Tap {
  unsigned configure = 0;
  unsigned store = 0;
  void frame(const can::Frame& f, rt::Time, int) noexcept override {
    if (f.key() != 0x7E5) return;
    if (f.data[0] == 0x11) ++configure;
    if (f.data[0] == 0x17) ++store;
  }
};

plant::PlantDevice& with_id(plant::PlantDevice& d, NodeIdSource source, unsigned id) {
  d.source = source;
  d.node_id = NodeId(static_cast<std::uint8_t>(id));
  return d;
}

constexpr TypeCode type_fixed{0x00000002, 0x00000001};
constexpr TypeCode type_recipe{0x00000003, 0x00000001};

design::Machine recipe_machine(std::initializer_list<unsigned> ids) {
  auto recipe = std::make_shared<places::Recipe>();
  recipe->name = "old drive";
  recipe->from = {NodeId(1)};
  recipe->writes = {{0x2000, 0, 1, 0, true}, {0x2001, 0, 4, 0x65766173, false}};
  design::Machine m = one_bus(125'000);
  for (const auto id : ids) {
    add_slot(m, id, type_recipe);
    m.slots.back().spec.assign = places::Assign::recipe;
    m.slots.back().spec.recipe = recipe;
    m.slots.back().spec.when_ambiguous = places::WhenAmbiguous::one_at_a_time;
  }
  return m;
}

plant::PlantDevice& add_drive(plant::PlantFile& p, const std::string& name, std::uint32_t serial, unsigned id = 1) {
  auto& d = with_id(add_device(p, name, type_recipe, serial), NodeIdSource::nonvolatile, id);
  d.speaks = {};
  d.node_id_object.object = ObjectRef{0x2000, 0};
  d.node_id_object.signature = plant::PlantSignature{{0x2001, 0}, 0x65766173, 4};
  return d;
}

}  // namespace

TEST(Sources, S4_2_FixedStoredAndBlankOnOneBus) {
  design::Machine m = one_bus(125'000);
  for (const unsigned id : {2U, 3U, 4U}) add_slot(m, id, TypeCode{0x10, id});
  for (const unsigned id : {5U, 6U, 7U}) {
    add_slot(m, id, TypeCode{0x20, id});
    m.slots.back().spec.assign = places::Assign::fixed;
  }
  auto p = one_bus_plant(1);
  add_device(p, "blank", TypeCode{0x10, 2}, 1);
  with_id(add_device(p, "one", TypeCode{0x10, 3}, 1), NodeIdSource::nonvolatile, 1);
  with_id(add_device(p, "thirty-two", TypeCode{0x10, 4}, 1), NodeIdSource::nonvolatile, 32).speaks = {
      plant::Speaks::lss};
  with_id(add_device(p, "firmware", TypeCode{0x20, 5}, 1), NodeIdSource::hard_coded, 5).speaks = {};
  with_id(add_device(p, "switches", TypeCode{0x20, 6}, 1), NodeIdSource::switches, 6).speaks = {plant::Speaks::lss};
  with_id(add_device(p, "plug", TypeCode{0x20, 7}, 1), NodeIdSource::connector, 7);
  Writes writes;
  Rig rig(m, p);
  rig.world().bus("backbone")->add_tap(writes);
  rig.begin();
  ASSERT_TRUE(rig.until_operational(60s)) << rig.log();
  EXPECT_EQ(rig.seats(), (Seats{{2, 1}, {3, 1}, {4, 1}, {5, 1}, {6, 1}, {7, 1}}));
  EXPECT_EQ(writes.configure, 3U) << "one for each device whose node-ID LSS can change, and none for the others";
  EXPECT_EQ(writes.store, 3U);
}

TEST(Sources, S4_2_AFixedNodeIdThatDoesNotFitIsAFinding) {
  design::Machine m = one_bus(125'000);
  add_slot(m, 7, type_fixed);
  m.slots.back().spec.assign = places::Assign::fixed;
  auto p = one_bus_plant(1);
  with_id(add_device(p, "a", type_fixed, 1), NodeIdSource::switches, 9).speaks = {plant::Speaks::lss};
  Writes writes;
  Rig rig(m, p);
  rig.world().bus("backbone")->add_tap(writes);
  rig.begin();
  rig.run_for(20s);
  EXPECT_TRUE(rig.seats().empty());
  EXPECT_TRUE(odd(rig, "fixed mismatch", "has node-ID 9")) << rig.log();
  EXPECT_TRUE(odd(rig, "fixed mismatch", "slot s7 needs 7: set its switches to 7")) << rig.log();
  EXPECT_EQ(writes.configure, 0U) << "never written";
  EXPECT_EQ(writes.store, 0U);
  // The person turns the switch.
  rig.device("a").next_power_on().node_id = NodeId(7);
  rig.device("a").power(false);
  rig.device("a").power(true);
  ASSERT_TRUE(rig.until_operational(30s)) << rig.log();
  EXPECT_EQ(rig.seats(), (Seats{{7, 1}}));
  EXPECT_EQ(writes.configure, 0U);
}

// A slot that expects LSS, and a device that turns out to have switches.
TEST(Sources, S4_2_WhoRefusesElevenIsRememberedAndNotWrittenAgain) {
  design::Machine m = one_bus(125'000);
  add_slot(m, 7, type_b);
  auto p = one_bus_plant(1);
  with_id(add_device(p, "a", type_b, 1), NodeIdSource::switches, 9);
  Writes writes;
  Rig rig(m, p);
  rig.world().bus("backbone")->add_tap(writes);
  rig.begin();
  rig.run_for(10s);
  EXPECT_TRUE(odd(rig, "fixed mismatch", "slot s7 needs 7")) << rig.log();
  const auto told = writes.configure;
  EXPECT_GE(told, 1U);
  rig.run_for(40s);
  EXPECT_EQ(writes.configure, told) << "once is enough";
  EXPECT_EQ(rig.store().marked(places::Mark::fixed).value().size(), 1U);
  rig.kill();
  rig.begin();
  rig.run_for(20s);
  EXPECT_EQ(writes.configure, told) << "also for the next run";
}

TEST(Sources, S4_21_StoredFactoryNodeIdsAreFoundAndSetRight) {
  for (const unsigned id : {1U, 32U, 127U}) {
    design::Machine m = one_bus(125'000);
    add_slot(m, 7, type_b);
    auto p = one_bus_plant(1);
    with_id(add_device(p, "a", type_b, 1), NodeIdSource::nonvolatile, id).speaks = {plant::Speaks::lss};
    Rig rig(m, p);
    rig.begin();
    ASSERT_TRUE(rig.until_operational(60s)) << id << "\n" << rig.log();
    EXPECT_EQ(rig.device("a").truth().persistent, NodeId(7)) << id;
  }
}

// CANopenNode's slaves answer no identify, and Fastscan only without a node-ID: this one booted before Berth began, and
// beats no heart.
TEST(Sources, S4_21_AStoredNodeIdThatNoSearchFindsIsAskedFor) {
  for (const unsigned id : {9U, 32U, 126U}) {
    design::Machine m = one_bus(125'000);
    add_slot(m, 7, type_b);
    add_slot(m, 8, type_a);
    m.slots.back().spec.optional = true;
    auto p = one_bus_plant(1);
    add_device(p, "neighbour", type_a, 1);
    auto& d = with_id(add_device(p, "a", type_b, 1), NodeIdSource::nonvolatile, id);
    d.speaks = {plant::Speaks::fastscan};
    d.lss.habit = plant::Habit::canopennode;
    Rig rig(m, p);
    rig.run_for(3s);
    rig.begin();
    ASSERT_TRUE(rig.until_operational(15s)) << id << "\n" << rig.log();
    EXPECT_EQ(rig.seats(), (Seats{{7, 1}, {8, 1}}));
    EXPECT_EQ(rig.device("a").truth().persistent, NodeId(7)) << id;
  }
}

TEST(Sources, FromScratchBindsAnewWhatWasCrossed) {
  design::Machine m = one_bus(125'000);
  add_slot(m, 2, type_a);
  add_slot(m, 3, type_b);
  add_slot(m, 4, type_fixed);
  m.slots.back().spec.assign = places::Assign::fixed;
  auto p = one_bus_plant(1);
  add_device(p, "a", type_a, 1);
  add_device(p, "b", type_b, 2);
  with_id(add_device(p, "f", type_fixed, 3), NodeIdSource::switches, 4);
  Rig rig(m, p);
  rig.begin();
  ASSERT_TRUE(rig.until_operational(60s)) << rig.log();
  rt::Scope scope(rig.world().executor());
  std::optional<Result<void>> said;
  const auto ask = [](operate::Network& network, bool confirmed, std::optional<Result<void>>& into) -> rt::Task<void> {
    const auto result = co_await network.bind_from_scratch(confirmed);
    into = result;
  };
  scope.spawn(ask(rig.network(), false, said));
  ASSERT_TRUE(rig.run_until([&] { return said.has_value(); }, 10s));
  EXPECT_EQ(said->error().code, Errc::invalid);
  EXPECT_EQ(rig.device("a").truth().persistent, NodeId(2)) << "nothing happens without a confirmation";
  said.reset();
  const auto before = rig.device("a").truth().memory_writes;
  scope.spawn(ask(rig.network(), true, said));
  ASSERT_TRUE(rig.run_until([&] { return said.has_value(); }, 60s)) << rig.log();
  EXPECT_TRUE(*said) << rig.log();
  EXPECT_EQ(rig.seats(), (Seats{{2, 1}, {3, 2}, {4, 3}}));
  EXPECT_GE(rig.device("a").truth().memory_writes, before + 2) << "blanked, and given its node-ID again";
  EXPECT_EQ(rig.device("f").truth().memory_writes, 0U) << "fixed node-IDs stay";
  EXPECT_TRUE(rig.until_operational(30s)) << rig.log();
}

TEST(Recipe, S4_2_ADeviceWithoutLssGetsItsNodeIdByItsRecipe) {
  auto p = one_bus_plant(1);
  add_drive(p, "d", 1);
  Writes writes;
  Rig rig(recipe_machine({5}), p);
  rig.world().bus("backbone")->add_tap(writes);
  rig.begin();
  ASSERT_TRUE(rig.until_operational(60s)) << rig.log();
  EXPECT_EQ(rig.seats(), (Seats{{5, 1}}));
  EXPECT_EQ(rig.device("d").truth().persistent, NodeId(5));
  EXPECT_EQ(rig.device("d").truth().active, NodeId(5));
  EXPECT_EQ(writes.configure, 0U);
}

TEST(Recipe, OneAfterTheOther) {
  auto p = one_bus_plant(1);
  add_drive(p, "d", 1);
  add_drive(p, "e", 2).plugged = false;
  Rig rig(recipe_machine({5, 6}), p);
  rig.begin();
  ASSERT_TRUE(rig.run_until([&] { return rig.seats().size() == 1; }, 60s)) << rig.log();
  rig.device("e").plug();
  ASSERT_TRUE(rig.until_operational(60s)) << rig.log();
  EXPECT_EQ(rig.seats(), (Seats{{5, 1}, {6, 2}}));
}

// Known by their node-IDs, which the recipe changes; Berth ends in the middle of the first.
TEST(Recipe, OneAfterTheOtherWithoutSerialNumbers) {
  for (rt::Duration at = 100ms; at < 1500ms; at += 90ms) {
    auto p = one_bus_plant(1);
    add_drive(p, "d", 0);
    add_drive(p, "e", 0).plugged = false;
    Rig rig(recipe_machine({5, 6}), p);
    rig.begin();
    rig.run_for(at);
    rig.kill();
    rig.begin();
    ASSERT_TRUE(rig.run_until([&] { return rig.seats().size() == 1; }, 60s)) << at.count() << "\n" << rig.log();
    rig.device("e").plug();
    ASSERT_TRUE(rig.until_operational(60s)) << at.count() << "\n" << rig.log();
    EXPECT_EQ(rig.device("d").truth().persistent, NodeId(5));
    EXPECT_EQ(rig.device("e").truth().persistent, NodeId(6));
    EXPECT_EQ(rig.seats(), (Seats{{5, 0}, {6, 0}}));
  }
}

TEST(Recipe, TwoUnderTheFactoryNodeIdAreNotTouched) {
  auto p = one_bus_plant(1);
  add_drive(p, "d", 1).response = {500us, 2ms, 0, 0ms};
  add_drive(p, "e", 2).response = {500us, 2ms, 0, 0ms};
  Rig rig(recipe_machine({5, 6}), p);
  rig.begin();
  rig.run_for(30s);
  EXPECT_TRUE(rig.seats().empty()) << rig.log();
  EXPECT_EQ(rig.device("d").truth().memory_writes, 0U);
  EXPECT_EQ(rig.device("e").truth().memory_writes, 0U);
  EXPECT_TRUE(std::ranges::any_of(rig.events(), [](const auto& e) { return e.kind == operate::EventKind::duplicate; }))
      << rig.log();
  rig.device("e").unplug();
  ASSERT_TRUE(rig.run_until([&] { return rig.seats().size() == 1; }, 60s)) << rig.log();
}

// Berth ends at every 3rd moment of the binding and begins again.
TEST(Recipe, S1_53_ARestartInTheMiddleEndsWell) {
  for (rt::Duration at = 100ms; at < 1500ms; at += 90ms) {
    auto p = one_bus_plant(1);
    add_drive(p, "d", 1);
    Rig rig(recipe_machine({5}), p);
    rig.begin();
    rig.run_for(at);
    rig.kill();
    rig.run_for(50ms);
    rig.begin();
    ASSERT_TRUE(rig.until_operational(60s)) << at.count() << "\n" << rig.log();
    EXPECT_EQ(rig.device("d").truth().persistent, NodeId(5));
  }
}
