// Spares and devices that return: who is kept for a slot, who was used elsewhere before, and what becomes of a device
// whose slot was given away while it was gone.
#include <fmt/chrono.h>
#include <fmt/format.h>

#include <algorithm>

#include "berth/operate/network_seat.hpp"

namespace berth::operate {

using places::Action;
using places::Mark;
using places::SlotState;

namespace {

constexpr std::uint32_t load_signature = 0x6461'6F6C;  // "load", CiA 301 §7.5.2.14
constexpr std::size_t most_formers = 4;                // of one slot that are looked for

/// For people: a date, or the time on a bus whose clock begins at 0.
std::string moment(std::int64_t stamp_ms) {
  constexpr std::int64_t year_2000_ms = 946'684'800'000;
  if (stamp_ms < year_2000_ms) return fmt::format("{:.3f} s", static_cast<double>(stamp_ms) / 1e3);
  return fmt::format("{:%Y-%m-%d %H:%M:%S} UTC", fmt::gmtime(static_cast<std::time_t>(stamp_ms / 1000)));
}

}  // namespace

bool Network::is_marked(Mark mark, const LssAddress& device) const {
  const auto marked = store_->is_marked(mark, device);
  return marked && *marked;
}

void Network::set_mark(Mark mark, const LssAddress& device, NodeId id, const std::string& reason) {
  if (is_marked(mark, device)) return;
  const auto marked = store_->mark(mark, device, id, reason);
  if (!marked) tell("error", "", "the slot table cannot be written: " + describe(marked.error()));
}

void Network::take_mark(Mark mark, const LssAddress& device, const std::string& reason) {
  if (!is_marked(mark, device)) return;
  const auto taken = store_->unmark(mark, device, reason);
  if (!taken) tell("error", "", "the slot table cannot be written: " + describe(taken.error()));
}

std::optional<places::FormerSeat> Network::former_seat_of(const LssAddress& device) const {
  const auto lines = store_->history_of(device);
  return lines ? places::former_seat(*lines) : std::nullopt;
}

std::string Network::place_of(const places::FormerSeat& seat) const {
  const auto it = std::ranges::find_if(seats_, [&](const auto& s) { return s->slot.record.slot == seat.slot; });
  return it == seats_.end() ? fmt::format("another place (node-ID {})", seat.id.value())
                            : fmt::format("slot {}", (*it)->name());
}

// ---- listed spares ----

// Listing a spare is the person's answer beforehand: a slot whose device is silent goes to its spare when that comes.
void Network::free_for_spares() {
  for (auto& seat : seats_) {
    const bool silent = seat->state == SlotState::absent && seat->slot.record.confirmed && !seat->slot.record.asked;
    if (!silent) continue;
    const auto spare = std::ranges::find_if(found_, [&](const places::Found& f) {
      return !f.clone && seat_of(f.device) == nullptr && places::listed_spare(seat->slot.spec, f.device);
    });
    if (spare == found_.end()) continue;
    const auto cleared =
        clear_seat(*seat, fmt::format("it is silent, and its listed spare {} is there", to_string(spare->device)));
    if (!cleared) tell("error", seat->name(), describe(cleared.error()));
  }
}

// ---- used spares ----

// A device whose slot Berth itself freed, because it was silent, and that is still free: it goes back there.
void Network::send_home() {
  for (const auto& f : found_) {
    if (f.clone || seat_of(f.device) != nullptr) continue;
    const auto sat = former_seat_of(f.device);
    if (!sat || sat->by_person) continue;
    const auto home = std::ranges::find_if(seats_, [&](const auto& s) { return s->slot.record.slot == sat->slot; });
    const bool free = home != seats_.end() && !(*home)->slot.record.device() && !(*home)->slot.spec.probe &&
                      (*home)->slot.spec.assign == places::Assign::lss && places::fits((*home)->slot.spec, f.device);
    if (!free) continue;
    const auto asked = store_->ask(sat->slot, {f.device, (*home)->id()}, "it sat here before");
    if (asked) refresh(**home);
  }
}

// Everybody but those who sat somewhere before and of whom nobody has said that they may be used.
std::vector<places::Found> Network::without_used() {
  used_.clear();
  std::vector<places::Found> rest;
  for (const auto& f : found_) {
    // A device that a mechanic moved has sat elsewhere; where it belongs its probe says.
    const bool by_probe = std::ranges::any_of(
        seats_, [&](const auto& s) { return s->slot.spec.probe && places::fits(s->slot.spec, f.device); });
    const bool known = f.clone || by_probe || seat_of(f.device) != nullptr || is_marked(Mark::restore, f.device);
    const auto sat = known ? std::nullopt : former_seat_of(f.device);
    const bool listed = sat && std::ranges::any_of(seats_, [&](const auto& s) {
                          return !s->slot.record.device() && places::listed_spare(s->slot.spec, f.device);
                        });
    if (listed) set_mark(Mark::restore, f.device, f.active, "a listed spare that was used before");
    if (!sat || listed) {
      rest.push_back(f);
    } else {
      used_.push_back({f, *sat});
    }
  }
  return rest;
}

void Network::ask_about_used() {
  for (const auto& [f, sat] : used_) {
    places::Question question;
    for (std::size_t i = 0; i < seats_.size(); ++i) {
      const auto& slot = seats_[i]->slot;
      const bool planned = std::ranges::any_of(
          plan_.actions, [&](const Action& a) { return a.kind == Action::Kind::bind && a.slot == i; });
      const bool free = !slot.record.device() && slot.spec.assign == places::Assign::lss && !planned;
      if (free && places::fits(slot.spec, f.device)) question.slots.push_back(i);
    }
    keep_off(f);
    if (question.slots.empty()) {
      plan_.oddities.push_back({"returned", f.device, f.active, text_of_return(f.device, sat)});
      continue;
    }
    question.devices = {f.device};
    question.text = fmt::format(
        "device {} sat in {} until {}: shall it be used again? `berth replace {} --used` gives it its factory settings "
        "and this slot; else take it off the bus",
        to_string(f.device), place_of(sat), moment(sat.until_ms), seats_[question.slots.front()]->name());
    plan_.questions.push_back(std::move(question));
  }
}

// A device that waits may not wait under a node-ID that somebody needs.
void Network::keep_off(const places::Found& f) {
  const bool taken = f.active.configured() && (f.active == bus_->master || seat_at(f.active) != nullptr);
  const bool planned = std::ranges::any_of(plan_.actions, [&](const Action& a) { return a.device == f.device; });
  if (!taken || planned) return;
  plan_.actions.insert(
      plan_.actions.begin(),
      Action{Action::Kind::blank, 0, f.device, fmt::format("it holds node-ID {} and has no slot", f.active.value())});
}

// ---- a device that returns after its slot was given away ----

std::string Network::text_of_return(const LssAddress& device, const places::FormerSeat& sat) const {
  const auto it = std::ranges::find_if(seats_, [&](const auto& s) { return s->slot.record.slot == sat.slot; });
  const auto owner = it == seats_.end() ? std::nullopt : (*it)->slot.record.device();
  return fmt::format("the device that sat in {} until {} is back: {}{}; take it off the bus", place_of(sat),
                     moment(sat.until_ms), to_string(device),
                     owner ? fmt::format("; the slot belongs to {} now", to_string(*owner)) : std::string());
}

void Network::name_returned() {
  for (auto& oddity : plan_.oddities) {
    if (oddity.kind != "surplus") continue;
    const auto sat = former_seat_of(oddity.device);
    if (!sat) continue;
    oddity.kind = "returned";
    oddity.text = text_of_return(oddity.device, *sat);
  }
  std::erase_if(returned_, [&](const places::Oddity& o) { return seat_of(o.device) != nullptr; });
  for (const auto& each : returned_) {
    const bool named = std::ranges::any_of(plan_.oddities, [&](const auto& o) { return o.device == each.device; }) ||
                       std::ranges::any_of(used_, [&](const auto& u) { return u.found.device == each.device; });
    if (!named) plan_.oddities.push_back(each);
  }
}

// The devices that may have this slot's node-ID in their memory and sit nowhere now, newest first: they sat here, were
// told it once and never heard under it, or were to give it up.
std::vector<LssAddress> Network::formers_of(const Seat& seat) {
  std::vector<LssAddress> devices;
  const auto lines = store_->history(seat.slot.record.slot);
  if (!lines) return devices;
  for (auto line = lines->rbegin(); line != lines->rend() && devices.size() < most_formers; ++line) {
    const bool told = (line->event == "confirmed" || line->event == "asked") && line->device && line->id == seat.id();
    if (!told || seat_of(*line->device) != nullptr) continue;
    if (std::ranges::find(devices, *line->device) == devices.end()) devices.push_back(*line->device);
  }
  for (const auto& blank : unfinished_here()) {
    const bool known = std::ranges::find(devices, blank.device) != devices.end();
    if (blank.id == seat.id() && !known && seat_of(blank.device) == nullptr) devices.push_back(blank.device);
  }
  return devices;
}

// Two devices under one node-ID cannot be told apart by SDO. By LSS they can: who sat here before is asked for by its
// address, and gives the node-ID up. That takes an NMT reset, which the slot's own device does too: it is checked and
// started again at its boot-up.
rt::Task<bool> Network::isolate_former(Seat& seat) {
  if (bus_->role == design::Role::observer || !seat.slot.record.confirmed) co_return false;
  const std::vector<LssAddress> formers = formers_of(seat);
  bool any = false;
  bool silent = false;
  for (const auto& device : formers) {
    Result<NodeId> id = co_await ask_active_id(device);
    const bool slowly = !id && seat.suspected > 0;
    if (slowly) id = co_await active_id(device);
    silent = silent || !id;
    if (!id || *id != seat.id()) continue;
    const auto sat = former_seat_of(device);
    const std::string text =
        sat ? text_of_return(device, *sat)
            : fmt::format("a device that sat in slot {} is back: {}", seat.name(), to_string(device));
    tell("returned", seat.name(), text);
    const std::string reason = "its slot was given to another device";
    const bool gone = co_await blank(device, reason);
    std::erase_if(returned_, [&](const places::Oddity& o) { return o.device == device; });
    returned_.push_back({"returned", device, gone ? NodeId() : *id, text});
    any = true;
  }
  // What spoke here may have been one that did not hear the question: it is asked for twice more.
  seat.suspect = silent && !any && ++seat.suspected < 3;
  if (!seat.suspect) seat.suspected = 0;
  if (seat.suspect) look_anew_ = true;
  co_return any;
}

// ---- factory settings ----

// Before a device is configured for the first time in a slot that another had: a configuration that is not of this
// slot says that it comes from somewhere. False: it waits for a person, or it is gone.
rt::Task<bool> Network::clear_past(Seat& seat) {
  if (bus_->role == design::Role::observer) co_return true;
  const LssAddress device = seat.slot.record.confirmed->device;
  const bool fresh = std::exchange(seat.fresh, false);
  bool restores = is_marked(Mark::restore, device);
  bool asks = is_marked(Mark::looks_used, device);
  const bool spare = fresh && !restores && !asks && had_another(seat, device);
  if (spare) {
    const auto dated = co_await foreign_date(seat);
    if (!dated) {
      seat.fresh = true;
      seat.there = false;
      set_state(seat, SlotState::absent, "its configuration date cannot be read: " + describe(dated.error()));
      co_return false;
    }
    const bool welcome =
        std::ranges::find(welcome_, device) != welcome_.end() || places::listed_spare(seat.slot.spec, device);
    restores = *dated && welcome;
    asks = *dated && !welcome;
    if (restores) set_mark(Mark::restore, device, seat.id(), "it has a configuration of somewhere else");
    if (asks) set_mark(Mark::looks_used, device, seat.id(), "it has a configuration of somewhere else");
  }
  if (asks) {
    set_state(seat, SlotState::question,
              fmt::format("device {} has a configuration that is not of this slot (1020h): shall it be used? `berth "
                          "replace {} --used` gives it its factory settings first; else take it off the bus",
                          to_string(device), seat.name()));
    co_return false;
  }
  if (!restores) co_return true;
  co_return co_await restore_seat(seat);
}

bool Network::had_another(const Seat& seat, const LssAddress& device) const {
  const auto lines = store_->history(seat.slot.record.slot);
  return lines && std::ranges::any_of(*lines, [&](const places::HistoryEntry& line) {
           return line.event == "confirmed" && line.device != device;
         });
}

rt::Task<Result<bool>> Network::foreign_date(Seat& seat) {
  const NodeId id = seat.id();
  const auto days = co_await sdo_.read<std::uint32_t>(id, 0x1020, 1);
  if (!days && days.error().code != Errc::aborted) co_return fail(days.error());
  if (!days || *days == 0) co_return false;
  const auto ms = co_await sdo_.read<std::uint32_t>(id, 0x1020, 2);
  if (!ms && ms.error().code != Errc::aborted) co_return fail(ms.error());
  if (!seat.configuration) co_return true;
  const auto wanted = co_await wanted_of(seat);
  if (!wanted) co_return fail(wanted.error());
  const manager::ConfigurationDate has{*days, ms.value_or(0)};
  co_return has != wanted->date;
}

// 1011h:01 "load", then a reset: the device has its factory settings, perhaps no node-ID, and then is bound again.
rt::Task<bool> Network::restore_seat(Seat& seat) {
  const NodeId id = seat.id();
  const LssAddress device = seat.slot.record.confirmed->device;
  co::SdoOptions patience = sdo_.options();
  patience.timeout = bus_->timing.save_timeout;
  const auto loaded = co_await sdo_.write<std::uint32_t>(id, 0x1011, 1, load_signature, patience);
  if (!loaded && loaded.error().code != Errc::aborted) {
    seat.there = false;
    set_state(seat, SlotState::absent, "its factory settings could not be asked for: " + describe(loaded.error()));
    co_return false;
  }
  if (!loaded) {
    tell("restored", seat.name(), "it cannot restore its factory settings (1011h): " + describe(loaded.error()));
    take_mark(Mark::restore, device, "it has no 1011h, or refuses");
    co_return true;
  }
  if (!may_command()) {
    set_state(seat, SlotState::power_cycle, "its factory settings are in use when it was switched off and on");
    take_mark(Mark::restore, device, "loaded; in use after a power cycle");
    co_return false;
  }
  const rt::Time began = executor_->now();
  const auto sent = co_await nmt_.send(co::NmtCommand::reset_node, id);
  if (!sent) {
    set_state(seat, SlotState::failed, "it could not be reset: " + describe(sent.error()));
    co_return false;
  }
  const bool booted = co_await boots_.wait(id, began, began + bus_->timing.boot_timeout);
  take_mark(Mark::restore, device, booted ? "loaded, and booted with them" : "loaded, and reset");
  tell("restored", seat.name(), fmt::format("{} has its factory settings", to_string(device)));
  const auto who = co_await places::Binder::read_identity(sdo_, id);
  const bool same = who && *who == device;
  seat.checked = executor_->now();
  if (same) co_return true;
  seat.there = false;
  look_anew_ = true;
  set_state(seat, SlotState::absent, "it did not come back under its node-ID when it got its factory settings");
  co_await look_by_lss(seat);
  co_return false;
}

// ---- what a person says ----

// Who of those that wait is meant by `--used`: the one that sits in the slot already, or the only one that fits.
Result<std::optional<LssAddress>> Network::used_for(const Seat& seat) const {
  std::vector<LssAddress> fitting;
  for (const auto& each : used_) {
    if (places::fits(seat.slot.spec, each.found.device)) fitting.push_back(each.found.device);
  }
  if (fitting.size() == 1) return std::optional(fitting.front());
  if (fitting.empty()) return fail(Errc::not_found, "no used device waits for this slot");
  return fail(Errc::duplicate, "several used devices wait for this slot; name one with --device");
}

// A person named this device, or said that a used one may be used.
void Network::make_welcome(const LssAddress& device) {
  welcome_.push_back(device);
  if (former_seat_of(device)) set_mark(Mark::restore, device, NodeId(), "a person said that it may be used again");
  take_mark(Mark::looks_used, device, "a person said that it may be used");
  take_mark(Mark::fixed, device, "a person named it: it is tried again");
}

}  // namespace berth::operate
