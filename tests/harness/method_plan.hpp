// Random worlds for one method of discovery, from a seed, as explicit data. See docs/faults.md.
#pragma once

#include <algorithm>
#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "berth/discovery/auto.hpp"
#include "berth/harness/world_plan.hpp"
#include "tests/harness/rig.hpp"

namespace berth::harness {

// What is tried: each method, Auto, and the negotiation, which needs no master.
inline constexpr int auto_row = static_cast<int>(discovery::methods);
inline constexpr int negotiation_row = auto_row + 1;
inline constexpr int method_rows = auto_row + 2;
inline std::string row_name(int row) {
  if (row == auto_row) return "auto";
  if (row == negotiation_row) return "negotiation";
  return std::string(discovery::name(static_cast<discovery::Method>(row)));
}

// The faults of the main job's worlds, and two more.
inline constexpr int fault_join = fault_kinds;
inline constexpr int fault_restart = fault_kinds + 1;
inline constexpr int method_faults = fault_kinds + 2;
inline const char* method_fault_name(int fault) {
  if (fault == fault_join) return "join";
  if (fault == fault_restart) return "restart";
  constexpr const char* names[] = {"overrun", "ov.master", "disturb", "twice", "slow", "deaf",
                                   "reset",   "power",     "unplug",  "cut",   "04 00"};
  return names[fault];
}

struct MethodFault {
  int kind = 0;
  rt::Duration at{0};  // after the first search began
};

struct MethodPlan {
  int row = 0;
  std::uint64_t seed = 0;
  plant::PlantFile plant;
  std::vector<MethodFault> faults;  // in the order of time
  discovery::Known known;
  rt::Duration window{0};  // of a planner
  bool covered = true;     // no device answers later than that
  bool binds = true;       // the devices found get node-IDs
  bool stores = false;
  bool confirms = true;
  bool perturbed = false;
};

class MethodPlanner {
 public:
  MethodPlanner(int row, std::uint64_t seed)
      : random_((seed * 16 + static_cast<std::uint64_t>(row)) * 0x9E3779B97F4A7C15ULL + 1) {
    plan_.row = row;
    plan_.seed = seed;
  }

  MethodPlan make() {
    constexpr std::uint32_t rates[] = {50'000, 125'000, 250'000, 500'000, 1'000'000};
    plan_.plant = one_bus_plant(plan_.seed);
    plan_.plant.buses.front().bitrate = rates[random_.below(5)];
    kinds();
    numbers_ = static_cast<unsigned>(random_.below(3));
    // The bit by bit scan is slow: mostly few devices.
    const bool slow = is(discovery::Method::fastscan) || is(discovery::Method::feedback_11);
    const auto most = slow && random_.below(8) != 0 ? 3 : 12;
    const auto count = 1 + random_.below(most);
    for (std::uint64_t i = 0; i < count; ++i) device(speakers());
    for (auto i = random_.below(4); i-- > 0;) device(others());
    if (random_.below(8) == 0) {  // a clone
      plant::PlantDevice clone = plan_.plant.devices.front();
      clone.name = "clone";
      plan_.plant.devices.push_back(clone);
    }
    how();
    faults();
    return std::move(plan_);
  }

 private:
  using Words = plant::SpeaksSet;
  [[nodiscard]] bool is(discovery::Method m) const { return plan_.row == static_cast<int>(m); }

  void kinds() {
    const auto count = 1 + random_.below(3);
    for (std::uint64_t i = 0; i < count; ++i) {
      const auto part = [&] {
        return static_cast<std::uint32_t>(random_.below(3) == 0 ? random_.below(4) : random_.next());
      };
      const auto vendor = i > 0 && random_.below(2) == 0 ? kinds_.front().vendor : part();
      const auto product = part();
      kinds_.push_back({vendor, product, part(), 0});
    }
  }

  Words speakers() {
    using enum plant::Speaks;
    const auto any = [&](std::initializer_list<plant::Speaks> all) {
      Words words{lss};
      words.add(*(all.begin() + random_.below(all.size())));
      return words;
    };
    if (plan_.row == auto_row) return any({lss, fastscan, feedback_29, feedback_11, rand, rand_resume, and_protocol});
    switch (static_cast<discovery::Method>(plan_.row)) {
      case discovery::Method::rand:
      case discovery::Method::planner_rand: return any({rand, rand, rand_resume});
      case discovery::Method::and_protocol: return any({and_protocol});
      case discovery::Method::fastscan: return any({fastscan, fastscan, feedback_29, feedback_11});
      case discovery::Method::feedback_29: return any({feedback_29, feedback_29, feedback_29, fastscan});
      case discovery::Method::feedback_11: return any({feedback_11, feedback_11, feedback_11, fastscan});
      case discovery::Method::identify: return any({lss, lss, fastscan, rand});
      case discovery::Method::planner_fastscan:
      case discovery::Method::planner_feedback: return any({fastscan, feedback_29, feedback_11});
    }
    return {lss};
  }
  Words others() {
    using enum plant::Speaks;
    constexpr plant::Speaks all[] = {lss, fastscan, feedback_29, rand, rand_literal, and_protocol};
    Words words;
    const auto first = all[random_.below(6)];
    if (random_.below(4) != 0) words.add(first);
    return words;  // may be none: a device with switches
  }

  void device(Words speaks) {
    const auto number = plan_.plant.devices.size() + 1;
    LssAddress a = kinds_[random_.below(kinds_.size())];
    if (random_.below(8) == 0) a.revision ^= 1U << random_.below(32);
    // Consecutive, random, or both.
    const bool consecutive = numbers_ == 0 || (numbers_ == 2 && random_.below(2) == 0);
    a.serial = consecutive ? 0x10F8U + static_cast<std::uint32_t>(number) : static_cast<std::uint32_t>(random_.next());
    if (random_.below(16) == 0) a.serial = random_.below(2) == 0 ? 0 : 0xFFFF'FFFF;
    while (std::ranges::any_of(plan_.plant.devices, [&](const auto& d) { return d.address.serial == a.serial; }))
      ++a.serial;
    auto& d = add_device(plan_.plant, "d" + std::to_string(number), a.type(), a.serial);
    d.address = a;
    d.speaks = speaks;
    d.response.min = between(200us, 4ms);
    d.response.max = std::min<rt::Duration>(d.response.min + between(0us, 6ms), 8ms);
    if (random_.below(4) == 0) {
      d.response.outlier_ppm = 10'000;
      d.response.outlier = between(8ms, 40ms);
    }
    d.boot = between(1ms, 200ms);
    d.reset = between(1ms, 100ms);
    d.storing.time = between(1ms, 100ms);
    d.storing.deaf = random_.below(3) == 0;
    d.controller.queue = random_.below(2) == 0 ? plant::QueueKind::in_order : plant::QueueKind::priority;
    // Room for the frames that come while an outlier lasts; the main job's worlds have small buffers.
    d.controller.rx_depth = std::array<std::uint32_t, 3>{32, 48, 64}[random_.below(3)];
    d.controller.drift_ppm = static_cast<std::int32_t>(random_.between(-200, 200));
    d.controller.bus_off_recovery = 200ms;
    if (random_.below(6) == 0) d.heartbeat = 100ms;
    if (speaks == Words{} || random_.below(10) == 0) {
      d.source = speaks == Words{} ? plant::NodeIdSource::switches : plant::NodeIdSource::nonvolatile;
      d.node_id = NodeId(static_cast<std::uint8_t>(100 + number));
    }
  }

  void how() {
    plan_.perturbed = random_.below(2) == 0;
    const bool whole = plan_.row == static_cast<int>(discovery::Method::identify) || plan_.row == auto_row;
    for (const auto& d : plan_.plant.devices) {
      const discovery::Kind kind{d.address.type(), whole || random_.below(2) == 0
                                                       ? std::optional<std::uint32_t>(d.address.revision)
                                                       : std::nullopt};
      const bool known = whole || random_.below(2) == 0;
      if (known && std::ranges::find(plan_.known.kinds, kind) == plan_.known.kinds.end())
        plan_.known.kinds.push_back(kind);
      if (random_.below(6) == 0) plan_.known.expected.push_back(d.address);
    }
    // The published Fastscan ends at the first device that stays without a node-ID.
    const bool must_bind =
        is(discovery::Method::fastscan) || is(discovery::Method::feedback_29) || is(discovery::Method::feedback_11);
    plan_.binds = must_bind || random_.below(2) == 0;
    plan_.confirms = (!is(discovery::Method::planner_rand) && plan_.row != auto_row) || random_.below(2) == 0;
    plan_.stores = plan_.binds && random_.below(4) == 0;
    rt::Duration slowest{0};
    bool outliers = false;
    for (const auto& d : plan_.plant.devices) {
      slowest = std::max({slowest, d.response.max, d.response.outlier});
      outliers = outliers || d.response.outlier.count() > 0;
    }
    // Answers queue up, at most two frames of each device.
    const rt::Duration frame(160 * std::int64_t{1'000'000'000} / plan_.plant.buses.front().bitrate);
    const auto frames = static_cast<std::int64_t>(2 * plan_.plant.devices.size() + 2);
    plan_.covered = !outliers || random_.below(2) == 0;
    plan_.window = (plan_.covered ? slowest : rt::Duration(9ms)) + frames * frame + 500us;
  }

  // About the duration of a search among so many devices.
  [[nodiscard]] rt::Duration lasts() const {
    const auto n = static_cast<std::int64_t>(plan_.plant.devices.size());
    if (plan_.row == auto_row) return n * 200ms;
    switch (static_cast<discovery::Method>(plan_.row)) {
      case discovery::Method::rand: return n * 400ms;
      case discovery::Method::and_protocol: return n * 550ms;
      case discovery::Method::fastscan: return n * 1500ms;
      case discovery::Method::feedback_29: return n * 150ms;
      case discovery::Method::feedback_11: return n * 450ms;
      case discovery::Method::identify: return n * 400ms;
      default: return n * 100ms;
    }
  }

  void faults() {
    for (auto i = 1 + random_.below(5); i-- > 0;) {
      plan_.faults.push_back({static_cast<int>(random_.below(method_faults)), between(0us, lasts())});
    }
    std::ranges::sort(plan_.faults, {}, &MethodFault::at);
    // The last device joins in the middle.
    if (std::ranges::any_of(plan_.faults, [](const auto& f) { return f.kind == fault_join; }))
      plan_.plant.devices.back().plugged = false;
  }

  rt::Duration between(rt::Duration low, rt::Duration high) {
    return rt::Duration(random_.between(low.count(), high.count()));
  }

  Random random_;
  MethodPlan plan_;
  std::vector<LssAddress> kinds_;
  unsigned numbers_ = 0;
};

}  // namespace berth::harness
