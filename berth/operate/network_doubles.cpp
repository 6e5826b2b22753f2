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
constexpr rt::Duration second_answer = std::chrono::milliseconds(20);

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

rt::Task<void> Network::hear_parts(NodeId id) {
  for (std::uint8_t sub = 1; sub <= 4; ++sub) {
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
rt::Task<bool> Network::ask_addresses(NodeId id, std::vector<LssAddress> addresses, bool slowly) {
  bool any = false;
  for (const LssAddress& address : addresses) {
    const LssAddress device = address;
    Result<NodeId> active = NodeId();
    if (slowly) {
      active = co_await active_id(device);
    } else {
      active = co_await ask_active_id(device);
    }
    if (!active || *active != id) continue;
    any = true;
    note_found({device, id});
    tell_once("found", fmt::format("found {} with node-ID {}, beside another device", to_string(device), id.value()));
  }
  co_return any;
}

// True: one of them at least is known now, and the plan gives each its own.
rt::Task<bool> Network::tell_apart(NodeId id) {
  const rt::Time now = executor_->now();
  auto& not_before = apart_at_[id.value()];
  if (now < not_before || bus_->role == design::Role::observer) co_return false;
  shared_ = Shared{id, {}};
  co_await hear_parts(id);
  const std::vector<LssAddress> addresses = addresses_of(*shared_);
  shared_.reset();
  const bool quickly = false;
  bool any = co_await ask_addresses(id, addresses, quickly);
  const bool slowly = true;
  if (!any) any = co_await ask_addresses(id, addresses, slowly);
  constexpr int seldom = 32;
  not_before = any ? now : executor_->now() + seldom * bus_->timing.probe_period;
  co_return any;
}

rt::Task<bool> Network::tell_all_apart(std::vector<NodeId> ids) {
  bool any = false;
  for (const NodeId& each : ids) {
    const NodeId id = each;
    const bool known = co_await tell_apart(id);
    any = any || known;
  }
  co_return any;
}

rt::Task<void> Network::tell_seats_apart() {
  std::vector<NodeId> ids;
  for (const auto& seat : seats_) {
    const bool shares = seat->state == places::SlotState::duplicate && seat->slot.record.confirmed && !seat->there;
    if (shares) ids.push_back(seat->id());
  }
  co_await tell_all_apart(ids);
}

}  // namespace berth::operate
