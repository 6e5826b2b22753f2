// Worlds in which devices agree on their node-IDs without a master (paper 2): random mixes by seed, and what must hold
// at their end. For tests and for `./run faults`:
//
//     const auto wrong = harness::try_negotiation(seed);   // empty: as it must be
//
// Required: within `negotiation_bound` after the last disturbance, every powered device holds a node-ID that no other
// device on its bus holds, or reports that all are in use; and it still holds it half a minute later.
#pragma once

#include <fmt/format.h>
#include <algorithm>
#include <chrono>
#include <cstdint>
#include <vector>

#include <map>
#include <string>

#include "berth/base/random.hpp"
#include "berth/plant/plant_file.hpp"
#include "berth/plant/world.hpp"

namespace berth::harness {

using plant::Action;
using plant::PlantDevice;
using plant::PlantEvent;
using plant::PlantFile;
using plant::Speaks;

struct NegotiationMix {
  unsigned most_devices = 12;
  bool clones = true;       ///< some devices have the identity of another
  bool lost_frames = true;  ///< overruns and disturbed frames
  bool cuts = true;         ///< the cable is cut and mended
};

inline PlantDevice negotiating_device(const std::string& name, const LssAddress& address) {
  PlantDevice d;
  d.name = name;
  d.bus = "line";
  d.address = address;
  d.speaks = {Speaks::negotiation, Speaks::lss};
  return d;
}

inline PlantFile negotiation_plant(std::uint32_t bit_rate, std::uint64_t seed = 1) {
  PlantFile file;
  file.seed = seed;
  file.buses.push_back({"line", bit_rate});
  return file;
}

inline LssAddress random_identity(Random& random) {
  switch (random.below(4)) {
    case 0:  // one type, consecutive serial numbers
      return {0x319, 0x00020001, 0x00010000, static_cast<std::uint32_t>(0x10F0 + random.below(32))};
    case 1:  // the last byte that is sent differs
      return {0x319, 0x00020001, 0x00010000, static_cast<std::uint32_t>(random.below(256)) << 24U | 7U};
    case 2:  // the first one
      return {static_cast<std::uint32_t>(0x300 + random.below(256)), 1, 1, 1};
    default: break;
  }
  const auto part = [&] { return static_cast<std::uint32_t>(random.next()); };
  const auto vendor = part();
  const auto product = part();
  const auto revision = part();
  return {vendor, product, revision, part()};
}

inline PlantFile negotiation_plan(std::uint64_t seed, const NegotiationMix& mix = {}) {
  using std::chrono::microseconds;
  using std::chrono::milliseconds;
  Random random(seed * 2 + 1);
  constexpr std::array<std::uint32_t, 6> rates{20'000, 50'000, 125'000, 250'000, 500'000, 1'000'000};
  auto file = negotiation_plant(rates.at(random.below(rates.size())), seed);
  const auto count = 2 + random.below(mix.most_devices - 1);
  for (unsigned i = 0; i < count; ++i) {
    auto d = negotiating_device(fmt::format("d{}", i + 1), random_identity(random));
    const auto taken = [&](const LssAddress& a) {
      return std::ranges::any_of(file.devices, [&](const PlantDevice& other) { return other.address == a; });
    };
    while (taken(d.address)) d.address = random_identity(random);
    if (mix.clones && i > 0 && random.below(6) == 0) d.address = file.devices[random.below(i)].address;
    d.boot = milliseconds(random.below(4) == 0 ? random.below(400) : 50);
    d.response.min = microseconds(random.below(500));
    d.response.max = d.response.min + microseconds(random.below(2) == 0 ? 0 : random.below(3000));
    d.controller.drift_ppm = static_cast<std::int32_t>(random.between(-500, 500));
    constexpr std::array heartbeats{0, 100, 500, 1000};
    d.heartbeat = milliseconds(heartbeats.at(random.below(heartbeats.size())));
    d.controller.queue = random.below(2) == 0 ? plant::QueueKind::in_order : plant::QueueKind::priority;
    d.plugged = random.below(5) != 0;
    if (random.below(10) == 0) {  // set by switches: it keeps its node-ID in any case
      d.source = plant::NodeIdSource::switches;
      d.node_id = NodeId(static_cast<std::uint8_t>(10 + i));
    }
    file.devices.push_back(d);
  }
  const auto any = [&] { return file.devices[random.below(count)].name; };
  const auto events = random.below(8);
  bool cut = false;
  for (unsigned i = 0; i < events; ++i) {
    PlantEvent e;
    e.delay = milliseconds(random.below(6000));
    switch (random.below(8)) {
      case 0: e.action = Action::reset, e.device = any(); break;
      case 1: e.action = Action::power_off, e.device = any(); break;
      case 2: e.action = Action::power_on, e.device = any(); break;
      case 3: e.action = Action::plug, e.device = any(); break;
      case 4: e.action = Action::unplug, e.device = any(); break;
      case 5:
        if (!mix.cuts || cut) continue;
        cut = true;
        e.action = Action::cut_cable, e.bus = "line";
        for (const auto& d : file.devices) {
          if (random.below(2) == 0) e.nodes.push_back(d.name);
        }
        if (e.nodes.empty()) continue;
        break;
      default:
        if (!mix.lost_frames) continue;
        e.action = random.below(2) == 0 ? Action::overrun : Action::disturb;
        e.bus = "line";
        e.nodes = {any()};
        e.strike.skip = static_cast<std::uint32_t>(random.below(40));
        e.strike.times = static_cast<std::uint32_t>(1 + random.below(6));
        e.strike.bit = static_cast<std::int32_t>(random.below(60));
        break;
    }
    file.events.push_back(e);
  }
  if (cut) {
    PlantEvent join;
    join.action = Action::join;
    join.bus = "line";
    join.delay = milliseconds(6000 + random.below(4000));
    file.events.push_back(join);
  }
  for (unsigned i = 0; i < count; ++i) {  // all devices are present at the end
    PlantEvent e;
    e.delay = milliseconds(6000 + random.below(4000));
    e.device = file.devices[i].name;
    e.action = Action::plug;
    file.events.push_back(e);
    e.action = Action::power_on;
    file.events.push_back(e);
  }
  return file;
}

/// After the last disturbance: one cycle for each device, and two checks of at most 30 s each, by which two holders of
/// one node-ID are distinguished if nothing else does it.
inline rt::Duration negotiation_bound(std::size_t devices) {
  return std::chrono::seconds(65) + devices * std::chrono::milliseconds(500);
}

/// Empty: every powered device holds a node-ID of its own, or reports why not.
inline std::string negotiation_fault(const plant::World& world) {
  std::string wrong;
  std::map<std::pair<std::string, NodeId>, std::string> holders;
  for (const auto& device : world.devices()) {
    const auto truth = device->truth();
    if (!truth.powered) continue;
    const auto* negotiator = device->device().schemes().negotiator();
    const bool full = negotiator != nullptr && negotiator->state() == research::Negotiating::exhausted;
    if (!truth.active.configured()) {
      if (!full) {
        wrong += fmt::format("{} has no node-ID: {}; ", truth.name,
                             negotiator != nullptr ? research::name(negotiator->state()) : "does not negotiate");
      }
      continue;
    }
    if (truth.state == NmtState::initialising) wrong += truth.name + " has a node-ID and is still initialising; ";
    const auto [it, fresh] = holders.try_emplace({truth.bus, truth.active}, truth.name);
    if (!fresh) wrong += fmt::format("{} and {} both hold {}; ", it->second, truth.name, truth.active.value());
  }
  return wrong;
}

inline std::vector<NodeId> held(const plant::World& world) {
  std::vector<NodeId> ids;
  for (const auto& device : world.devices()) ids.push_back(device->truth().active);
  return ids;
}

/// Runs a plan to its end. Empty: all is as it must be. `hash`: receives that of the trace, if not null.
inline std::string run_negotiation(const PlantFile& file, std::uint64_t* hash = nullptr) {
  Findings findings;
  auto world = plant::World::make(file, {}, findings);
  if (!world) return "the plan is no plant";
  struct Hash {
    ~Hash() {
      if (to != nullptr) *to = world.sim().trace_hash();
    }
    plant::World& world;
    std::uint64_t* to;
  } const at_the_end{*world, hash};
  world->start();
  rt::Duration last{0};
  for (const auto& e : file.events) last = std::max(last, e.delay);
  world->sim().run_for(last);
  const auto limit = negotiation_bound(file.devices.size());
  world->sim().run_for(limit);
  if (auto wrong = negotiation_fault(*world); !wrong.empty()) return wrong;
  const auto ids = held(*world);
  world->sim().run_for(std::chrono::seconds(30));
  if (auto wrong = negotiation_fault(*world); !wrong.empty()) return "later: " + wrong;
  return ids == held(*world) ? "" : "node-IDs change although nothing disturbs";
}

inline std::string try_negotiation(std::uint64_t seed, const NegotiationMix& mix = {}) {
  return run_negotiation(negotiation_plan(seed, mix));
}

}  // namespace berth::harness
