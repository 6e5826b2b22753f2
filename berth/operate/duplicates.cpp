#include "berth/operate/duplicates.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <utility>

namespace berth::operate {

namespace {

constexpr unsigned told_at = 3;             // requests that were answered twice
constexpr std::size_t most_addresses = 81;  // three devices without a part in common

void put(std::vector<std::uint32_t>& values, std::uint32_t value) {
  if (std::ranges::find(values, value) == values.end()) values.push_back(value);
}

}  // namespace

void doubt_alone(Seat& seat, Agenda& agenda) noexcept {
  seat.doubt.suspect = true;
  seat.doubt.shared = Duplicates::most_tries;
  agenda.look_anew = true;
}

// A second answer to one SDO request: two devices hold this node-ID, or another SDO client is at work.
void Duplicates::surplus(NodeId node, const can::Frame& frame, rt::Time now) noexcept {
  const bool others_talk = s_.bus.flying && s_.port.status().listen_only;  // the active master asks
  if (others_talk) return;
  if (shared_ && shared_->id == node) {
    return note_shared(frame, now);
  }
  Seat* const seat = slots_.at(node);
  // A slot already reported is examined again later anyway: each examination would cause the next one at once.
  const bool told = seat != nullptr && !seat->there() && seat->shown_state() == places::SlotState::duplicate;
  if (told) return;
  agenda_.look_anew = true;
  if (seat != nullptr) {
    doubt_alone(*seat, agenda_);
    return;  // reported if it happens again while the two are separated
  }
  // A frame repeated by CAN is no second device, and the next ones seldom are either.
  auto& [last, times] = answered_twice_[node.value()];
  const rt::Time before = std::exchange(last, now);
  if (before == rt::Time{} || now - before >= std::chrono::minutes(1))
    times = 1;
  else if (now - before > places::second_answer)
    ++times;
  if (times == told_at) tell(node);
}

void Duplicates::tell(NodeId node) {
  const std::string text = fmt::format(
      "node {} answered one SDO request twice: two devices hold this node-ID, or another "
      "SDO client is on the bus",
      node.value());
  slots_.events().tell_once(EventKind::duplicate, text);
}

Duplicates::Duplicates(BusServices& services, SlotTable& slots, Agenda& agenda, FoundDevices& found,
                       Asking& asking) noexcept
    : s_(services), slots_(slots), agenda_(agenda), found_(found), asking_(asking) {
  s_.sdo.set_observer(this);
  s_.sdo.heed_other_clients();
}

// A second answer to the upload of a part. CAN repeats a frame if its sender sees the last bit wrong, so one second
// answer proves nothing. A second answer to another question does, as all are asked with pauses.
void Duplicates::note_shared(const can::Frame& frame, rt::Time at) {
  const auto before = std::exchange(shared_->second_at, at);
  if (before && at - *before > places::second_answer) shared_->answered_twice = true;
  const bool expedited =
      frame.size == 8 && (frame.data[0] & 0xE3U) == 0x43U && frame.data[1] == 0x18 && frame.data[2] == 0x10;
  const std::size_t sub = frame.data[3];
  if (!expedited || sub < 1 || sub > 4) return;
  std::uint32_t value = 0;
  for (std::size_t i = 0; i < 4; ++i) value |= std::uint32_t{frame.data[4 + i]} << (8 * i);
  put(shared_->parts[sub - 1], value);
  put(shared_->seconds[sub - 1], value);
}

// Twice, with pauses: a single-slot receive buffer loses a question after another frame.
rt::Task<void> Duplicates::hear_parts(NodeId id) {
  co_await rt::sleep_for(places::second_answer);
  for (std::uint8_t i = 0; i < 8; ++i) {
    const std::uint8_t sub = static_cast<std::uint8_t>(i % 4 + 1);
    const auto first = co_await s_.sdo.read<std::uint32_t>(id, 0x1018, sub);
    if (first) put(shared_->parts[sub - 1U], *first);
    co_await rt::sleep_for(places::second_answer);
    // A repeated frame has the same content as the first.
    const auto& seconds = shared_->seconds[sub - 1U];
    const bool differs = first && std::ranges::any_of(seconds, [&](std::uint32_t value) { return value != *first; });
    shared_->answered_twice = shared_->answered_twice || differs;
    const bool none = !first && first.error().code == Errc::aborted;
    if (none) put(shared_->parts[sub - 1U], 0);
  }
}

std::vector<Identity> Duplicates::addresses_of(const Shared& shared) {
  std::vector<Identity> all;
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

// Finds those addresses whose device uses this node-ID. `slowly`: with pauses between the frames.
rt::Task<void> Duplicates::ask_addresses(NodeId id, std::vector<Identity> addresses, bool slowly) {
  for (const Identity& address : addresses) {
    const Identity device = address;
    Result<NodeId> active = NodeId();
    if (slowly) {
      active = co_await asking_.active_id(device);
    } else {
      active = co_await asking_.active_id_once(device);
    }
    if (!active || *active != id) continue;
    found_.note({device, id});
    slots_.events().tell_once(EventKind::found, fmt::format("found {} with node-ID {}, beside another device",
                                                            to_string(device), id.value()));
  }
}

// `known`: the devices that share it are known, and the plan gives each its own node-ID (a slot's device that is alone
// there is known). `two`: there are two, but LSS does not find them.
rt::Task<Duplicates::Distinction> Duplicates::tell_one_apart(NodeId id) {
  if (s_.only_observes()) co_return Distinction::nothing;
  shared_ = Shared{.id = id};
  co_await hear_parts(id);
  const bool two = shared_->answered_twice;
  if (two) tell(id);
  std::vector<Identity> addresses = addresses_of(*shared_);
  shared_.reset();
  const Seat* const seat = slots_.at(id);
  const bool sits = seat != nullptr && seat->slot.record.confirmed;
  if (sits) std::erase(addresses, seat->slot.record.confirmed->device);
  const auto found = [&](const Identity& device) {
    return std::ranges::any_of(found_.all(),
                               [&](const places::Found& f) { return f.device == device && f.active == id; });
  };
  const std::ptrdiff_t enough = sits ? 1 : 2;
  for (const bool slowly : {false, true}) {
    std::vector<Identity> left;
    std::ranges::copy_if(addresses, std::back_inserter(left), [&](const Identity& a) { return !found(a); });
    if (std::ssize(addresses) - std::ssize(left) >= enough) break;
    co_await ask_addresses(id, left, slowly);
  }
  if (std::ranges::any_of(addresses, found)) co_return Distinction::known;
  co_return two ? Distinction::two : Distinction::nothing;
}

rt::Task<bool> Duplicates::tell_apart(std::vector<NodeId> ids) {
  constexpr int seldom = 32;
  bool any = false;
  for (const NodeId& each : ids) {
    const NodeId id = each;
    auto& not_before = not_before_[id.value()];
    if (s_.executor.now() < not_before) continue;
    const Distinction told = co_await tell_one_apart(id);
    const bool known = told == Distinction::known;
    if (!known) not_before = s_.executor.now() + seldom * s_.bus.timing.probe_period;
    any = any || known;
  }
  co_return any;
}

// A slot's device and another: the plan takes the node-ID from the one found here beside the slot's device. A device
// without LSS is not found, and only a user can remove it.
rt::Task<void> Duplicates::tell_seats_apart() {
  for (auto& seat : slots_.seats()) {
    const bool shares = seat->doubt.shared > 0 && seat->slot.record.confirmed;
    if (!shares) continue;
    --seat->doubt.shared;
    const NodeId id = seat->id();
    const Distinction told = co_await tell_one_apart(id);
    if (told == Distinction::nothing) continue;
    seat->doubt.shared = 0;
    if (told == Distinction::two && seat->there())
      slots_.happened(*seat, SlotEvent::two_answer, reason, manager::BootStatus::booted);
  }
}

}  // namespace berth::operate
