// Devices that tell an identity that is not one, or do what was not asked (issue 39, bad input): each is operational
// with one word about it, or its slot says what is wrong and what to do. The others run, and the bus comes to rest.
#include <fmt/format.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <functional>
#include <map>
#include <string>
#include <vector>

#include "tests/harness/as_sold.hpp"
#include "tests/harness/master_ear.hpp"
#include "tests/harness/rig.hpp"

using namespace berth;
using namespace berth::harness;
using places::SlotState;
using plant::Speaks;

namespace bad_identity_tests {
namespace {

constexpr unsigned odd_id = 40;

// What is beside the odd device, and of what kind that is.
struct Kind {
  std::string name;
  unsigned healthy = 1;
  std::uint32_t bit_rate = 125'000;
  bool fixed = false;
  std::uint32_t serial = 77;
  plant::SpeaksSet speaks{Speaks::lss, Speaks::rand};
};

std::vector<Kind> kinds() {
  return {{.name = "blank"},
          {.name = "fastscan", .speaks = {Speaks::fastscan}},
          {.name = "blank without serial number", .serial = 0, .speaks = {Speaks::fastscan}},
          {.name = "fixed", .fixed = true, .speaks = {}},
          {.name = "fixed without serial number", .fixed = true, .serial = 0, .speaks = {}},
          {.name = "30", .healthy = 30},
          {.name = "30, fixed", .healthy = 30, .fixed = true, .serial = 0, .speaks = {}},
          {.name = "10 kbit/s", .bit_rate = 10'000},
          {.name = "10 kbit/s, fixed", .bit_rate = 10'000, .fixed = true, .speaks = {}},
          {.name = "1 Mbit/s", .bit_rate = 1'000'000}};
}

struct World {
  design::Machine machine;
  plant::PlantFile plant;
};

World world_of(const Kind& kind) {
  World w{one_bus(kind.bit_rate), one_bus_plant(1)};
  for (unsigned i = 1; i <= kind.healthy; ++i) {
    add_slot(w.machine, i, type_a);
    add_device(w.plant, "d" + std::to_string(i), type_a, i);
  }
  add_slot(w.machine, odd_id, type_b);
  auto& odd = add_device(w.plant, "odd", type_b, kind.serial);
  odd.speaks = kind.speaks;
  if (!kind.fixed) return w;
  w.machine.slots.back().spec.assign = places::Assign::fixed;
  odd.source = plant::NodeIdSource::switches;
  odd.node_id = NodeId(odd_id);
  return w;
}

operate::SlotReport odd_slot(Rig& rig) {
  const auto all = rig.network(0).report();
  const auto it = std::ranges::find(all, NodeId(odd_id), &operate::SlotReport::id);
  return it == all.end() ? operate::SlotReport() : *it;
}

std::size_t healthy(Rig& rig) {
  const auto all = rig.network(0).report();
  return static_cast<std::size_t>(std::ranges::count_if(
      all, [](const auto& s) { return s.id != NodeId(odd_id) && s.state == SlotState::operational; }));
}

// How one run of Berth went, until nothing changes any more and two minutes behind that.
struct Went {
  operate::SlotReport odd;
  std::vector<std::string> told;  // of the odd device and its slot
  std::size_t changes = 0;        // its slot's, among them
  std::size_t late = 0;           // events of any kind in the last two minutes
  double frames = 0;              // Berth's a second, in these
  std::map<std::uint32_t, unsigned> by_id;
  std::size_t healthy = 0;  // slots of the others that are operational
  unsigned writes = 0;      // of 1017h of the odd device
  bool again = false;       // behind a restart of Berth

  [[nodiscard]] bool says(const std::string& words) const {
    return std::ranges::any_of(told, [&](const auto& line) { return line.find(words) != std::string::npos; });
  }
  // As it was told; 0: it was not.
  [[nodiscard]] std::chrono::milliseconds period() const {
    const std::string words = "its heartbeat comes every ";
    for (const auto& line : told) {
      const auto at = line.find(words);
      if (at != std::string::npos) return std::chrono::milliseconds(std::stoi(line.substr(at + words.size())));
    }
    return 0ms;
  }
  [[nodiscard]] std::size_t times(const std::string& words) const {
    return static_cast<std::size_t>(
        std::ranges::count_if(told, [&](const auto& line) { return line.find(words) != std::string::npos; }));
  }
};

bool writes_heartbeat_time(const can::Frame& frame) {
  const bool to_it = frame.id == 0x600 + odd_id && !frame.extended && frame.size == 8;
  return to_it && (frame.data[0] & 0xE0U) == 0x20 && frame.data[1] == 0x17 && frame.data[2] == 0x10;
}

Went until_rest(Rig& rig, const Kind& kind, rt::Duration settles = 90s) {
  Went now;
  const std::size_t before = rig.events().size();
  rig.begin();
  MasterEar ear(rig);
  ear.on_frame = [&](const can::Frame& frame) {
    now.writes += writes_heartbeat_time(frame) ? 1 : 0;
    ++now.by_id[frame.id];
  };
  rig.run_for(kind.bit_rate < 50'000 ? 3 * settles : settles);
  const std::size_t settled = rig.events().size();
  ear.frames = 0;
  now.by_id.clear();
  rig.run_for(120s);
  now.frames = ear.frames / 120.0;
  now.late = rig.events().size() - settled;
  now.odd = odd_slot(rig);
  now.healthy = healthy(rig);
  const std::string slot = "s" + std::to_string(odd_id);
  for (std::size_t i = before; i < rig.events().size(); ++i) {
    const auto& event = rig.events()[i];
    const std::string line = operate::to_line(event);
    if (event.slot != slot && line.find(" " + slot + ":") == std::string::npos) continue;
    now.told.push_back(line);
    if (event.kind == operate::EventKind::state) ++now.changes;
  }
  return now;
}

// What may still happen then.
struct Rest {
  double frames = 6;     // Berth's a second: its heartbeat and its looks, and two of guarding
  std::size_t late = 0;  // events
};
constexpr std::size_t most_changes = 10;  // of the odd device's slot, until it is as it stays

// What holds whatever is wrong with the one.
void expect_rest(const Went& run, const Kind& kind, Rig& rig, Rest rest = {}) {
  EXPECT_EQ(run.healthy, kind.healthy) << rig.log();
  EXPECT_LE(run.late, rest.late) << "something is tried again and again\n" << rig.log();
  EXPECT_LE(run.changes, most_changes) << rig.log();
  std::string ids;
  for (const auto& [id, count] : run.by_id) ids += fmt::format(" {:X}h: {}", id, count);
  EXPECT_LT(run.frames, rest.frames) << ids << "\n" << rig.log();
}

using Habit = std::function<void(plant::PlantDevice&)>;
using Expect = std::function<void(const Went&, Rig&)>;

// With each kind, and again behind a restart of Berth that finds its store.
void each_kind(const std::vector<Kind>& all, const Habit& habit, const Expect& expect) {
  for (const Kind& kind : all) {
    SCOPED_TRACE(kind.name);
    World w = world_of(kind);
    habit(w.plant.devices.back());
    Rig rig(w.machine, w.plant);
    for (const bool again : {false, true}) {
      SCOPED_TRACE(again ? "behind a restart" : "at first");
      Went now = until_rest(rig, kind);
      now.again = again;
      expect_rest(now, kind, rig);
      expect(now, rig);
      rig.kill();
      rig.run_for(1s);
    }
  }
}

void expect_operational(const Went& run, Rig& rig) {
  EXPECT_EQ(run.odd.state, SlotState::operational) << run.odd.reason << "\n" << rig.log();
  EXPECT_EQ(rig.device("odd").truth().state, NmtState::operational) << rig.log();
}

}  // namespace

// ---- 1018h ----

TEST(BadIdentity, OneThatChangesFromReadingToReadingIsNotCompared) {
  constexpr std::uint8_t serial = 8, product = 2, all = 15;
  for (const std::uint8_t changing : {serial, product, all}) {
    each_kind(
        kinds(), [&](plant::PlantDevice& d) { d.does.odd.changing = changing; },
        [](const Went& now, Rig& rig) {
          expect_operational(now, rig);
          EXPECT_LE(now.times("from reading to reading"), 1U) << rig.log();
          EXPECT_FALSE(now.says("another device")) << rig.log();
        });
  }
}

// It was identified by its first reading; what is read behind a boot-up is another.
TEST(BadIdentity, OneThatChangesIsNamedWhenItIsAskedAgain) {
  const Kind kind{.name = "blank"};
  World w = world_of(kind);
  w.plant.devices.back().does.odd.changing = 8;
  Rig rig(w.machine, w.plant);
  rig.begin();
  ASSERT_TRUE(rig.until_operational(30s)) << rig.log();
  rig.device("odd").reset();
  rig.run_for(2s);
  ASSERT_TRUE(rig.until_operational(30s)) << rig.log();
  EXPECT_NE(rig.log().find("s40: 1018h:04 changes from reading to reading"), std::string::npos) << rig.log();
}

TEST(BadIdentity, ASerialNumberThatSdoAndLssTellDifferently) {
  std::vector<Kind> with_lss = kinds();
  std::erase_if(with_lss, [](const Kind& kind) { return kind.fixed || kind.serial == 0; });
  ASSERT_GE(with_lss.size(), 4U);
  each_kind(
      with_lss, [](plant::PlantDevice& d) { d.does.odd.sdo_serial = 1234; },
      [](const Went& now, Rig& rig) {
        expect_operational(now, rig);
        EXPECT_EQ(now.times("and LSS report different serial numbers"), 1U) << rig.log();
        ASSERT_TRUE(now.odd.device);
        EXPECT_EQ(now.odd.device->address.serial, 77U) << "it is known by what LSS tells";
        EXPECT_EQ(rig.device("odd").truth().persistent, NodeId(odd_id));
      });
}

// Two devices may say the same as that one: the slot's, silent to SDO, and another with its node-ID.
TEST(BadIdentity, AnotherDeviceIsNotTakenForOneThatTellsTwoSerialNumbers) {
  const Kind kind{.name = "blank"};
  World w = world_of(kind);
  auto other = w.plant.devices.back();
  other.name = "other";
  other.address.serial = 1234;
  other.source = plant::NodeIdSource::switches;
  other.node_id = NodeId(odd_id);
  other.speaks = {};
  other.plugged = false;
  w.plant.devices.push_back(other);
  for (const bool own_stays : {false, true}) {
    Rig rig(w.machine, w.plant);
    rig.begin();
    ASSERT_TRUE(rig.until_operational(30s)) << rig.log();
    if (!own_stays) rig.device("odd").unplug();
    if (!own_stays) rig.run_for(5s);
    rig.device("other").plug();
    rig.run_for(60s);
    EXPECT_EQ(rig.log().find("report different serial numbers"), std::string::npos) << rig.log();
    EXPECT_NE(rig.device("other").truth().state, NmtState::operational) << rig.log();
  }
}

TEST(BadIdentity, OneThatIsToldInPreOperationalOnly) {
  each_kind(
      kinds(), [](plant::PlantDevice& d) { d.does.odd.identity_only_pre_operational = true; },
      [](const Went& now, Rig& rig) { expect_operational(now, rig); });
}

// A fresh store finds it running, and learns nothing of it but its node-ID.
TEST(BadIdentity, OneThatIsToldInPreOperationalOnlyAndRuns) {
  for (const bool fixed : {false, true}) {
    const Kind kind{.name = "runs", .fixed = fixed, .speaks = fixed ? plant::SpeaksSet{} : Kind().speaks};
    World w = world_of(kind);
    w.plant.devices.back().does.odd.identity_only_pre_operational = true;
    places::MemoryStore first;
    Rig rig(w.machine, w.plant);
    rig.begin();
    ASSERT_TRUE(rig.until_operational(30s)) << rig.log();
    rig.kill();
    Rig fresh(w.machine, w.plant, &first);
    const Went now = until_rest(fresh, kind);
    expect_rest(now, kind, fresh);
    expect_operational(now, fresh);
  }
}

// ---- 1017h ----

TEST(BadIdentity, OneThatResetsWhen1017hIsWrittenIsNotWrittenAgainAndAgain) {
  using Resets = plant::ResetsAtHeartbeat;
  for (const Resets resets : {Resets::keeps, Resets::forgets, Resets::silent}) {
    for (const auto own : {0ms, 1000ms}) {
      SCOPED_TRACE(static_cast<int>(resets));
      SCOPED_TRACE(own.count());
      each_kind(
          kinds(),
          [&](plant::PlantDevice& d) {
            d.does.odd.resets = resets;
            d.heartbeat = own;
          },
          [&](const Went& now, Rig& rig) {
            expect_operational(now, rig);
            // Twice, each time with the repetitions of a question that has no answer.
            EXPECT_LE(now.writes, resets == Resets::silent ? 8U : 2U) << rig.log();
            const auto told = now.times("resets itself") + now.times("booted after 1017h was written");
            EXPECT_TRUE(now.writes == 0 || told > 0) << rig.log();
            EXPECT_LE(told, 1U) << rig.log();
          });
    }
  }
}

TEST(BadIdentity, OneThatForgets1017hIsWatchedByWhatItHas) {
  for (const auto own : {0ms, 1000ms}) {
    World w = world_of({.name = "blank"});
    auto& d = w.plant.devices.back();
    d.does.odd.resets = plant::ResetsAtHeartbeat::forgets;
    d.heartbeat = own;
    Rig rig(w.machine, w.plant);
    rig.begin();
    rig.run_for(30s);
    ASSERT_TRUE(rig.operational()) << rig.log();
    const char* const how = own == 0ms ? "it is watched by guarding" : "it comes every 1000 ms, as the device has it";
    EXPECT_NE(rig.log().find(how), std::string::npos) << rig.log();
    rig.device("odd").unplug();
    EXPECT_TRUE(rig.run_until([&] { return !rig.operational(); }, 20s)) << "it is watched\n" << rig.log();
  }
}

// The restart comes in the middle of the writing.
TEST(BadIdentity, OneThatResetsWhen1017hIsWrittenIsConfiguredAllTheSame) {
  using Resets = plant::ResetsAtHeartbeat;
  for (const Resets resets : {Resets::keeps, Resets::forgets, Resets::silent}) {
    SCOPED_TRACE(static_cast<int>(resets));
    const Kind kind{.name = "pump"};
    World w{one_bus(kind.bit_rate), one_bus_plant(1)};
    add_slot(w.machine, 1, type_a);
    add_device(w.plant, "d1", type_a, 1);
    add_slot(w.machine, odd_id, type_pump);
    w.machine.slots.back().spec.config = example_eds("pump.dcf");
    add_device(w.plant, "odd", type_pump, 77).does.odd.resets = resets;
    Rig rig(w.machine, w.plant);
    for (const bool again : {false, true}) {
      SCOPED_TRACE(again);
      const Went now = until_rest(rig, kind);
      EXPECT_EQ(now.late, 0U) << rig.log();
      expect_operational(now, rig);
      constexpr ObjectRef limit{0x2000, 1};  // 500 in pump.dcf
      EXPECT_EQ(rig.device("odd").device().values().get_or<std::uint32_t>(limit, 0), 500U) << rig.log();
      rig.kill();
      rig.run_for(1s);
    }
  }
}

TEST(BadIdentity, AHeartbeatThatComesAtAnotherPeriodThanWasWritten) {
  for (const auto sent : {100ms, 2000ms, 10'000ms}) {
    SCOPED_TRACE(sent.count());
    each_kind(
        kinds(), [&](plant::PlantDevice& d) { d.does.odd.heartbeat_sent = sent; },
        [&](const Went& now, Rig& rig) {
          expect_operational(now, rig);
          // A new run hears a device that beats too seldom for it, and learns how often from its first heartbeats.
          EXPECT_LE(now.times("absent"), now.again ? 2U : 0U) << rig.log();
          EXPECT_FALSE(now.says("second device")) << rig.log();
          EXPECT_LE(now.times("its heartbeat comes every"), 1U) << rig.log();
          // At 10 kbit/s 1017h is to be as long as the shorter ones.
          const bool usual = rig.world().bus("backbone")->bit_rate() > 50'000;
          if (!usual) return;
          const auto told = now.period();
          EXPECT_LT(std::chrono::abs(told - sent), sent / 8) << told.count() << rig.log();
        });
  }
}

TEST(BadIdentity, OneThatBeatsAtAnotherPeriodIsMissed) {
  for (const auto sent : {100ms, 2000ms, 10'000ms}) {
    World w = world_of({.name = "blank"});
    w.plant.devices.back().does.odd.heartbeat_sent = sent;
    Rig rig(w.machine, w.plant);
    rig.begin();
    rig.run_for(60s);
    ASSERT_TRUE(rig.operational()) << rig.log();
    rig.device("odd").unplug();
    EXPECT_TRUE(rig.run_until([&] { return !rig.operational(); }, 4 * sent + 2s)) << sent.count() << rig.log();
    rig.device("odd").plug();
    EXPECT_TRUE(rig.run_until([&] { return rig.operational(); }, 4 * sent + 20s)) << sent.count() << rig.log();
  }
}

// ---- two at one node-ID ----

namespace {

void add_second(World& w) {
  auto& first = w.plant.devices.back();
  first.source = plant::NodeIdSource::switches;
  first.node_id = NodeId(odd_id);
  auto second = first;
  second.name = "second";
  w.plant.devices.push_back(second);
}

}  // namespace

TEST(BadIdentity, TwoEqualOnesAtOneNodeIdAreNamedAndTheBusRests) {
  for (Kind kind : kinds()) {
    SCOPED_TRACE(kind.name);
    // There both answer at one instant now and then, as one device: it is bound in vain every few minutes.
    if (kind.bit_rate < 50'000 && !kind.fixed) continue;
    kind.serial = 0;
    World w = world_of(kind);
    add_second(w);
    Rig rig(w.machine, w.plant);
    for (const bool again : {false, true}) {
      SCOPED_TRACE(again);
      const Went now = until_rest(rig, kind, 300s);
      // About as many frames as an empty slot (test_operate:AtRest.*); more where LSS finds the two again and again.
      expect_rest(now, kind, rig, {.frames = kind.fixed ? 15.0 : 20.0, .late = 0});
      EXPECT_EQ(now.odd.state, SlotState::duplicate) << rig.log();
      const bool named = now.odd.reason.find("two devices answer under this node-ID; take one") != std::string::npos;
      EXPECT_TRUE(named) << now.odd.reason;
      EXPECT_NE(rig.device("odd").truth().state, NmtState::operational) << rig.log();
      EXPECT_NE(rig.device("second").truth().state, NmtState::operational) << rig.log();
      rig.kill();
      rig.run_for(1s);
    }
    rig.begin();
    rig.run_for(5s);
    rig.device("second").unplug();
    EXPECT_TRUE(rig.until_operational(90s)) << "the other one works\n" << rig.log();
  }
}

}  // namespace bad_identity_tests
