// Who is on the bus that no slot knows (paper 1 §III.b; S1.31), and what was found of whom.
#include <fmt/format.h>

#include <algorithm>

#include "berth/operate/network_seat.hpp"

namespace berth::operate {

using places::Action;

nodeid::DiscoveryOptions Network::discovery_options() const {
  nodeid::DiscoveryOptions o;
  o.t_resp = bus_->timing.rand_response;
  o.t_proc = bus_->timing.rand_processing;
  return o;
}

void Network::note_found(const places::Found& found) {
  const auto it = std::ranges::find(found_, found.device, &places::Found::device);
  if (it == found_.end()) {
    found_.push_back(found);
  } else {
    *it = found;
  }
}

void Network::forget_found(const LssAddress& device) {
  std::erase_if(found_, [&](const places::Found& f) { return f.device == device; });
}

// A device may come from another plant as "identified": everybody becomes unknown, then those who sit here become
// identified again (S1.31). While the machine runs this is not repeated: who comes new is unknown from power-on.
//
// These services are unconfirmed, and a device with a single-slot receive buffer loses what comes back to back: the
// first is sent twice, with pauses. Whoever misses the second is found once more, which costs time and nothing else.
rt::Task<void> Network::tell_who_is_known() {
  const rt::Duration apart = bus_->timing.rand_response;
  for (int time = 0; time < 2; ++time) {
    co_await rt::sleep_for(apart);
    const auto everybody = co_await rand_.switch_global(nodeid::Identification::unknown);
    if (!everybody) co_return;
  }
  co_await rt::sleep_for(apart);
  for (auto& seat : seats_) {
    const bool known = seat->there && seat->slot.record.confirmed;
    if (!known) continue;
    const LssAddress device = seat->slot.record.confirmed->device;
    const rt::Duration pause = lss_.options().inhibit;
    const auto told = co_await rand_.switch_selective(device, nodeid::Identification::identified, pause);
    if (!told) co_return;
  }
}

rt::Task<void> Network::discover() {
  phase_ = Phase::discovery;
  // Devices that wait without a seat are identified and would not answer: all are asked anew, who left is forgotten.
  const bool waiting = std::ranges::any_of(found_, [&](const auto& f) { return seat_of(f.device) == nullptr; });
  if (look_anew_ || waiting) {
    look_anew_ = false;
    anew_at_ = executor_->now() + 8 * bus_->timing.probe_period;
    std::erase_if(found_, [&](const places::Found& f) { return f.clone || seat_of(f.device) == nullptr; });
    co_await tell_who_is_known();
  }
  const nodeid::DiscoveryOptions options = discovery_options();
  known_before_ = std::exchange(heard_of_, {});
  news_ = false;
  nodeid::DiscoveryObserver* const watching = this;
  const auto report = co_await rand_.discover(options, watching);
  if (!report) {
    tell_once("error", "discovery: " + describe(report.error()));
    co_return;
  }
  tell_discovery(*report);
}

// The same devices found again and again, because they wait for a place, are told once.
void Network::found(const nodeid::Discovered& device) noexcept {
  heard_of_.push_back(device.address);
  if (std::ranges::find(known_before_, device.address) != known_before_.end()) return;
  news_ = true;
  tell("found", "",
       fmt::format("found {}{}", to_string(device.address), device.possible_clone ? ", answered twice" : ""));
}

void Network::tell_discovery(const nodeid::DiscoveryReport& report) {
  for (const auto& d : report.found) note_found({d.address, NodeId(), d.possible_clone});
  using End = nodeid::DiscoveryReport::End;
  if (report.end != End::complete) {
    tell_once("error",
              fmt::format("discovery ended early: {}; a device answers that cannot be identified", name(report.end)));
  }
  if (report.found.empty()) return;
  if (news_) {
    tell("step", "",
         fmt::format("discovery: {} found, {} requests, {:.3f} s", report.found.size(), report.requests,
                     seconds(report.ended) - seconds(report.began)));
  }
  reach("discovered");
}

// RAND tells no node-ID. Who will be bound is asked in its binding; the others must be known by the node-ID they hold,
// and so must bound devices that answered RAND: after a power-on they may be right where they belong.
rt::Task<void> Network::inquire_found(bool all) {
  const std::vector<places::Found> found = found_;
  for (const auto& f : found) {
    const Seat* seat = seat_of(f.device);
    const bool binds = std::ranges::any_of(plan_.actions, [&](const Action& a) { return a.device == f.device; });
    const bool asks = all || seat != nullptr || !binds;
    if (!asks || f.clone) continue;
    const auto id = co_await active_id(f.device);
    if (id) {
      const places::Found heard{f.device, *id, false};
      note_found(heard);
      co_await take_back(heard);
    } else if (id.error().code == Errc::duplicate) {
      note_found({f.device, f.active, true});
    } else if (seat == nullptr && id.error().code == Errc::timeout) {
      forget_found(f.device);  // it left
    }
  }
}

// A slot's own device under its own node-ID, whose boot-up nobody heard: it is checked and started like one that was.
rt::Task<void> Network::take_back(const places::Found& found) {
  const LssAddress device = found.device;
  Seat* const seat = seat_of(device);
  const bool home =
      seat != nullptr && seat->slot.record.confirmed && !seat->slot.record.asked && found.active == seat->id();
  if (!home) co_return;
  co_await ask_seat(*seat);
  if (seat->there) forget_found(device);
}

rt::Task<bool> Network::anybody_new() {
  if (bus_->role == design::Role::observer) co_return false;
  const nodeid::DiscoveryOptions options = discovery_options();
  const auto probe = co_await rand_.probe(options);
  co_return probe && probe->anybody;
}

}  // namespace berth::operate
