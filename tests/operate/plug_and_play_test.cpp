// Devices that come while the machine runs (S4.20), and devices that show themselves.
#include <gtest/gtest.h>
#include <algorithm>
#include <cstdint>
#include <map>
#include <optional>
#include <string>
#include <vector>

#include "tests/harness/rig.hpp"

using namespace berth;
using namespace berth::harness;
using device::Leds;
using device::Light;
using places::SlotState;
using plant::Speaks;
using Seats = std::vector<std::pair<unsigned, std::uint32_t>>;

namespace plug_and_play_tests {
namespace {

// What the running devices are told and what they tell, while somebody comes.
class Watch final : public can::Tap {
 public:
  explicit Watch(std::initializer_list<unsigned> ids) : ids_(ids) {}
  void begin() { on_ = true; }
  void end() { on_ = false; }
  [[nodiscard]] rt::Duration longest_gap(unsigned id) const {
    const auto it = gaps_.find(id);
    return it == gaps_.end() ? rt::Duration{0} : it->second;
  }
  std::vector<std::string> commands;  // NMT to one of them, or to all
  std::size_t beats = 0;

 private:
  void frame(const can::Frame& f, rt::Time at, int) noexcept override {
    if (!on_) return;
    if (f.id == 0 && !f.extended && f.size == 2) {
      const unsigned node = f.data[1];
      const bool theirs = node == 0 || std::ranges::find(ids_, node) != ids_.end();
      if (theirs) commands.push_back(can::to_string(f));
    }
    if (f.extended || f.remote || (f.id & 0x780U) != 0x700 || f.size != 1) return;
    const unsigned node = f.id & 0x7FU;
    if (std::ranges::find(ids_, node) == ids_.end()) return;
    ++beats;
    if (heard_.contains(node)) gaps_[node] = std::max(gaps_[node], at - heard_[node]);
    heard_[node] = at;
  }
  std::vector<unsigned> ids_;
  std::map<unsigned, rt::Time> heard_;
  std::map<unsigned, rt::Duration> gaps_;
  bool on_ = false;
};

// Whether a running device was ever put into LSS configuration.
class Undisturbed final : public plant::World::Observer {
 public:
  explicit Undisturbed(std::vector<std::string> names) : names_(std::move(names)) {}
  std::vector<std::string> seen;

 private:
  void plant_changed(const plant::SimDevice& device) noexcept override {
    if (std::ranges::find(names_, device.name()) == names_.end()) return;
    if (device.device().state() != NmtState::operational) seen.push_back(device.name() + " left operational");
  }
  std::vector<std::string> names_;
};

class WhoeverComes : public testing::TestWithParam<Speaks> {};

// S4.20, part 9: a blank device is added, later exchanged; the other four never notice.
TEST_P(WhoeverComes, S4_20_IsFoundBoundAndStartedWithoutDisturbingTheOthers) {
  auto plant = five_slaves();
  for (auto& device : plant.devices) {
    device.speaks = {Speaks::lss};
    device.speaks.add(GetParam());
  }
  plant.devices[2].plugged = false;
  auto spare = plant.devices[2];
  spare.name = "exchange";
  spare.address.serial = 0x99;
  plant.devices.push_back(spare);
  auto machine = five_slots();
  machine.buses.front().bitrate = 125'000;
  machine.slots[2].spec.replacement = places::Replacement::automatic;
  Rig rig(machine, plant);
  rig.begin();
  const auto four = [&] {
    return std::ranges::all_of(std::array{1U, 2U, 4U, 5U},
                               [&](unsigned id) { return rig.state(id) == SlotState::operational; });
  };
  ASSERT_TRUE(rig.run_until(four, 60s)) << rig.log();
  rig.run_for(2s);
  Watch watch{1, 2, 4, 5};
  rig.world().bus("backbone")->add_tap(watch);
  Undisturbed others({"d1", "d2", "d4", "d5"});
  rig.world().add_observer(others);
  bool configuration = false;
  const auto step = [&](const std::function<bool()>& done) {
    return [&, done] {
      for (const char* name : {"d1", "d2", "d4", "d5"})
        configuration = configuration || rig.device(name).device().lss().state() == lss::State::configuration;
      return done();
    };
  };
  watch.begin();
  rig.device("d3").plug();
  const rt::Time plugged = rig.now();
  ASSERT_TRUE(rig.run_until(step([&] { return rig.state(3) == SlotState::operational; }), 30s)) << rig.log();
  EXPECT_LT(rig.now() - plugged, 12s) << "found within a look or the eighth look";
  rig.device("d3").unplug();
  ASSERT_TRUE(rig.run_until(step([&] { return rig.state(3) != SlotState::operational; }), 30s)) << rig.log();
  rig.device("exchange").plug();
  ASSERT_TRUE(rig.run_until(step([&] { return rig.state(3) == SlotState::operational; }), 40s)) << rig.log();
  watch.end();
  EXPECT_EQ(rig.seats(), (Seats{{1, 0x0A}, {2, 5}, {3, 0x99}, {4, 6}, {5, 7}})) << rig.log();
  EXPECT_FALSE(configuration) << "a running device was put into LSS configuration";
  EXPECT_TRUE(watch.commands.empty()) << watch.commands.front();
  EXPECT_TRUE(others.seen.empty()) << others.seen.front();
  EXPECT_GT(watch.beats, 20U);
  // Period 500 ms, and at most a frame or two of waiting for the bus.
  for (const unsigned id : {1U, 2U, 4U, 5U}) EXPECT_LT(watch.longest_gap(id), 505ms) << id;
  rig.world().remove_observer(others);
  rig.world().bus("backbone")->remove_tap(watch);
}

INSTANTIATE_TEST_SUITE_P(Speaks, WhoeverComes,
                         testing::Values(Speaks::rand, Speaks::lss, Speaks::fastscan, Speaks::feedback_29));

// ---- locate ----

rt::Task<void> show(operate::Network& network, LssAddress device, rt::Duration time, bool anyway,
                    std::optional<Result<operate::Network::Located>>& into) {
  into = co_await network.locate(device, time, anyway);
}

constexpr Leds flickers{Light::flickering, Light::flickering};

}  // namespace

// A new device, without a node-ID: it alone flickers, for the time asked for.
TEST(Locate, ANewDeviceShowsItself) {
  auto plant = one_bus_plant(1);
  add_device(plant, "a", type_b, 1);
  add_device(plant, "b", type_b, 2);
  auto machine = one_bus(125'000);
  add_slot(machine, 5, type_c);
  machine.slots.back().spec.optional = true;
  Rig rig(machine, plant);
  rig.begin();
  rig.run_for(3s);
  std::optional<Result<operate::Network::Located>> shown;
  rt::Scope scope(rig.world().executor());
  scope.spawn(show(rig.network(), {type_b.vendor, type_b.product, 0, 2}, 2s, false, shown));
  ASSERT_TRUE(rig.run_until([&] { return rig.device("b").truth().leds == flickers; }, 5s)) << rig.log();
  rig.run_for(1s);
  EXPECT_EQ(rig.device("b").truth().leds, flickers);
  EXPECT_NE(rig.device("a").truth().leds, flickers);
  ASSERT_TRUE(rig.run_until([&] { return shown.has_value(); }, 5s));
  ASSERT_TRUE(*shown);
  EXPECT_FALSE((*shown)->id.configured());
  rig.run_for(50ms);
  EXPECT_NE(rig.device("b").truth().leds, flickers);
}

// A running one is left alone unless the person insists; then it goes on running.
TEST(Locate, ARunningDeviceOnlyAnyway) {
  Rig rig(five_slots(), five_slaves());
  rig.begin();
  ASSERT_TRUE(rig.until_operational(60s)) << rig.log();
  const LssAddress device{type_c.vendor, type_c.product, 0, 8};
  std::optional<Result<operate::Network::Located>> shown;
  rt::Scope scope(rig.world().executor());
  scope.spawn(show(rig.network(), device, 2s, false, shown));
  ASSERT_TRUE(rig.run_until([&] { return shown.has_value(); }, 10s));
  ASSERT_FALSE(*shown);
  EXPECT_EQ(shown->error().code, Errc::invalid);
  rig.run_for(50ms);
  EXPECT_NE(rig.device("d3").truth().leds, flickers);
  shown.reset();
  scope.spawn(show(rig.network(), device, 2s, true, shown));
  ASSERT_TRUE(rig.run_until([&] { return rig.device("d3").truth().leds == flickers; }, 10s));
  EXPECT_EQ(rig.device("d3").truth().state, NmtState::operational);
  ASSERT_TRUE(rig.run_until([&] { return shown.has_value(); }, 10s));
  EXPECT_TRUE(*shown);
  rig.run_for(50ms);
  EXPECT_EQ(rig.device("d3").truth().leds.green, Light::on);
  EXPECT_TRUE(rig.network().operational());
}

// A command that is given up leaves nobody in LSS configuration.
TEST(Locate, GivenUpIsOver) {
  Rig rig(five_slots(), five_slaves());
  rig.begin();
  ASSERT_TRUE(rig.until_operational(60s)) << rig.log();
  std::optional<Result<operate::Network::Located>> shown;
  {
    rt::Scope scope(rig.world().executor());
    scope.spawn(show(rig.network(), {type_c.vendor, type_c.product, 0, 8}, 60s, true, shown));
    ASSERT_TRUE(rig.run_until([&] { return rig.device("d3").truth().leds == flickers; }, 10s));
  }
  rig.run_for(50ms);
  EXPECT_NE(rig.device("d3").truth().leds, flickers);
}

TEST(Locate, NobodyThere) {
  Rig rig(five_slots(), five_slaves());
  rig.begin();
  ASSERT_TRUE(rig.until_operational(60s)) << rig.log();
  std::optional<Result<operate::Network::Located>> shown;
  rt::Scope scope(rig.world().executor());
  scope.spawn(show(rig.network(), {1, 2, 3, 4}, 1s, false, shown));
  ASSERT_TRUE(rig.run_until([&] { return shown.has_value(); }, 10s));
  ASSERT_FALSE(*shown);
  EXPECT_EQ(shown->error().code, Errc::not_found);
}

}  // namespace plug_and_play_tests
