// Two devices under one node-ID, as they leave the factory or come from two plants: each SDO request is answered twice.
// LSS tells them apart when their addresses are known. What both say in 1018h is put together, part by part, and each
// address that this may be is asked for by LSS, which needs no search and finds devices that no search finds
// (CANopenNode's slaves with a node-ID answer 40h to 43h alone).
#include <fmt/format.h>

#include <algorithm>

#include "berth/operate/network_seat.hpp"

namespace berth::operate {

namespace {

constexpr std::size_t most_addresses = 81;  // three devices without a part in common

void put(std::vector<std::uint32_t>& values, std::uint32_t value) {
  if (std::ranges::find(values, value) == values.end()) values.push_back(value);
}

}  // namespace

// An answer to the upload of a part that the first answer had ended.
void Network::note_shared(const can::Frame& frame) {
  const bool expedited =
      frame.size == 8 && (frame.data[0] & 0xE3U) == 0x43U && frame.data[1] == 0x18 && frame.data[2] == 0x10;
  const std::size_t sub = frame.data[3];
  if (!expedited || sub < 1 || sub > 4) return;
  std::uint32_t value = 0;
  for (std::size_t i = 0; i < 4; ++i) value |= std::uint32_t{frame.data[4 + i]} << (8 * i);
  put(shared_->parts[sub - 1], value);
}

// Twice, with pauses: a single-slot receive buffer loses a question behind another frame.
rt::Task<void> Network::hear_parts(NodeId id) {
  co_await rt::sleep_for(second_answer);
  for (std::uint8_t i = 0; i < 8; ++i) {
    const std::uint8_t sub = static_cast<std::uint8_t>(i % 4 + 1);
    const auto first = co_await sdo_.read<std::uint32_t>(id, 0x1018, sub);
    if (first) put(shared_->parts[sub - 1U], *first);
    const bool none = !first && first.error().code == Errc::aborted;
    if (none) put(shared_->parts[sub - 1U], 0);
    co_await rt::sleep_for(second_answer);
  }
}

std::vector<LssAddress> Network::addresses_of(const Shared& shared) {
  std::vector<LssAddress> all;
  for (const auto vendor : shared.parts[0]) {
    for (const auto product : shared.parts[1]) {
      for (const auto revision : shared.parts[2]) {
        for (const auto serial : shared.parts[3]) {
          if (all.size() < most_addresses) all.push_back({vendor, product, revision, serial});
        }
      }
    }
  }
  return all;
}

// Those of the addresses at which a device uses this node-ID. `slowly`: with pauses between the frames.
rt::Task<void> Network::ask_addresses(NodeId id, std::vector<LssAddress> addresses, bool slowly) {
  for (const LssAddress& address : addresses) {
    const LssAddress device = address;
    Result<NodeId> active = NodeId();
    if (slowly) {
      active = co_await active_id(device);
    } else {
      active = co_await ask_active_id(device);
    }
    if (!active || *active != id) continue;
    note_found({device, id});
    tell_once("found", fmt::format("found {} with node-ID {}, beside another device", to_string(device), id.value()));
  }
}

// True: who shares it is known now, and the plan gives each its own. A slot's device that is alone there is known.
rt::Task<bool> Network::tell_apart(NodeId id) {
  if (bus_->role == design::Role::observer) co_return false;
  shared_ = Shared{id, {}};
  co_await hear_parts(id);
  std::vector<LssAddress> addresses = addresses_of(*shared_);
  shared_.reset();
  const Seat* const seat = seat_at(id);
  const bool sits = seat != nullptr && seat->slot.record.confirmed;
  if (sits) std::erase(addresses, seat->slot.record.confirmed->device);
  const auto found = [&](const LssAddress& device) {
    return std::ranges::any_of(found_, [&](const places::Found& f) { return f.device == device && f.active == id; });
  };
  const std::ptrdiff_t enough = sits ? 1 : 2;
  for (const bool slowly : {false, true}) {
    std::vector<LssAddress> left;
    std::ranges::copy_if(addresses, std::back_inserter(left), [&](const LssAddress& a) { return !found(a); });
    if (std::ssize(addresses) - std::ssize(left) >= enough) break;
    co_await ask_addresses(id, left, slowly);
  }
  co_return std::ranges::any_of(addresses, found);
}

rt::Task<bool> Network::tell_all_apart(std::vector<NodeId> ids) {
  constexpr int seldom = 32;
  bool any = false;
  for (const NodeId& each : ids) {
    const NodeId id = each;
    auto& not_before = apart_at_[id.value()];
    if (executor_->now() < not_before) continue;
    const bool known = co_await tell_apart(id);
    if (!known) not_before = executor_->now() + seldom * bus_->timing.probe_period;
    any = any || known;
  }
  co_return any;
}

// A slot's device and another: which of them is found here beside it is taken off the node-ID by the plan.
rt::Task<void> Network::tell_seats_apart() {
  for (auto& seat : seats_) {
    const bool shares = seat->shared > 0 && seat->slot.record.confirmed;
    if (!shares) continue;
    --seat->shared;
    const NodeId id = seat->id();
    const bool other = co_await tell_apart(id);
    if (other) seat->shared = 0;
  }
}

}  // namespace berth::operate
