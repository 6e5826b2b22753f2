// What an earlier run, or an earlier try, left unfinished: a device that was told its node-ID and is away keeps it, and
// a device that was to give its node-ID up is asked for again where that was begun (S1.29, S1.53).
#include <fmt/format.h>

#include <algorithm>

#include "berth/operate/network_seat.hpp"

namespace berth::operate {

using places::SlotState;
using places::UnfinishedBlank;

std::string Network::machine_name() const {
  return seats_.empty() ? std::string() : seats_.front()->slot.spec.name.machine;
}

// Those of stores of before schema 5 are of any bus.
std::vector<UnfinishedBlank> Network::unfinished_here() const {
  std::vector<UnfinishedBlank> here;
  const auto all = store_->unfinished_blanks();
  if (!all) return here;
  const std::string machine = machine_name();
  std::ranges::copy_if(*all, std::back_inserter(here), [&](const UnfinishedBlank& b) {
    return b.bus.empty() || (b.bus == bus_->name && (b.machine == machine || machine.empty()));
  });
  return here;
}

// Only a device that is there can give anything up.
std::vector<LssAddress> Network::blanks_to_finish() const {
  std::vector<LssAddress> devices;
  for (const auto& blank : unfinished_here()) {
    const bool there = std::ranges::find(found_, blank.device, &places::Found::device) != found_.end();
    if (there) devices.push_back(blank.device);
  }
  return devices;
}

rt::Task<bool> Network::answers_by_lss(LssAddress device) {
  const bool known = std::ranges::find(found_, device, &places::Found::device) != found_.end();
  if (known) co_return true;
  const auto id = co_await active_id(device);
  const bool clone = !id && id.error().code == Errc::duplicate;
  if (id || clone) note_found({device, id ? *id : NodeId(), clone});
  co_return id || clone;
}

// One question for each instead of a whole binding at every look: a device can be away for ever.
rt::Task<void> Network::look_for_unfinished() {
  for (auto& seat : seats_) {
    const bool by_lss = seat->slot.spec.assign == places::Assign::lss && seat->slot.record.asked.has_value();
    if (!by_lss) continue;
    const LssAddress device = seat->slot.record.asked->device;
    if (seat->state == SlotState::power_cycle) {
      const bool waits = co_await waits_for_its_power_cycle(*seat);
      if (waits) avoid_.push_back(device);
      continue;
    }
    const bool answers = co_await answers_by_lss(device);
    if (answers) continue;
    avoid_.push_back(device);
    keep_for_its_device(*seat);
  }
  for (const auto& blank : unfinished_here()) {
    const LssAddress device = blank.device;
    co_await answers_by_lss(device);
  }
}

// It has stored its node-ID, and uses another still: telling it again would wear its memory out. A power cycle that was
// not heard, and brought nothing, is thought of now and then.
rt::Task<bool> Network::waits_for_its_power_cycle(Seat& seat) {
  constexpr unsigned sometimes = 8;
  if (!seat.waiting || ++seat.looked_at % sometimes == 0) co_return false;
  const NodeId old = seat.waiting->old_id();
  const auto booted = old.configured() ? boots_.boot_up(old) : std::nullopt;
  if (booted && *booted > seat.since) co_return false;
  const auto id = co_await active_id(seat.waiting->seat().device);
  co_return !id || *id == old;
}

void Network::keep_for_its_device(Seat& seat) {
  seat.there = false;
  set_state(seat, SlotState::absent,
            fmt::format("{} may have node-ID {} in its memory and does not answer: the node-ID is kept for it; switch "
                        "it on, or give the slot away with `berth replace {}`",
                        to_string(seat.slot.record.asked->device), seat.id().value(), seat.name()));
}

void Network::name_unfinished() {
  for (const auto& blank : unfinished_here()) {
    const bool there = std::ranges::find(found_, blank.device, &places::Found::device) != found_.end();
    if (there || seat_of(blank.device) != nullptr) continue;
    const std::string id = blank.id.configured() ? fmt::format("node-ID {}", blank.id.value()) : "its node-ID";
    plan_.oddities.push_back(
        {"unfinished", blank.device, blank.id,
         fmt::format("device {} was to give up {} and does not answer: it may come back under it; switch it on, or "
                     "`berth forget {}` when it is gone for good",
                     to_string(blank.device), id, to_string(blank.device))});
  }
}

Result<void> Network::forget(const LssAddress& device) {
  if (loans_.of(device) != nullptr) {
    const auto ended = loans_.end(device);
    if (!ended) return ended;
    tell("forgotten", "", fmt::format("{} is no longer waited for", to_string(device)));
    return {};
  }
  const auto here = unfinished_here();
  if (std::ranges::find(here, device, &UnfinishedBlank::device) == here.end()) {
    return fail(Errc::not_found, "nothing unfinished is known of this device on this bus");
  }
  const auto dropped = store_->drop_blank(device, "a person said that it is gone for good");
  if (!dropped) return dropped;
  std::erase_if(plan_.oddities, [&](const places::Oddity& o) { return o.device == device && o.kind == "unfinished"; });
  tell("forgotten", "", fmt::format("{} is no longer waited for", to_string(device)));
  return {};
}

}  // namespace berth::operate
