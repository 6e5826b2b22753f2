// Configuration before start: from a DCF to an operational device, and what goes wrong on the way.
#include <gtest/gtest.h>
#include <unistd.h>
#include <algorithm>
#include <chrono>
#include <cstdint>
#include <optional>
#include <string>

#include <filesystem>
#include <fstream>
#include <sstream>

#include "../paths.hpp"
#include "berth/harness/config_watch.hpp"
#include "tests/harness/rig.hpp"

using namespace berth;
using namespace berth::harness;
using places::Configured;
using places::SlotState;

namespace {

constexpr TypeCode pump{0x00000001, 0x00000030};

std::string example(const std::string& name) { return berth::test::source_dir() + "/examples/eds/" + name; }

// Files made from the example's, each by replacing text.
class Files {
 public:
  Files() {
    std::string pattern = (std::filesystem::temp_directory_path() / "berth-configure-XXXXXX").string();
    folder_ = ::mkdtemp(pattern.data());
  }
  ~Files() { std::filesystem::remove_all(folder_); }
  Files(const Files&) = delete;
  Files& operator=(const Files&) = delete;

  std::string make(const std::string& name, const std::string& from,
                   std::initializer_list<std::pair<std::string, std::string>> changes) {
    std::ifstream in(example(from));
    std::stringstream text;
    text << in.rdbuf();
    std::string all = text.str();
    for (const auto& [what, by] : changes) {
      const auto at = all.find(what);
      EXPECT_NE(at, std::string::npos) << what;
      if (at != std::string::npos) all.replace(at, what.size(), by);
    }
    const auto path = (folder_ / name).string();
    std::ofstream(path) << all;
    return path;
  }

 private:
  std::filesystem::path folder_;
};

design::Machine pumps(std::initializer_list<unsigned> ids, const std::string& config = example("pump.dcf")) {
  design::Machine m = one_bus(125'000);
  m.buses.front().timing.save_timeout = 2s;
  for (const unsigned id : ids) {
    add_slot(m, id, pump);
    m.slots.back().spec.config = config;
    m.slots.back().spec.when_ambiguous = places::WhenAmbiguous::ascending;
  }
  return m;
}

plant::PlantDevice& add_pump(plant::PlantFile& p, const std::string& name, std::uint32_t serial,
                             const std::string& eds = example("pump.eds")) {
  auto& d = add_device(p, name, pump, serial);
  d.eds = "pump.eds";
  d.eds_path = eds;
  d.storing.time = 100ms;
  return d;
}

plant::PlantFile plant_of(std::uint32_t count) {
  auto p = one_bus_plant(1);
  for (std::uint32_t i = 1; i <= count; ++i) add_pump(p, "p" + std::to_string(i), i);
  return p;
}

const od::Values& values(Rig& rig, const std::string& name) { return rig.device(name).device().values(); }

// As pump.dcf has it, for a node.
void expect_configured(Rig& rig, const std::string& name, unsigned node) {
  const auto& v = values(rig, name);
  EXPECT_EQ(v.get_or<std::uint32_t>({0x2000, 1}, 0), 500U) << name;
  EXPECT_EQ(v.get_or<std::uint32_t>({0x2000, 2}, 0), 20U) << name;
  EXPECT_EQ(v.get_text({0x2001, 0}), "cooling water") << name;
  EXPECT_EQ(v.get_or<std::uint32_t>({0x1800, 1}, 0), 0x280U + node) << name;
  EXPECT_EQ(v.get_or<std::uint32_t>({0x1800, 2}, 0), 254U) << name;
  EXPECT_EQ(v.get_or<std::uint32_t>({0x1A00, 0}, 0), 2U) << name;
  EXPECT_EQ(v.get_or<std::uint32_t>({0x1A00, 1}, 0), 0x21000210U) << name;
  EXPECT_EQ(v.get_or<std::uint32_t>({0x1A00, 2}, 0), 0x21000110U) << name;
  EXPECT_EQ(v.get_or<std::uint32_t>({0x1016, 1}, 0), 0x007F05DCU) << name;
  EXPECT_EQ(v.get_or<std::uint32_t>({0x1017, 0}, 0), 500U) << name << ": heartbeat_period of the machine";
  EXPECT_NE(v.get_or<std::uint32_t>({0x1020, 1}, 0), 0U) << name;
  EXPECT_NE(v.get_or<std::uint32_t>({0x1020, 2}, 0), 0U) << name;
}

std::string reason(Rig& rig, unsigned id) {
  for (const auto& s : rig.network().report()) {
    if (s.id.value() == id) return s.reason;
  }
  return {};
}

const operate::BusStatistics::Tally& tally(Rig& rig, unsigned id) {
  return statistics_of(rig.network()).tallies.at(id);
}

std::optional<Configured> record(Rig& rig, unsigned id) {
  const auto records = rig.store().load("rig");
  for (const auto& r : *records) {
    if (r.confirmed && r.confirmed->id.value() == id) return r.configured;
  }
  return std::nullopt;
}

// What Berth does to one device, in order: saving, NMT start, writes of objects.
struct Watch final : can::Tap {
  explicit Watch(Rig& rig, unsigned id) : rig_(rig), id_(id) { rig.world().bus("backbone")->add_tap(*this); }
  ~Watch() { rig_.world().bus("backbone")->remove_tap(*this); }
  void frame(const can::Frame& f, rt::Time, int) noexcept override {
    const bool request = f.id == 0x600U + id_ && f.size == 8;
    const unsigned index = f.data[1] | f.data[2] << 8U;
    if (request && (f.data[0] & 0xE0U) == 0x20) {
      ++writes;
      if (index == 0x1010) ++savings;
      if (index == 0x1011) ++restorings;
    }
    if (request && f.data[0] == 0x40 && index == 0x1017) ++heartbeat_reads;
    const bool start = f.id == 0 && f.size == 2 && f.data[0] == 1 && (f.data[1] == id_ || f.data[1] == 0);
    if (start && starts++ == 0) savings_before_start = savings;
  }
  unsigned writes = 0;
  unsigned heartbeat_reads = 0;
  unsigned savings = 0;
  unsigned restorings = 0;
  unsigned starts = 0;
  unsigned savings_before_start = 0;

 private:
  Rig& rig_;
  unsigned id_;
};

}  // namespace

// docs/protocols/cia302.md §Boot-up of a slave, steps 7 to 10: compared, downloaded, read back, saved and dated before
// it is started.
TEST(Configuration, B4_FromBlankToConfiguredSavedDatedAndStarted) {
  Rig rig(pumps({5, 6}), plant_of(2));
  const Watch watch(rig, 5);
  rig.begin();
  ASSERT_TRUE(rig.until_operational(30s)) << rig.log();
  expect_configured(rig, "p1", 5);
  expect_configured(rig, "p2", 6);
  EXPECT_EQ(watch.savings, 1U);
  EXPECT_EQ(watch.savings_before_start, 1U) << "saved before it was started";
  ASSERT_TRUE(record(rig, 5));
  EXPECT_EQ(record(rig, 5)->stage, Configured::Stage::done);
  const bool told = std::ranges::any_of(rig.events(), [](const auto& e) {
    return e.kind == operate::EventKind::configured && e.slot == "s5" &&
           e.text.find("dated, saved") != std::string::npos;
  });
  EXPECT_TRUE(told) << rig.log();
  EXPECT_GT(tally(rig, 5).differences, 5U);
  EXPECT_FALSE(tally(rig, 5).differs) << "all was corrected";
  // Saved means: it is there after a power failure.
  rig.device("p1").power(false);
  rig.run_for(100ms);
  rig.device("p1").power(true);
  rig.run_for(200ms);
  EXPECT_EQ(values(rig, "p1").get_or<std::uint32_t>({0x2000, 1}, 0), 500U);
}

// Nothing changed, nothing is downloaded and nothing saved: 1020h says so.
TEST(Configuration, B4_7_TheDateAgreesAtTheNextStart) {
  Rig rig(pumps({5}), plant_of(1));
  rig.begin();
  ASSERT_TRUE(rig.until_operational(30s)) << rig.log();
  rig.kill();
  for (const bool powered : {true, false}) {
    if (!powered) rig.device("p1").power(false);
    rig.run_for(100ms);
    rig.device("p1").power(true);
    rig.device("p1").device().apply(co::NmtCommand::enter_pre_operational);
    const auto writes = rig.device("p1").memory().writes_begun();
    rig.run_for(1s);
    const Watch watch(rig, 5);
    rig.begin();
    ASSERT_TRUE(rig.until_operational(30s)) << rig.log();
    EXPECT_EQ(watch.writes, 0U) << rig.log();
    EXPECT_GE(watch.starts, 1U);
    EXPECT_EQ(rig.device("p1").memory().writes_begun(), writes);
    rig.kill();
  }
}

// Paper 5, figure 4: "configure at each boot". Somebody changed a value, and left the date as it was.
TEST(Configuration, S5_16_EachBootComparesWhateverTheDateIs) {
  for (const auto when : {places::Configure::by_date, places::Configure::each_boot}) {
    auto machine = pumps({5});
    machine.slots.front().spec.configuring.when = when;
    Rig rig(machine, plant_of(1));
    rig.begin();
    ASSERT_TRUE(rig.until_operational(30s)) << rig.log();
    rig.kill();
    const ObjectRef limit{0x2000, 1};
    auto& device = rig.device("p1").device();
    device.apply(co::NmtCommand::enter_pre_operational);
    ASSERT_EQ(device.values().set(limit, std::uint32_t{499}), od::AbortCode::none);
    rig.run_for(1s);
    rig.begin();
    ASSERT_TRUE(rig.until_operational(30s)) << rig.log();
    const bool each = when == places::Configure::each_boot;
    EXPECT_EQ(values(rig, "p1").get_or<std::uint32_t>(limit, 0), each ? 500U : 499U) << rig.log();
  }
}

// The slot's device left while it was being configured; a spare that came with the slot's node-ID is asked who it is
// before it is configured, however near to the next attempt it comes.
TEST(Configuration, ASpareWithTheSlotsNodeIdIsNotConfiguredInItsPlace) {
  for (int i = 0; i < 40; ++i) {
    auto plant = plant_of(1);
    auto& spare = add_pump(plant, "spare", 99);
    spare.plugged = false;
    spare.source = plant::NodeIdSource::nonvolatile;
    spare.node_id = NodeId(5);
    Rig rig(pumps({5}), plant);
    rig.begin();
    ASSERT_TRUE(rig.run_until([&] { return rig.state(5) == SlotState::configuring; }, 30s)) << rig.log();
    rig.device("p1").unplug();
    ASSERT_TRUE(rig.run_until([&] { return rig.state(5) != SlotState::configuring; }, 30s)) << rig.log();
    rig.run_for(1s + i * 100ms);
    rig.device("spare").plug();
    rig.run_for(20s);
    EXPECT_NE(rig.device("spare").truth().state, NmtState::operational) << i << rig.log();
    EXPECT_NE(rig.state(5), SlotState::operational) << i;
  }
}

// The slot's device was identified, and another one's binding takes long; a spare that came with the slot's node-ID
// boots in its place meanwhile. It is asked who it is before anything is done to it.
TEST(Configuration, ASpareThatBootsWhileOthersAreBoundIsNotConfigured) {
  auto machine = pumps({5});
  add_slot(machine, 6, type_b);
  auto plant = plant_of(1);
  auto& slow = add_device(plant, "slow", type_b, 1);
  slow.storing.time = 2s;
  slow.plugged = false;
  auto& spare = add_pump(plant, "spare", 99);
  spare.plugged = false;
  spare.source = plant::NodeIdSource::nonvolatile;
  spare.node_id = NodeId(5);
  Rig rig(machine, plant);
  rig.begin();
  ASSERT_TRUE(rig.run_until([&] { return rig.state(5) == SlotState::operational; }, 30s)) << rig.log();
  rig.kill();
  rig.device("p1").device().apply(co::NmtCommand::enter_pre_operational);
  rig.device("slow").plug();
  rig.run_for(1s);
  const Watch watch(rig, 5);
  rig.begin();
  ASSERT_TRUE(rig.run_until([&] { return rig.state(6) == SlotState::binding; }, 30s)) << rig.log();
  ASSERT_EQ(rig.state(5), SlotState::present) << rig.log();
  rig.device("p1").unplug();
  rig.device("spare").plug();
  ASSERT_TRUE(rig.run_until([&] { return rig.state(6) == SlotState::operational; }, 30s)) << rig.log();
  rig.run_for(20s);
  EXPECT_EQ(watch.savings, 0U) << rig.log();
  EXPECT_EQ(watch.starts, 0U) << rig.log();
  EXPECT_EQ(record(rig, 5)->device.address.serial, 1U);
}

// The same, and the slot's device was to get its factory settings: the spare keeps its own.
TEST(Configuration, ASpareThatBootsWhileOthersAreBoundIsNotRestored) {
  auto machine = pumps({5});
  add_slot(machine, 6, type_b);
  auto plant = plant_of(1);
  auto& slow = add_device(plant, "slow", type_b, 1);
  slow.storing.time = 2s;
  slow.plugged = false;
  auto& spare = add_pump(plant, "spare", 99);
  spare.plugged = false;
  spare.source = plant::NodeIdSource::nonvolatile;
  spare.node_id = NodeId(5);
  Rig rig(machine, plant);
  rig.begin();
  ASSERT_TRUE(rig.run_until([&] { return rig.state(5) == SlotState::operational; }, 30s)) << rig.log();
  rig.kill();
  rig.device("p1").device().apply(co::NmtCommand::enter_pre_operational);
  rig.device("slow").plug();
  rig.run_for(1s);
  const places::BusDevice sits{record(rig, 5)->device, {"rig", "backbone"}};
  ASSERT_TRUE(rig.store().mark(places::Mark::restore, sits, NodeId(5), "a person said so"));
  const Watch watch(rig, 5);
  rig.begin();
  ASSERT_TRUE(rig.run_until([&] { return rig.state(6) == SlotState::binding; }, 30s)) << rig.log();
  ASSERT_EQ(rig.state(5), SlotState::present) << rig.log();
  rig.device("p1").unplug();
  rig.device("spare").plug();
  ASSERT_TRUE(rig.run_until([&] { return rig.state(6) == SlotState::operational; }, 30s)) << rig.log();
  rig.run_for(20s);
  EXPECT_EQ(watch.restorings, 0U) << rig.log();
  EXPECT_EQ(watch.starts, 0U) << rig.log();
}

// It leaves when it is asked for its heartbeat, before anything else of its configuration; the spare hears the repeated
// question.
TEST(Configuration, ASpareThatBootsBeforeTheComparingIsNotConfigured) {
  auto plant = plant_of(1);
  auto& spare = add_pump(plant, "spare", 99);
  spare.plugged = false;
  spare.source = plant::NodeIdSource::nonvolatile;
  spare.node_id = NodeId(5);
  Rig rig(pumps({5}), plant);
  rig.begin();
  ASSERT_TRUE(rig.until_operational(30s)) << rig.log();
  rig.kill();
  rig.device("p1").device().apply(co::NmtCommand::enter_pre_operational);
  rig.run_for(1s);
  const Watch watch(rig, 5);
  rig.begin();
  ASSERT_TRUE(rig.run_until([&] { return watch.heartbeat_reads == 1; }, 30s)) << rig.log();
  rig.device("p1").unplug();
  rig.device("spare").plug();
  ASSERT_TRUE(rig.run_until([&] { return watch.heartbeat_reads == 2; }, 10s)) << "the spare hears it" << rig.log();
  rig.run_for(20s);
  EXPECT_EQ(watch.savings, 0U) << rig.log();
  EXPECT_EQ(watch.starts, 0U) << rig.log();
  EXPECT_EQ(values(rig, "spare").get_or<std::uint32_t>({0x2000, 1}, 0), 100U) << rig.log();
}

// It leaves while its heartbeat is set, and the spare hears the repeated request.
TEST(Configuration, ASpareThatBootsWhileTheHeartbeatIsSetIsNotStarted) {
  design::Machine machine = one_bus(125'000);
  add_slot(machine, 5, type_b);
  auto plant = one_bus_plant(1);
  add_device(plant, "own", type_b, 1);
  auto& spare = add_device(plant, "spare", type_b, 99);
  spare.plugged = false;
  spare.source = plant::NodeIdSource::nonvolatile;
  spare.node_id = NodeId(5);
  Rig rig(machine, plant);
  rig.begin();
  ASSERT_TRUE(rig.until_operational(30s)) << rig.log();
  rig.kill();
  rig.device("own").device().apply(co::NmtCommand::enter_pre_operational);
  rig.run_for(1s);
  const Watch watch(rig, 5);
  rig.begin();
  ASSERT_TRUE(rig.run_until([&] { return watch.writes == 1; }, 30s)) << rig.log();
  rig.device("own").unplug();
  rig.device("spare").plug();
  ASSERT_TRUE(rig.run_until([&] { return rig.state(5) == SlotState::absent; }, 10s)) << rig.log();
  EXPECT_EQ(watch.writes, 2U) << "the spare heard it: else this shows nothing";
  EXPECT_EQ(watch.starts, 0U) << rig.log();
}

// A replacement is put to work without a technician, with the configuration of the one before.
TEST(Configuration, AReplacementGetsTheConfiguration) {
  auto machine = pumps({5});
  machine.slots.front().spec.replacement = places::Replacement::automatic;
  auto plant = plant_of(1);
  add_pump(plant, "spare", 99).plugged = false;
  Rig rig(machine, plant);
  rig.begin();
  ASSERT_TRUE(rig.until_operational(30s)) << rig.log();
  rig.device("p1").unplug();
  rig.device("spare").plug();
  ASSERT_TRUE(rig.run_until([&] { return !rig.network().operational(); }, 10s));
  ASSERT_TRUE(rig.until_operational(60s)) << rig.log();
  expect_configured(rig, "spare", 5);
  EXPECT_EQ(record(rig, 5)->device.address.serial, 99U);
}

// S5.19: no memory for it: configured at every start.
TEST(Configuration, S5_19_ADeviceThatCannotSaveIsConfiguredAtEveryPowerOn) {
  Files files;
  const auto without = {std::pair<std::string, std::string>{"1=0x1008", "1=0x1008\n;"},
                        std::pair<std::string, std::string>{"[1010]", "[Gone]"},
                        std::pair<std::string, std::string>{"[1010sub0]", "[Gone0]"},
                        std::pair<std::string, std::string>{"[1010sub1]", "[Gone1]"},
                        std::pair<std::string, std::string>{"=0x1010\n", "=0x1008\n"}};
  const auto eds = files.make("pump.eds", "pump.eds", without);
  auto plant = one_bus_plant(1);
  add_pump(plant, "p1", 1, eds);
  Rig rig(pumps({5}), plant);
  rig.begin();
  for (int start = 0; start < 3; ++start) {
    ASSERT_TRUE(rig.until_operational(30s)) << rig.log();
    expect_configured(rig, "p1", 5);
    rig.device("p1").power(false);
    rig.run_for(300ms);
    rig.device("p1").power(true);
    ASSERT_TRUE(rig.run_until([&] { return !rig.network().operational(); }, 10s));
  }
}

// A refusal stops that node only, and names object, abort code in words, and the line of the DCF.
TEST(Configuration, HU_20_ARefusalStopsThatNodeOnlyAndIsNamed) {
  Files files;
  auto machine = pumps({5, 6});
  machine.slots[0].spec.config = files.make("bad.dcf", "pump.dcf", {{"ParameterValue=500", "ParameterValue=1500"}});
  Rig rig(machine, plant_of(2));
  rig.begin();
  ASSERT_TRUE(rig.run_until([&] { return rig.state(6) == SlotState::operational; }, 30s)) << rig.log();
  rig.run_for(20s);
  EXPECT_EQ(rig.state(5), SlotState::failed) << rig.log();
  EXPECT_EQ(rig.state(6), SlotState::operational) << rig.log();
  EXPECT_EQ(values(rig, "p1").node_id(), NodeId(5));
  EXPECT_EQ(rig.device("p1").truth().state, NmtState::pre_operational);
  const auto why = reason(rig, 5);
  EXPECT_NE(why.find("2000h:01"), std::string::npos) << why;
  EXPECT_NE(why.find("Upper pressure limit"), std::string::npos) << why;
  EXPECT_NE(why.find("0609 0031h"), std::string::npos) << why;
  EXPECT_NE(why.find(od::text(od::AbortCode::value_too_high)), std::string::npos) << why;
  EXPECT_NE(why.find("bad.dcf:"), std::string::npos) << why;
  // It is not tried again and again, as nothing of it would pass by itself ...
  const auto tried = [&] {
    return std::ranges::count_if(
        rig.events(), [](const auto& e) { return e.slot == "s5" && e.text.find("comparing") != std::string::npos; });
  };
  EXPECT_EQ(tried(), 1) << rig.log();
  // ... but when it boots.
  rig.device("p1").reset();
  rig.run_for(5s);
  EXPECT_EQ(tried(), 2) << rig.log();
}

TEST(Configuration, AReadOnlyDifferenceStopsTheNode) {
  Files files;
  auto machine = pumps({5});
  machine.slots[0].spec.config = files.make(
      "bad.dcf", "pump.dcf", {{"DefaultValue=Berth pump\n", "DefaultValue=Berth pump\nParameterValue=Other pump\n"}});
  Rig rig(machine, plant_of(1));
  rig.begin();
  ASSERT_TRUE(rig.run_until([&] { return rig.state(5) == SlotState::failed; }, 30s)) << rig.log();
  EXPECT_NE(reason(rig, 5).find("cannot be written"), std::string::npos) << reason(rig, 5);
  EXPECT_NE(reason(rig, 5).find("Other pump"), std::string::npos) << reason(rig, 5);
  EXPECT_TRUE(tally(rig, 5).differs);
}

// The state of that name, over a restart of Berth, until the power cycle.
TEST(Configuration, APowerCycleIsWaitedForOverARestart) {
  for (const bool while_away : {false, true}) {
    auto machine = pumps({5});
    machine.slots.front().spec.configuring.activate = places::Activate::power_cycle;
    Rig rig(machine, plant_of(1));
    const Watch watch(rig, 5);
    rig.begin();
    const auto waits = [&] { return rig.state(5) == SlotState::power_cycle; };
    ASSERT_TRUE(rig.run_until(waits, 30s)) << rig.log();
    EXPECT_NE(reason(rig, 5).find("switch the device off and on"), std::string::npos) << reason(rig, 5);
    EXPECT_EQ(record(rig, 5)->stage, Configured::Stage::power_cycle);
    rig.run_for(30s);
    EXPECT_TRUE(waits()) << rig.log();
    rig.kill();
    rig.begin();
    rig.run_for(20s);
    EXPECT_TRUE(waits()) << rig.log();
    EXPECT_EQ(watch.starts, 0U);
    if (while_away) rig.kill();
    rig.device("p1").power(false);
    rig.run_for(2s);
    rig.device("p1").power(true);
    rig.run_for(1s);
    if (while_away) rig.begin();
    ASSERT_TRUE(rig.until_operational(30s)) << rig.log();
    expect_configured(rig, "p1", 5);
    EXPECT_EQ(record(rig, 5)->stage, Configured::Stage::done);
    EXPECT_EQ(watch.savings, 1U) << "verified, not done again";
  }
}

// HU.18: the boot-up message after the reset is missed; nothing hangs.
TEST(Configuration, HU_18_AMissedBootUpMessageAfterTheResetDoesNotHang) {
  for (const bool missed : {false, true}) {
    auto machine = pumps({5});
    machine.slots.front().spec.configuring.activate = places::Activate::reset;
    machine.buses.front().timing.boot_timeout = 3s;
    Rig rig(machine, plant_of(1));
    rig.begin();
    ASSERT_TRUE(rig.run_until([&] { return rig.state(5) == SlotState::configuring; }, 30s)) << rig.log();
    if (missed) {
      plant::PlantEvent e;
      e.action = plant::Action::overrun;
      e.bus = "backbone";
      e.nodes = {std::string(plant::master_name)};
      e.strike.id = 0x705;
      ASSERT_TRUE(rig.world().perform(e));
    }
    ASSERT_TRUE(rig.until_operational(30s)) << rig.log();
    expect_configured(rig, "p1", 5);
  }
}

// HU.18: the first boot-up message under the new node-ID is missed.
TEST(Configuration, HU_18_AMissedBootUpMessageDoesNotHangTheStart) {
  Rig rig(pumps({5}), plant_of(1));
  rig.begin();
  plant::PlantEvent e;
  e.action = plant::Action::overrun;
  e.bus = "backbone";
  e.nodes = {std::string(plant::master_name)};
  e.strike.id = 0x705;
  ASSERT_TRUE(rig.world().perform(e));
  ASSERT_TRUE(rig.until_operational(60s)) << rig.log();
  expect_configured(rig, "p1", 5);
}

// HU.19: time-outs are options, and long enough by default: a device that takes 400 ms for each answer and 8 s to save.
TEST(Configuration, HU_19_TimeOutsAreOptionsAndLongEnoughByDefault) {
  auto machine = pumps({5});
  machine.buses.front().timing = design::Timing{};
  auto plant = plant_of(1);
  plant.devices[0].storing.time = 1s;
  Rig rig(machine, plant);
  rig.begin();
  ASSERT_TRUE(rig.run_until([&] { return rig.state(5) == SlotState::configuring; }, 30s)) << rig.log();
  rig.device("p1").slow(400ms, 0ms);
  ASSERT_TRUE(rig.until_operational(120s)) << rig.log();
  expect_configured(rig, "p1", 5);
  EXPECT_TRUE(std::ranges::none_of(rig.events(), [](const auto& e) { return e.kind == operate::EventKind::duplicate; }))
      << rig.log();
}

// A saving that is answered after its time-out is not repeated.
TEST(Configuration, ALateAnswerToTheSavingCounts) {
  auto machine = pumps({5});
  machine.buses.front().timing.save_timeout = 60ms;
  auto plant = plant_of(1);
  plant.devices[0].storing.time = 40ms;  // twice: the values, and what says that they are whole
  Rig rig(machine, plant);
  const Watch watch(rig, 5);
  rig.begin();
  ASSERT_TRUE(rig.until_operational(60s)) << rig.log();
  expect_configured(rig, "p1", 5);
  EXPECT_EQ(watch.savings, 1U) << rig.log();
}

// Its answer never comes: it is reset, and what it then has tells whether it saved. Here it had.
TEST(Configuration, ASavingWithoutAnAnswerIsVerifiedByAReset) {
  auto machine = pumps({5});
  machine.buses.front().timing.save_timeout = 500ms;
  Rig rig(machine, plant_of(1));
  const Watch watch(rig, 5);
  rig.begin();
  const auto saving = [&] { return watch.savings == 1; };
  ASSERT_TRUE(rig.run_until(saving, 30s)) << rig.log();
  plant::PlantEvent e;
  e.action = plant::Action::overrun;
  e.bus = "backbone";
  e.nodes = {std::string(plant::master_name)};
  e.strike.id = 0x585;
  ASSERT_TRUE(rig.world().perform(e));
  ASSERT_TRUE(rig.until_operational(60s)) << rig.log();
  expect_configured(rig, "p1", 5);
  EXPECT_EQ(watch.savings, 1U) << "not repeated blindly";
}

// HU.20, HU.21: the device goes in the middle; what is said names the object; it comes back and is configured.
TEST(Configuration, HU_21_ADeviceThatGoesInTheMiddleIsNamedAndConfiguredWhenItComesBack) {
  for (const auto after : {1ms, 20ms, 60ms, 120ms, 250ms}) {
    Rig rig(pumps({5}), plant_of(1));
    rig.begin();
    ASSERT_TRUE(rig.run_until([&] { return rig.state(5) == SlotState::configuring; }, 30s)) << rig.log();
    rig.run_for(after);
    const bool done = rig.state(5) == SlotState::operational;
    rig.device("p1").power(false);
    if (!done) {
      ASSERT_TRUE(rig.run_until([&] { return rig.state(5) == SlotState::failed; }, 30s)) << rig.log();
      const auto why = reason(rig, 5);
      EXPECT_NE(why.find("node 5"), std::string::npos) << why;
      EXPECT_NE(why.find("h:0"), std::string::npos) << why;
    }
    rig.run_for(1s);
    rig.device("p1").power(true);
    ASSERT_TRUE(rig.until_operational(60s)) << after.count() << "\n" << rig.log();
    expect_configured(rig, "p1", 5);
  }
}

// Its memory has lost the node-ID when it boots: it is bound anew, and configured.
TEST(Configuration, ADeviceThatLosesItsNodeIdHalfWayIsBoundAndConfiguredAgain) {
  for (const auto after : {1ms, 20ms, 60ms, 120ms, 250ms}) {
    SCOPED_TRACE(after.count());
    Rig rig(pumps({5}), plant_of(1));
    rig.begin();
    ASSERT_TRUE(rig.run_until([&] { return rig.state(5) == SlotState::configuring; }, 30s)) << rig.log();
    rig.run_for(after);
    auto& device = rig.device("p1");
    device.power(false);
    device.next_power_on().node_id = NodeId();
    device.power(true);
    rig.run_for(300ms);
    ASSERT_FALSE(device.truth().active.configured());
    ASSERT_TRUE(rig.until_operational(60s)) << rig.log();
    expect_configured(rig, "p1", 5);
    EXPECT_EQ(device.truth().persistent, NodeId(5));
  }
}

// One beats no heart yet and is deaf while its values are compared. What failed is tried again, also where the bus has
// devices that each look finds anew and each search ends with: two of one address.
TEST(Configuration, WhatFailedIsTriedAgainBesideASearchThatNeverEnds) {
  auto machine = pumps({6});
  auto& timing = machine.buses.front().timing;
  timing.probe_period = 400ms;
  timing.sdo_timeout = 200ms;
  add_slot(machine, 7, type_b);
  auto p = plant_of(1);
  for (const char* name : {"a", "clone"}) {
    auto& d = add_device(p, name, type_b, 0);
    d.speaks = {plant::Speaks::lss, plant::Speaks::fastscan};
    d.source = plant::NodeIdSource::nonvolatile;
    d.node_id = NodeId(13);
  }
  auto& pump = p.devices.front();
  pump.plugged = false;
  pump.lss.habit = plant::Habit::lely;
  pump.speaks = {plant::Speaks::lss, plant::Speaks::fastscan};
  Rig rig(machine, p);
  rig.begin();
  ASSERT_TRUE(rig.run_until([&] { return rig.state(7) == SlotState::duplicate; }, 30s)) << rig.log();
  rig.device("p1").plug();
  ASSERT_TRUE(rig.run_until([&] { return rig.state(6) == SlotState::configuring; }, 30s)) << rig.log();
  rig.device("p1").deaf(1s);
  ASSERT_TRUE(rig.run_until([&] { return rig.state(6) == SlotState::failed; }, 30s)) << rig.log();
  const auto eight_periods_and_a_look = 8 * timing.probe_period + 500ms;
  EXPECT_TRUE(rig.run_until([&] { return rig.state(6) != SlotState::failed; }, eight_periods_and_a_look)) << rig.log();
  EXPECT_TRUE(rig.run_until([&] { return rig.state(6) == SlotState::operational; }, 60s)) << rig.log();
  expect_configured(rig, "p1", 6);
}

// Berth dies at any moment of the configuration; the next one ends with a device that has all of it, saved.
TEST(Configuration, BerthDiesInTheMiddle) {
  for (int after = 0; after < 400; after += 7) {
    Rig rig(pumps({5}), plant_of(1));
    rig.begin();
    ASSERT_TRUE(rig.run_until([&] { return rig.state(5) == SlotState::configuring; }, 30s)) << rig.log();
    rig.run_for(std::chrono::milliseconds(after));
    rig.kill();
    rig.run_for(50ms);
    rig.begin();
    ASSERT_TRUE(rig.until_operational(60s)) << after << "\n" << rig.log();
    expect_configured(rig, "p1", 5);
    rig.kill();
    rig.device("p1").power(false);
    rig.run_for(50ms);
    rig.device("p1").power(true);
    rig.run_for(200ms);
    EXPECT_EQ(values(rig, "p1").get_or<std::uint32_t>({0x2000, 1}, 0), 500U) << after << ": not saved";
  }
}

// The firmware restarts at any moment: never started with anything but its configuration.
TEST(Configuration, ARestartAtAnyMomentNeverEndsInAWrongStart) {
  for (int after = 0; after < 400; after += 7) {
    Rig rig(pumps({5}), plant_of(1));
    rig.begin();
    ASSERT_TRUE(rig.run_until([&] { return rig.state(5) == SlotState::configuring; }, 30s)) << rig.log();
    rig.run_for(std::chrono::milliseconds(after));
    rig.device("p1").reset();
    const auto wrong = [&] {
      return rig.device("p1").truth().state == NmtState::operational &&
             values(rig, "p1").get_or<std::uint32_t>({0x2000, 1}, 0) != 500;
    };
    EXPECT_FALSE(rig.run_until(wrong, 3s)) << after << "\n" << rig.log();
    ASSERT_TRUE(rig.until_operational(60s)) << after << "\n" << rig.log();
    expect_configured(rig, "p1", 5);
  }
}

// A commissioner configures, and starts nobody.
TEST(Configuration, ACommissionerConfiguresAndStartsNobody) {
  auto machine = pumps({5});
  machine.buses.front().role = design::Role::commissioner;
  Rig rig(machine, plant_of(1));
  const Watch watch(rig, 5);
  rig.begin();
  ASSERT_TRUE(rig.run_until([&] { return record(rig, 5) && record(rig, 5)->stage == Configured::Stage::done; }, 30s))
      << rig.log();
  rig.run_for(5s);
  expect_configured(rig, "p1", 5);
  EXPECT_EQ(watch.starts, 0U);
  EXPECT_EQ(watch.savings, 1U) << rig.log();
}

// HU.20: a device that is too slow for a while is told with its reason, and tried again without anybody's help.
TEST(Configuration, HU_20_WhatPassesIsTriedAgain) {
  Rig rig(pumps({5}), plant_of(1));
  rig.begin();
  ASSERT_TRUE(rig.run_until([&] { return rig.state(5) == SlotState::configuring; }, 30s)) << rig.log();
  rig.device("p1").slow(3s, 6s);
  ASSERT_TRUE(rig.run_until([&] { return rig.state(5) == SlotState::failed; }, 30s)) << rig.log();
  EXPECT_NE(reason(rig, 5).find("answer"), std::string::npos) << reason(rig, 5);
  ASSERT_TRUE(rig.until_operational(60s)) << rig.log();
  expect_configured(rig, "p1", 5);
}

// It would need a restart, and would have lost its configuration by it.
TEST(Configuration, ADeviceThatCannotSaveCannotWaitForAPowerCycle) {
  Files files;
  const auto eds = files.make(
      "pump.eds", "pump.eds",
      {{"[1010]", "[Gone]"}, {"[1010sub0]", "[Gone0]"}, {"[1010sub1]", "[Gone1]"}, {"=0x1010\n", "=0x1008\n"}});
  auto plant = one_bus_plant(1);
  add_pump(plant, "p1", 1, eds);
  for (const auto activate : {places::Activate::reset, places::Activate::power_cycle}) {
    auto machine = pumps({5});
    machine.slots.front().spec.configuring.activate = activate;
    Rig rig(machine, plant);
    rig.begin();
    ASSERT_TRUE(rig.run_until([&] { return rig.state(5) == SlotState::failed; }, 30s)) << rig.log();
    EXPECT_NE(reason(rig, 5).find("cannot save"), std::string::npos) << reason(rig, 5);
  }
}

// A machine that runs is not disturbed; what is not as its file has it is said.
TEST(Configuration, ARunningDeviceIsLeftAloneAndTold) {
  Rig rig(pumps({5}), plant_of(1));
  rig.begin();
  ASSERT_TRUE(rig.until_operational(30s)) << rig.log();
  rig.kill();
  auto& v = rig.device("p1").device().values();
  ASSERT_EQ(v.set({0x2000, 1}, 7U), od::AbortCode::none);
  ASSERT_EQ(v.set({0x1020, 1}, 0U), od::AbortCode::none);
  const Watch watch(rig, 5);
  rig.begin();
  ASSERT_TRUE(rig.until_operational(30s)) << rig.log();
  EXPECT_EQ(watch.writes, 0U);
  EXPECT_EQ(rig.device("p1").truth().state, NmtState::operational);
  const bool told = std::ranges::any_of(rig.events(), [](const auto& e) {
    return e.kind == operate::EventKind::configured &&
           e.text.find("1 of its values differ from pump.dcf") != std::string::npos;
  });
  EXPECT_TRUE(told) << rig.log();
  EXPECT_EQ(tally(rig, 5).differences, 1U);
  EXPECT_TRUE(tally(rig, 5).differs);
}

// A device that restarts whenever it is told to save is not told so for ever: its memory would wear out.
TEST(Configuration, SavingIsGivenUpBeforeAMemoryWearsOut) {
  struct Restarts final : can::Tap {
    explicit Restarts(Rig& r) : rig(r) { rig.world().bus("backbone")->add_tap(*this); }
    ~Restarts() { rig.world().bus("backbone")->remove_tap(*this); }
    void frame(const can::Frame& f, rt::Time, int) noexcept override {
      const bool save = f.id == 0x605 && f.size == 8 && f.data[0] == 0x23 && f.data[1] == 0x10 && f.data[2] == 0x10;
      if (save) rig.world().sim().after(20ms, [this] { rig.device("p1").reset(); });
    }
    Rig& rig;
  };
  Rig rig(pumps({5}), plant_of(1));
  const Restarts restarts(rig);
  const Watch watch(rig, 5);
  rig.begin();
  rig.run_for(120s);
  EXPECT_EQ(rig.state(5), SlotState::failed) << rig.log();
  EXPECT_NE(reason(rig, 5).find("memory"), std::string::npos) << reason(rig, 5);
  EXPECT_GE(watch.savings, 2U);
  EXPECT_LE(watch.savings, 5U) << rig.log();
  EXPECT_EQ(watch.starts, 0U);
}

// The judge of ./run faults can find something: a Berth that knows of no configuration starts a device without it.
TEST(Configuration, TheJudgeOfTheFaultsFindsAWrongStart) {
  const auto with = pumps({5});
  auto without = with;
  without.slots.front().spec.config.clear();
  for (const bool knows : {true, false}) {
    Rig rig(knows ? with : without, plant_of(1));
    const ConfigWatch judge(rig.world(), with, rig.store());
    rig.begin();
    ASSERT_TRUE(rig.until_operational(30s)) << rig.log();
    EXPECT_EQ(judge.failure().empty(), knows) << judge.failure();
  }
}

// A file that went away since the machine file was read stops its slots only.
TEST(Configuration, AFileThatWentAwayStopsItsSlotOnly) {
  auto machine = pumps({5, 6});
  machine.slots[0].spec.config = "/nowhere/pump.dcf";
  Rig rig(machine, plant_of(2));
  rig.begin();
  ASSERT_TRUE(rig.run_until([&] { return rig.state(6) == SlotState::operational; }, 30s)) << rig.log();
  rig.run_for(3s);
  EXPECT_EQ(rig.state(5), SlotState::failed);
  EXPECT_NE(reason(rig, 5).find("/nowhere/pump.dcf"), std::string::npos) << reason(rig, 5);
}
