// The coal conveyor of examples/conveyor (paper 5, figure 1): from blank devices to a plant that conveys, by the
// machine file alone. Whether it conveys is for a model to say that shares no code with it (model.hpp).
#include <fmt/format.h>
#include <gtest/gtest.h>
#include <unistd.h>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <deque>
#include <filesystem>
#include <fstream>
#include <map>
#include <optional>
#include <set>
#include <string>
#include <vector>

#include "berth/base/random.hpp"
#include "berth/linker/plan.hpp"
#include "tests/conveyor/conveyor.hpp"
#include "tests/conveyor/model.hpp"
#include "tests/paths.hpp"
#include "tests/worlds/seeds.hpp"

namespace berth::test {
namespace {

using namespace std::chrono_literals;

constexpr rt::Duration look = 50ms;

bool is_variable(const design::Link& link) { return link.type.has_value(); }

/// One end of a link to network variables: what its producer had lately, and what its consumer has.
struct Watched {
  std::string from, from_object, to, to_object;
  double within_s = 0;  ///< the value arrives
  double again_s = 0;   ///< event timer: what was told before its consumer was operational is told again by then
  std::deque<std::pair<double, double>> had{};  ///< of the producer: since when, what
  unsigned changes = 0;                         ///< at the consumer
  std::optional<double> seen{};
};

std::vector<Watched> watched(const design::Machine& machine) {
  std::vector<Watched> all;
  for (const auto& link : machine.links) {
    if (!is_variable(link)) continue;
    for (const auto& to : link.to) {
      Watched one{.from = link.from.slot, .from_object = link.from.object, .to = to.slot, .to_object = to.object};
      const double deadline = std::chrono::duration<double>(*link.deadline).count();
      one.within_s = deadline + std::chrono::duration<double>(look).count();
      one.again_s = 10 * deadline;
      all.push_back(std::move(one));
    }
  }
  return all;
}

/// Looks at both ends, and says how many consumers have a value that their producer has no more, or never had.
void look_at(Conveyor& plant, std::vector<Watched>& all, double operational, std::vector<std::string>& strange) {
  const double now = plant.seconds();
  for (auto& each : all) {
    const auto sent = plant.value(each.from, each.from_object);
    const auto got = plant.value(each.to, each.to_object);
    if (!sent || !got) continue;
    if (each.had.empty() || each.had.back().second != *sent) each.had.emplace_back(now, *sent);
    while (each.had.size() > 1 && each.had[1].first < now - each.within_s) each.had.pop_front();
    if (each.seen && *each.seen != *got) ++each.changes;
    each.seen = got;
    const bool known = std::ranges::any_of(each.had, [&](const auto& value) { return value.second == *got; });
    if (!known && now > operational + each.again_s + each.within_s) {
      strange.push_back(fmt::format("{:.2f} s: {}/{} = {}, {}/{} = {}", now, each.from, each.from_object, *sent,
                                    each.to, each.to_object, *got));
    }
  }
}

/// Coal that left the ship and is neither on a belt nor in the bunker.
double coal_on_the_way(Conveyor& plant) {
  double on_belts = 0;
  for (const auto& belt : belts()) on_belts += plant.value(belt + " belt", "6401h:02").value_or(0);
  // What the unloader has grabbed is what its belt was told, which the controller sends modulo 32768.
  const double grabbed = plant.value("unloader", "2201h:04").value_or(0);
  return grabbed - on_belts - plant.value("bunker", "total").value_or(0);
}

/// Frames of a bus by their CAN-ID.
class FramesById final : private can::Tap {
 public:
  explicit FramesById(sim::Bus& bus) : bus_(bus) { bus.add_tap(*this); }
  ~FramesById() { bus_.remove_tap(*this); }
  FramesById(const FramesById&) = delete;
  FramesById& operator=(const FramesById&) = delete;
  [[nodiscard]] const std::map<std::uint32_t, unsigned>& counts() const noexcept { return counts_; }

 private:
  void frame(const can::Frame& frame, rt::Time, int) noexcept override { ++counts_[frame.key()]; }
  sim::Bus& bus_;
  std::map<std::uint32_t, unsigned> counts_;
};

/// NMT starts of the bus, and devices that left operational, from now on.
class Starts final : private can::Tap {
 public:
  explicit Starts(Conveyor& plant) : plant_(plant), since_(plant.seconds()) { plant.bus().add_tap(*this); }
  ~Starts() { plant_.bus().remove_tap(*this); }
  Starts(const Starts&) = delete;
  Starts& operator=(const Starts&) = delete;
  [[nodiscard]] double since() const noexcept { return since_; }
  [[nodiscard]] unsigned of_any() const noexcept { return any_; }
  /// The device was operational already.
  [[nodiscard]] unsigned of_running() const noexcept { return running_; }
  [[nodiscard]] unsigned left_operational() const noexcept { return left_; }

 private:
  void frame(const can::Frame& frame, rt::Time at, int) noexcept override {
    const bool starts = frame.key() == 0 && frame.size == 2 && frame.data[0] == 1;
    if (starts) ++any_;
    for (const auto& device : plant_.world().devices()) {
      const auto id = device->device().node_id();
      auto& runs = runs_since_[device.get()];
      const bool now = device->powered() && device->device().state() == NmtState::operational;
      const bool meant = starts && id.configured() && (frame.data[1] == 0 || frame.data[1] == id.value());
      if (meant && runs && *runs < at) ++running_;
      if (runs && !now) ++left_;
      if (!now) runs.reset();
      if (now && !runs) runs = at;
    }
  }

  Conveyor& plant_;
  double since_;
  unsigned any_ = 0;
  unsigned running_ = 0;
  unsigned left_ = 0;
  std::map<const plant::SimDevice*, std::optional<rt::Time>> runs_since_;
};

}  // namespace

// examples/conveyor/make makes the files that are there.
TEST(Conveyor, TheFilesAreThoseOfTheirScript) {
  const std::string command = "python3 " + conveyor_file("make") + " --check --berth " + binary();
  EXPECT_EQ(std::system(command.c_str()), 0) << "see above; " << command << " without --check makes them";
}

// S5.3: 11 controllers, 44 modules, more than 1000 data points, 280 network variables, more than 500 PDOs.
TEST(Conveyor, S5_3_IsAsLargeAsThePapersPlant) {
  const Conveyor plant;
  ASSERT_EQ(plant.problem(), "");
  const auto made = traffic::link_network(plant.machine());
  ASSERT_FALSE(has_errors(made.findings));
  Findings findings;
  const auto earlier = traffic::earlier_plan(plant.machine(), findings);
  ASSERT_TRUE(earlier);
  const auto planned = linker::make_plan(made.network, *earlier);
  for (const auto& each : planned.findings) ADD_FAILURE() << to_string(each);

  std::size_t controllers = 0;
  std::size_t points = 0;
  for (const auto& node : made.network.nodes) {
    if (!node.file->dynamic_segments.empty()) {
      ++controllers;
      continue;
    }
    for (const auto& object : node.file->description->objects()) {
      if (object.index < 0x6000) continue;
      for (const auto& sub : node.file->description->subs(object)) {
        const bool digital = sub.type == od::DataType::unsigned8;
        if (sub.mappable) points += digital ? 8 : 1;
      }
    }
  }
  std::set<std::string> variables;
  for (const auto& link : plant.machine().links) {
    if (is_variable(link)) variables.insert(link.from.slot + "/" + link.from.object);
  }
  std::size_t pdos = planned.plan.pdos.size();
  for (const auto& pdo : planned.plan.pdos) pdos += pdo.receivers.size();
  std::printf(
      "%zu data points, %zu network variables (%zu objects), %zu PDOs under %zu CAN-IDs, %.1f %% of the bus at most\n",
      points, variables.size(), planned.plan.variables.size(), pdos, planned.plan.pdos.size(),
      100 * planned.plan.buses.front().load);
  EXPECT_EQ(controllers, 11U);
  EXPECT_EQ(made.network.nodes.size() - controllers, 44U);
  EXPECT_GT(points, 1000U);
  EXPECT_EQ(variables.size(), 280U);
  EXPECT_GT(pdos, 500U);
}

// S5.1: what the running plant puts on the bus, measured: below the plan's bound, and less than with an object a PDO;
// the controllers tell each other what they need, and neither one of them nor Berth carries the plant.
TEST(Conveyor, S5_1_TheLoadOfTheBusAndWhoMakesIt) {
  Conveyor plant;
  ASSERT_TRUE(plant.begin()) << plant.problem();
  ASSERT_TRUE(plant.run_until([&] { return plant.value("unloader", "running").value_or(0) != 0; }, 180s))
      << plant.log();
  const auto made = traffic::link_network(plant.machine());
  Findings findings;
  const auto planned = linker::make_plan(made.network, *traffic::earlier_plan(plant.machine(), findings));
  ASSERT_TRUE(planned.good());
  std::map<std::uint32_t, std::size_t> producer;
  std::set<std::size_t> controllers;
  for (const auto& pdo : planned.plan.pdos) producer[pdo.can_id] = pdo.producer;
  for (std::size_t i = 0; i < made.network.nodes.size(); ++i) {
    if (!made.network.nodes[i].file->dynamic_segments.empty()) controllers.insert(i);
  }
  const FramesById frames(plant.bus());
  plant.bus().reset_statistics();
  plant.run_for(20s);
  const double load = plant.bus().load();
  std::map<std::size_t, unsigned> by_producer;
  unsigned all = 0, pdos = 0;
  for (const auto& [id, count] : frames.counts()) {
    all += count;
    const auto known = producer.find(id);
    if (known == producer.end()) continue;
    pdos += count;
    by_producer[known->second] += count;
  }
  unsigned most = 0;
  for (const auto& [node, count] : by_producer) most = std::max(most, count);
  const auto& bound = planned.plan.buses.front();
  std::printf(
      "%.1f %% of the bus, at most %.1f %% by the plan, of which PDOs %.1f %%, an object a PDO %.1f %%; %u of %u "
      "frames "
      "are PDOs, of %zu senders, the busiest sends %.1f %% of them\n",
      100 * load, 100 * bound.load, 100 * bound.pdos, 100 * bound.one_object_each, pdos, all, by_producer.size(),
      100.0 * most / pdos);
  EXPECT_LT(load, bound.load) << "no more than the plan promises";
  EXPECT_LT(bound.pdos, bound.one_object_each) << "several objects share a PDO";
  for (const std::size_t node : controllers) {
    EXPECT_GT(by_producer[node], 0U) << made.network.nodes[node].name << " tells the others nothing";
  }
  EXPECT_LT(most, pdos / 5) << "one sender makes the load";
  EXPECT_GT(pdos, all - all / 4) << "the rest is heartbeats and what Berth asks";
}

// S5.1, S5.23: from blank to operational by one call; all network variables move and arrive in time; the plant
// does what the model says; what was grabbed lies on the belts or in the bunker.
TEST(Conveyor, S5_1_BlankDevicesBecomeAPlantThatConveys) {
  Conveyor plant;
  ASSERT_TRUE(plant.begin()) << plant.problem();
  ASSERT_TRUE(plant.run_until([&] { return plant.operational(); }, 120s)) << plant.log();
  const double operational = plant.seconds();
  auto variables = watched(plant.machine());
  std::vector<std::string> strange;
  while (plant.value("unloader", "set_speed").value_or(0) == 0) {
    ASSERT_LT(plant.seconds(), operational + 20) << "the start button does nothing\n" << plant.log();
    plant.run_for(look);
    look_at(plant, variables, operational, strange);
  }
  const double pressed = plant.seconds();
  std::printf("operational after %.1f s, started after %.1f s\n", operational, pressed);

  std::vector<double> started(belts().size(), -1);
  CoalModel model;
  double largest = 0;
  double blocked_at = -1;
  bool stood_still = false;
  for (int i = 0; i < 90 * 20; ++i) {
    plant.run_for(look);
    const double now = plant.seconds() - pressed;
    while (model.time() < now) model.step();
    look_at(plant, variables, operational, strange);
    for (std::size_t k = 0; k < belts().size(); ++k) {
      const bool running = plant.value(belts()[k], "running").value_or(0) != 0;
      if (running && started[k] < 0) started[k] = now;
    }
    const double delivered = plant.value("bunker", "total").value_or(0);
    largest = std::max(largest, std::abs(delivered - model.left(CoalModel::belts - 1)));
    const bool blocked = plant.value(belts()[CoalModel::blocks], "state").value_or(0) == 3;
    if (blocked && blocked_at < 0) blocked_at = now;
    // While the chute is being cleared all before it stands and all behind it has run empty.
    if (blocked_at > 0 && !stood_still && now > blocked_at + 7.5) {
      stood_still = true;
      EXPECT_EQ(coal_on_the_way(plant), 0) << "coal was lost or made";
      for (std::size_t k = 0; k < belts().size(); ++k) {
        EXPECT_EQ(plant.value(belts()[k], "running").value_or(0) != 0, k > CoalModel::blocks) << belts()[k];
      }
    }
    const double on_the_way = coal_on_the_way(plant);
    ASSERT_GE(on_the_way, 0) << "coal out of nothing at " << now << " s";
    ASSERT_LE(on_the_way, 2500) << "coal is gone at " << now << " s";
  }
  for (std::size_t k = 0; k < belts().size(); ++k) {
    std::printf("%-10s started %5.2f s, by the model %5.2f s\n", belts()[k].c_str(), started[k],
                model.started(static_cast<unsigned>(k)));
    ASSERT_GT(started[k], 0) << belts()[k];
    EXPECT_NEAR(started[k], model.started(static_cast<unsigned>(k)), 1.0) << belts()[k];
    if (k > 0) {
      EXPECT_GT(started[k - 1], started[k]) << "the chain starts at the bunker";
    }
  }
  std::printf(
      "blocked %.2f s, by the model %.2f s; in the bunker %.0f kg, by the model %.0f kg, at most %.0f kg apart\n",
      blocked_at, model.blocked_at(), plant.value("bunker", "total").value_or(0), model.left(CoalModel::belts - 1),
      largest);
  EXPECT_TRUE(stood_still);
  EXPECT_NEAR(blocked_at, model.blocked_at(), 2.0);
  EXPECT_GT(plant.value("bunker", "total").value_or(0), 2000) << "it conveys again";
  EXPECT_LT(largest, 600);
  EXPECT_TRUE(strange.empty())
      << strange.size() << " late or wrong values, first "
      << fmt::format("{}", fmt::join(strange.begin(),
                                     strange.begin() + std::min<std::ptrdiff_t>(20, std::ssize(strange)), "\n"));
  std::size_t still = 0;
  for (const auto& each : variables) {
    if (each.changes == 0 && ++still < 10) ADD_FAILURE() << each.to << "/" << each.to_object << " never moved";
  }
  EXPECT_EQ(still, 0U) << "of " << variables.size();
  for (const auto& each : plant.told()) ADD_FAILURE() << each;
}

// S5.1: one unit fails, and the plant stays available in part; a spare comes in its place, and all of it works again.
TEST(Conveyor, S5_1_S5_2_AnyDeviceIsReplaced) {
  Conveyor plant;
  ASSERT_TRUE(plant.begin()) << plant.problem();
  ASSERT_TRUE(plant.run_until([&] { return plant.value("unloader", "running").value_or(0) != 0; }, 180s))
      << plant.log();
  for (const std::string slot : {"stacker", "stacker drive", "main belt", "desk"}) {
    auto* const old = plant.at(slot);
    ASSERT_NE(old, nullptr) << slot;
    const auto serial = old->truth().address.serial;
    old->unplug();
    plant.run_for(5s);
    if (slot == "stacker") {
      EXPECT_EQ(plant.value("bunker", "running"), 1.0) << "what comes behind it runs on";
      EXPECT_EQ(plant.value("reclaimer", "running"), 1.0);
    }
    plant.replace(slot);
    const auto is_new = [&] {
      auto* const fresh = plant.at(slot);
      const bool there = fresh != nullptr && fresh->truth().address.serial == serial + 5000 && plant.operational();
      // A new desk waits for its start button.
      return there && (slot == "desk" || plant.value("unloader", "running").value_or(0) != 0);
    };
    EXPECT_TRUE(plant.run_until(is_new, 120s)) << slot << "\n" << plant.log();
    const auto before = plant.value("desk", "b05_beat");
    plant.run_for(1s);
    EXPECT_NE(plant.value("desk", "b05_beat"), before) << slot;
  }
}

// One device after the other dies, and another of its kind comes in its place: each of the 55.
TEST(Conveyor, EachOfThe55IsReplaced) {
  Conveyor plant;
  ASSERT_TRUE(plant.begin()) << plant.problem();
  ASSERT_TRUE(plant.run_until([&] { return plant.operational(); }, 120s)) << plant.log();
  std::size_t replaced = 0;
  for (const auto& place : plant.machine().slots) {
    const std::string slot = place.spec.name.name;
    auto* const old = plant.at(slot);
    ASSERT_NE(old, nullptr) << slot;
    const auto serial = old->truth().address.serial;
    plant.replace(slot);
    const auto is_new = [&] {
      auto* const fresh = plant.at(slot);
      return fresh != nullptr && fresh->truth().address.serial == serial + 5000 && plant.operational() &&
             fresh->device().state() == NmtState::operational;
    };
    ASSERT_TRUE(plant.run_until(is_new, 120s)) << slot << "\n" << plant.log();
    ++replaced;
  }
  EXPECT_EQ(replaced, 55U);
  for (const auto& place : plant.machine().slots) {
    auto* const device = plant.at(place.spec.name.name);
    ASSERT_NE(device, nullptr) << place.spec.name.name;
    EXPECT_EQ(device->device().state(), NmtState::operational) << place.spec.name.name;
  }
  // Every one of them is new, and it conveys.
  EXPECT_TRUE(plant.run_until([&] { return plant.value("unloader", "running").value_or(0) != 0; }, 120s))
      << plant.log();
  EXPECT_TRUE(plant.run_until([&] { return plant.value("bunker", "total").value_or(0) > 0; }, 120s)) << plant.log();
}

// S5.1: the active master dies, and the plant goes on while the standby takes over: nothing is reset, nothing is
// started.
TEST(Conveyor, TheStandbyTakesOverAPlantThatRuns) {
  Conveyor plant([](design::Machine& machine, plant::PlantFile&) {
    machine.buses.front().flying = design::FlyingBus{0, {}};
    machine.buses.front().startup.rules.flying = true;
  });
  ASSERT_TRUE(plant.begin()) << plant.problem();
  ASSERT_TRUE(plant.begin_standby()) << plant.problem();
  ASSERT_TRUE(plant.run_until([&] { return plant.value("unloader", "running").value_or(0) != 0; }, 180s))
      << plant.log();
  plant.run_for(5s);
  Starts starts(plant);
  plant.kill_active();
  const auto taken_over = [&] { return plant.operational(); };
  ASSERT_FALSE(taken_over());
  ASSERT_TRUE(plant.run_until(taken_over, 60s)) << plant.log();
  std::printf("taken over in %.1f s of the bus\n", plant.seconds() - starts.since());
  EXPECT_EQ(starts.of_any(), 0U);
  EXPECT_EQ(starts.left_operational(), 0U);
  const auto before = plant.value("desk", "b05_beat");
  const auto coal = plant.value("bunker", "total");
  plant.run_for(20s);
  EXPECT_NE(plant.value("desk", "b05_beat"), before);
  EXPECT_GT(plant.value("bunker", "total").value_or(0), coal.value_or(0)) << "it conveys on";
  // What the dead one did, the standby does.
  plant.replace("stacker drive");
  const auto is_new = [&] {
    auto* const fresh = plant.at("stacker drive");
    return fresh != nullptr && fresh->truth().address.serial > 5000 && plant.operational();
  };
  EXPECT_TRUE(plant.run_until(is_new, 120s)) << plant.log();
}

// In the middle of binding, configuring and starting: what runs is not started again, and all of it runs at the end.
TEST(Conveyor, TheStandbyFinishesWhatADeadMasterBegan) {
  for (const auto instant : {1500ms, 5000ms}) {
    SCOPED_TRACE(std::to_string(instant / 1ms) + " ms behind the start");
    Conveyor plant([](design::Machine& machine, plant::PlantFile&) {
      machine.buses.front().flying = design::FlyingBus{0, {}};
      machine.buses.front().startup.rules.flying = true;
    });
    ASSERT_TRUE(plant.begin()) << plant.problem();
    ASSERT_TRUE(plant.begin_standby()) << plant.problem();
    const Starts starts(plant);
    plant.run_for(instant);
    plant.kill_active();
    ASSERT_TRUE(plant.run_until([&] { return plant.operational(); }, 180s)) << plant.log();
    EXPECT_EQ(starts.of_running(), 0U) << plant.log();
    EXPECT_EQ(starts.left_operational(), 0U) << plant.log();
    EXPECT_TRUE(plant.run_until([&] { return plant.value("unloader", "running").value_or(0) != 0; }, 60s))
        << plant.log();
  }
}

// Frames are lost, devices lose power and are exchanged, the master dies: when that ends all of it runs, and every
// consumer has what its producer had, and nothing of another's.
TEST(Conveyor, LinksOutliveRandomFaults) {
  const auto range = worlds::seeds(1);
  for (std::uint64_t seed = range.from; seed < range.end(); ++seed) {
    SCOPED_TRACE("seed " + std::to_string(seed));
    Random random(seed);
    Conveyor plant([](design::Machine& machine, plant::PlantFile&) {
      machine.buses.front().flying = design::FlyingBus{0, {}};
      machine.buses.front().startup.rules.flying = true;
    });
    ASSERT_TRUE(plant.begin()) << plant.problem();
    ASSERT_TRUE(plant.begin_standby()) << plant.problem();
    const auto& slots = plant.machine().slots;
    const auto dies_at = random.below(12);
    for (std::size_t step = 0; step < 12; ++step) {
      plant.run_for(std::chrono::milliseconds(random.below(4000)));
      const std::string slot = slots[random.below(slots.size())].spec.name.name;
      if (step == dies_at) plant.kill_active();
      auto* const device = plant.at(slot);
      if (device == nullptr) continue;
      switch (random.below(3)) {
        case 0: plant.replace(slot); break;
        case 1:
          device->power(false);
          plant.run_for(std::chrono::milliseconds(random.below(3000)));
          device->power(true);
          break;
        default:
          plant.bus().faults().draw_from({.disturbed_per_million = static_cast<std::uint32_t>(random.below(500)),
                                          .overrun_per_million = static_cast<std::uint32_t>(random.below(100))});
      }
    }
    plant.bus().faults().draw_from({});
    ASSERT_TRUE(plant.run_until([&] { return plant.operational(); }, 300s)) << plant.log();
    plant.run_for(20s);
    ASSERT_TRUE(plant.operational()) << plant.log();
    auto variables = watched(plant.machine());
    std::vector<std::string> strange;
    const double from = plant.seconds();
    while (plant.seconds() < from + 20) {
      plant.run_for(look);
      look_at(plant, variables, from, strange);
    }
    EXPECT_TRUE(strange.empty()) << strange.size() << " late or wrong values, first " << strange.front();
    for (const auto& place : slots) {
      auto* const device = plant.at(place.spec.name.name);
      ASSERT_NE(device, nullptr) << place.spec.name.name;
      EXPECT_EQ(device->device().state(), NmtState::operational) << place.spec.name.name;
    }
  }
}

// Programs that loop, allocate without end or throw: each ends with its line and an emergency, its device stays on the
// bus, the network is operational, and a device with the right program in its place heals it.
TEST(Conveyor, BadProgramsEndAlone) {
  const struct {
    const char* slot;
    const char* text;
    const char* told;
  } bad[] = {{"quay drive", "device.every(100, function()\n  while device.state() == 'operational' do end\nend)\n",
              "instructions"},
             {"yard drive",
              "local t = {}\ndevice.every(10, function()\n  if device.state() == 'operational' then t[#t + 1] = "
              "string.rep('x', 20000) .. #t end\nend)\n",
              "memory"},
             {"main drive",
              "device.every(100, function()\n  if device.state() == 'operational' then error('broken') end\nend)\n",
              "broken"}};
  std::string folder = (std::filesystem::temp_directory_path() / "berth-conveyor-XXXXXX").string();
  ASSERT_NE(::mkdtemp(folder.data()), nullptr);
  Conveyor plant([&](design::Machine&, plant::PlantFile& file) {
    for (const auto& each : bad) {
      const auto device = std::ranges::find(file.devices, each.slot, &plant::PlantDevice::name);
      ASSERT_NE(device, file.devices.end());
      device->does.script.path = folder + "/" + device->name + ".lua";
      std::ofstream(device->does.script.path) << each.text;
    }
  });
  ASSERT_TRUE(plant.begin()) << plant.problem();
  std::filesystem::remove_all(folder);
  ASSERT_TRUE(plant.run_until([&] { return plant.operational() && plant.told().size() >= std::size(bad); }, 120s))
      << plant.log();
  plant.run_for(2s);
  EXPECT_EQ(plant.told().size(), std::size(bad)) << "each ends once";
  for (const auto& each : bad) {
    const auto line = std::ranges::find_if(plant.told(), [&](const auto& l) { return l.starts_with(each.slot); });
    ASSERT_NE(line, plant.told().end()) << each.slot;
    EXPECT_NE(line->find(".lua:"), std::string::npos) << *line;
    EXPECT_NE(line->find(each.told), std::string::npos) << *line;
    const auto errors = plant.at(each.slot)->device().values().view({0x1003, 1});
    ASSERT_TRUE(errors && errors->size() == 4) << each.slot;
    EXPECT_EQ((*errors)[0] | (*errors)[1] << 8U, 0x6200) << "user software";
  }
  EXPECT_TRUE(plant.operational()) << plant.log();
  for (const auto& each : bad) plant.replace(each.slot);
  EXPECT_TRUE(plant.run_until([&] { return plant.value("unloader", "running").value_or(0) != 0; }, 120s))
      << plant.log();
}

}  // namespace berth::test
