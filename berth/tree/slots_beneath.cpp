#include "berth/tree/slots_beneath.hpp"

#include <fmt/format.h>

#include <algorithm>

namespace berth::tree {

using places::SlotState;

SlotsBeneath::SlotsBeneath(rt::Executor& executor, const design::Bus& bus, std::vector<places::SlotSpec> specs,
                           operate::NetworkObserver observer)
    : executor_(executor), bus_(bus), events_(executor, bus.name, std::move(observer)) {
  std::ranges::sort(specs, {}, &places::SlotSpec::id);
  for (auto& spec : specs) {
    PlaceBeneath place;
    place.now.bus = bus_.name;
    place.now.id = spec.id;
    place.now.name = spec.name.name;
    place.now.type = spec.type;
    place.now.unasked = spec.asks.unasked;
    place.spec = std::move(spec);
    places_.push_back(std::move(place));
  }
}

PlaceBeneath* SlotsBeneath::at(NodeId node) noexcept {
  const auto it = std::ranges::find(places_, node, [](const PlaceBeneath& p) { return p.spec.id; });
  return it == places_.end() ? nullptr : &*it;
}

std::vector<places::SlotSpec> SlotsBeneath::specs() const {
  std::vector<places::SlotSpec> all;
  for (const auto& place : places_) all.push_back(place.spec);
  return all;
}

std::vector<NodeId> SlotsBeneath::nodes() const {
  std::vector<NodeId> all;
  for (const auto& place : places_) all.push_back(place.spec.id);
  return all;
}

std::vector<NodeId> SlotsBeneath::needed() const {
  std::vector<NodeId> all;
  for (const auto& place : places_) {
    if (!place.spec.optional) all.push_back(place.spec.id);
  }
  return all;
}

std::vector<operate::SlotReport> SlotsBeneath::report() const {
  std::vector<operate::SlotReport> slots;
  for (const auto& place : places_) slots.push_back(place.now);
  return slots;
}

bool SlotsBeneath::operational() const noexcept {
  return std::ranges::all_of(
      places_, [](const PlaceBeneath& p) { return p.spec.optional || p.now.state == SlotState::operational; });
}

void SlotsBeneath::set_state(PlaceBeneath& place, SlotState state, std::string reason) {
  if (place.now.state == state && place.now.reason == reason) return;
  if (place.now.state != state) place.now.since = executor_.now();
  place.now.state = state;
  place.now.reason = std::move(reason);
  events_.tell(
      operate::EventKind::state, place.now.name,
      place.now.reason.empty() ? places::name(state) : fmt::format("{}: {}", places::name(state), place.now.reason));
  const bool all = operational();
  if (all && !std::exchange(was_operational_, all) && operational_call_) operational_call_();
  was_operational_ = all;
}

void SlotsBeneath::set_all_absent(const std::string& reason) {
  for (auto& place : places_) {
    place.identified = false;
    if (place.now.state != SlotState::absent) set_state(place, SlotState::absent, reason);
  }
}

void SlotsBeneath::say_of_unknown(const std::string& reason) {
  for (auto& place : places_) {
    if (place.now.state == SlotState::unknown) place.now.reason = reason;
  }
}

void SlotsBeneath::set_device(PlaceBeneath& place, const Identity& device) {
  place.identified = true;
  if (place.now.device == device) return;
  place.now.device = device;
  events_.tell(
      operate::EventKind::bound, place.now.name,
      fmt::format("{} {}", place.fixed() ? "its device is" : "gateway's master assigned it to", to_string(device)));
}

}  // namespace berth::tree
