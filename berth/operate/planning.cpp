#include "berth/operate/planning.hpp"

#include <fmt/chrono.h>
#include <fmt/format.h>

#include <algorithm>

#include "berth/base/shell_word.hpp"
#include "berth/operate/asking.hpp"
#include "berth/operate/duplicates.hpp"
#include "berth/operate/plants_master.hpp"

namespace berth::operate {

using places::Action;
using places::Assign;
using places::Mark;
using places::UnfinishedBlank;

namespace {

/// For users: a date, or the time on a bus whose clock begins at 0.
std::string moment(std::int64_t stamp_ms) {
  constexpr std::int64_t year_2000_ms = 946'684'800'000;
  if (stamp_ms < year_2000_ms) return fmt::format("{:.3f} s", static_cast<double>(stamp_ms) / 1e3);
  return fmt::format("{:%Y-%m-%d %H:%M:%S} UTC", fmt::gmtime(static_cast<std::time_t>(stamp_ms / 1000)));
}

// Removing the plant's master stops a plant: it is not reported as foreign, and keeps its node-ID.
void respect_masters(places::Plan& plan, const FoundDevices& found, const auto& is_master) {
  for (auto& oddity : plan.oddities) {
    const auto* const node = found.of(oddity.device);
    const bool foreign = oddity.kind == places::OddityKind::foreign && node != nullptr;
    if (foreign && is_master(*node)) oddity.text = text_of_plants_master(*node);
  }
  std::erase_if(plan.actions, [&](const Action& a) {
    const auto* const node = found.of(a.device);
    return a.kind == Action::Kind::blank && node != nullptr && is_master(*node);
  });
}

}  // namespace

void Planning::make(const std::vector<places::Reading>& readings) {
  return_to_former_slots();
  found_.mark_loans();
  const std::vector<places::Found> found = without_used();
  plan_ = places::plan(slots_.plain(), found, blanks_to_finish(), s_.bus.master, readings);
  name_unfinished();
  name_loans();
  ask_about_used();
  name_returned();
  respect_fixed();
  respect_masters(plan_, found_,
                  [this](const places::Found& f) { return may_be_plants_master(s_, slots_, f, waits_for(f.device)); });
}

// A silent device whose slot Berth itself freed, and whose slot is still free, goes back there.
void Planning::return_to_former_slots() {
  for (const auto& f : found_.all()) {
    if (f.clone || slots_.of(f.device) != nullptr) continue;
    const auto sat = slots_.former_seat_of(f.device);
    if (!sat || sat->by_person) continue;
    Seat* const home = slots_.with_record(sat->slot);
    const bool free = home != nullptr && !home->slot.record.device() && !home->slot.spec.probe &&
                      home->slot.spec.assign == places::Assign::lss && places::fits(home->slot.spec, f.device);
    if (!free) continue;
    const auto asked = slots_.store().ask(sat->slot, {f.device, home->id()}, "it sat here before");
    if (asked) slots_.refresh(*home);
  }
}

// All but those that sat somewhere before and that no user has approved.
std::vector<places::Found> Planning::without_used() {
  used_.clear();
  std::vector<places::Found> rest;
  for (const auto& f : found_.all()) {
    // A device that was moved has sat elsewhere; its probe shows where it belongs.
    const bool by_probe = std::ranges::any_of(
        slots_.seats(), [&](const auto& s) { return s->slot.spec.probe && places::fits(s->slot.spec, f.device); });
    const bool known = f.clone || by_probe || !f.device.has_serial() || slots_.of(f.device) != nullptr ||
                       slots_.is_marked(Mark::restore, f.device);
    const auto sat = known ? std::nullopt : slots_.former_seat_of(f.device);
    const bool listed = sat && std::ranges::any_of(slots_.seats(), [&](const auto& s) {
                          return !s->slot.record.device() && places::listed_spare(s->slot.spec, f.device);
                        });
    if (listed) slots_.set_mark(Mark::restore, f.device, f.active, "a listed spare that was used before");
    if (!sat || listed) {
      rest.push_back(f);
      rest.back().keeps = never_by_lss(f.device);
    } else {
      used_.push_back({f, *sat});
    }
  }
  return rest;
}

// Only a device that is present can give up a node-ID.
std::vector<Identity> Planning::blanks_to_finish() const {
  std::vector<Identity> devices;
  for (const auto& blank : slots_.unfinished_here()) {
    const bool there = found_.of(blank.device) != nullptr;
    if (there) devices.push_back(blank.device);
  }
  return devices;
}

void Planning::name_unfinished() {
  for (const auto& blank : slots_.unfinished_here()) {
    const bool there = found_.of(blank.device) != nullptr;
    if (there || slots_.of(blank.device) != nullptr) continue;
    const std::string id = blank.id.configured() ? fmt::format("node-ID {}", blank.id.value()) : "its node-ID";
    plan_.oddities.push_back({places::OddityKind::unfinished, blank.device, blank.id,
                              fmt::format("device {} had to release {} and does not answer: it may come back with it; "
                                          "switch it on, or `berth forget {}` if it will not come back",
                                          to_string(blank.device), id, to_string(blank.device))});
  }
}

// An absent device may have power, and still the lent node-ID.
void Planning::name_loans() {
  for (const auto& loan : loans_.all()) {
    const bool there = found_.of(loan.device) != nullptr;
    if (there || !Loans::given_up(loan)) continue;
    plan_.oddities.push_back(
        {places::OddityKind::lent, loan.device, loan.id,
         fmt::format("device {} got the temporary node-ID {} during the search, and does not answer: no other device "
                     "gets this node-ID; switch it on, or `berth forget {}` if it will not come back",
                     to_string(loan.device), loan.id.value(), to_string(loan.device))});
  }
}

void Planning::ask_about_used() {
  for (const auto& [f, sat] : used_) {
    places::Question question;
    for (std::size_t i = 0; i < slots_.seats().size(); ++i) {
      const auto& slot = slots_.seats()[i]->slot;
      const bool planned = std::ranges::any_of(
          plan_.actions, [&](const Action& a) { return a.kind == Action::Kind::bind && a.slot == i; });
      const bool free = !slot.record.device() && slot.spec.assign == places::Assign::lss && !planned;
      if (free && places::fits(slot.spec, f.device)) question.slots.push_back(i);
    }
    release_node_id(f);
    if (question.slots.empty()) {
      plan_.oddities.push_back({places::OddityKind::returned, f.device, f.active, text_of_return(f.device, sat)});
      continue;
    }
    question.devices = {f.device};
    question.text = fmt::format(
        "device {} sat in {} until {}: use it again? `berth replace {} --used` gives it its factory settings and this "
        "slot; otherwise take it off the bus",
        to_string(f.device), place_of(sat), moment(sat.until_ms),
        shell_word(slots_.seats()[question.slots.front()]->name()));
    plan_.questions.push_back(std::move(question));
  }
}

// A device without a place may not wait under a node-ID that a slot or the master needs. A loan is taken back after the
// search, without a write to its memory.
void Planning::release_node_id(const places::Found& f) {
  const bool taken = !f.lent && f.active.configured() && (f.active == s_.bus.master || slots_.at(f.active) != nullptr);
  const bool planned = std::ranges::any_of(plan_.actions, [&](const Action& a) { return a.device == f.device; });
  if (!taken || planned) return;
  plan_.actions.insert(
      plan_.actions.begin(),
      Action{Action::Kind::blank, 0, f.device, fmt::format("it holds node-ID {} and has no slot", f.active.value())});
}

void Planning::name_returned() {
  for (auto& oddity : plan_.oddities) {
    if (oddity.kind != places::OddityKind::surplus) continue;
    const auto sat = slots_.former_seat_of(oddity.device);
    if (!sat) continue;
    oddity.kind = places::OddityKind::returned;
    oddity.text = text_of_return(oddity.device, *sat);
  }
  std::erase_if(returned_, [&](const places::Oddity& o) { return slots_.of(o.device) != nullptr; });
  for (const auto& each : returned_) {
    const bool named = std::ranges::any_of(plan_.oddities, [&](const auto& o) { return o.device == each.device; }) ||
                       std::ranges::any_of(used_, [&](const auto& u) { return u.found.device == each.device; });
    if (!named) plan_.oddities.push_back(each);
  }
}

void Planning::returned(const Identity& device, NodeId holds, const std::string& text) {
  std::erase_if(returned_, [&](const places::Oddity& o) { return o.device == device; });
  returned_.push_back({places::OddityKind::returned, device, holds, text});
}

bool Planning::waits_for(const Identity& device) const {
  const auto here = slots_.unfinished_here();
  return loans_.of(device) != nullptr || std::ranges::find(here, device, &UnfinishedBlank::device) != here.end();
}

void Planning::drop_unfinished(const Identity& device) {
  std::erase_if(plan_.oddities, [&](const places::Oddity& o) {
    return o.device == device && o.kind == places::OddityKind::unfinished;
  });
}

bool Planning::has_blanks() const noexcept {
  return std::ranges::any_of(plan_.actions, [](const Action& a) { return a.kind == Action::Kind::blank; });
}

std::string Planning::text_of_return(const Identity& device, const places::FormerSeat& sat) const {
  const Seat* const seat = slots_.with_record(sat.slot);
  const auto owner = seat == nullptr ? std::nullopt : seat->slot.record.device();
  return fmt::format("the device that sat in {} until {} is back: {}{}; take it off the bus", place_of(sat),
                     moment(sat.until_ms), to_string(device),
                     owner ? fmt::format("; the slot belongs to {} now", to_string(*owner)) : std::string());
}

std::string Planning::place_of(const places::FormerSeat& sat) const {
  const Seat* const seat = slots_.with_record(sat.slot);
  return seat == nullptr ? fmt::format("another place (node-ID {})", sat.id.value())
                         : fmt::format("slot {}", seat->name());
}

Result<Identity> Planning::used_for(const Seat& seat) const {
  std::vector<Identity> fitting;
  for (const auto& each : used_) {
    if (places::fits(seat.slot.spec, each.found.device)) fitting.push_back(each.found.device);
  }
  if (fitting.size() == 1) return fitting.front();
  if (fitting.empty()) return fail(Errc::not_found, "no used device waits for this slot");
  return fail(Errc::duplicate, "several used devices wait for this slot; name one with --device");
}

bool Planning::never_by_lss(const Identity& device) const {
  const auto booted = s_.boots.boot_up(found_.active_of(device));
  if (agenda_.out_of_lss.contains(device, booted, s_.executor.now())) return true;
  if (slots_.is_marked(Mark::fixed, device) || has_no_address(slots_, found_, device)) return true;
  bool any = false;
  for (const auto& seat : slots_.seats()) {
    if (!places::fits(seat->slot.spec, device)) continue;
    if (seat->slot.spec.assign == Assign::lss) return false;
    any = true;
  }
  return any;
}

// Removes from the plan what LSS cannot do, and reports the reason.
void Planning::respect_fixed() {
  std::vector<Identity> told;
  std::erase_if(plan_.actions, [&](const Action& a) {
    const bool bind = a.kind == Action::Kind::bind;
    const auto assign = bind ? slots_.seats()[a.slot]->slot.spec.assign : Assign::lss;
    if (assign == Assign::recipe) return true;  // `RecipeSeating`
    // It keeps its present node-ID.
    const bool home = bind && found_.uses(a.device, slots_.seats()[a.slot]->id());
    const bool drops = assign == Assign::fixed || (never_by_lss(a.device) && !home);
    if (drops) told.push_back(a.device);
    return drops;
  });
  for (const auto& oddity : plan_.oddities) {
    if (oddity.kind == places::OddityKind::fixed_mismatch) told.push_back(oddity.device);
  }
  std::ranges::sort(told);
  const auto twice = std::ranges::unique(told);
  told.erase(twice.begin(), twice.end());
  const auto by_recipe = [&](const Identity& device) {
    return std::ranges::any_of(slots_.seats(), [&](const auto& s) {
      return s->slot.spec.assign == Assign::recipe && places::fits(s->slot.spec, device);
    });
  };
  for (const auto& device : told) {
    if (by_recipe(device)) {
      std::erase_if(plan_.oddities, [&](const places::Oddity& o) {
        return o.device == device && o.kind == places::OddityKind::fixed_mismatch;
      });
      continue;
    }
    std::erase_if(plan_.oddities, [&](const places::Oddity& o) { return o.device == device; });
    tell_mismatch(device, found_.active_of(device));
  }
}

void Planning::tell_mismatch(const Identity& device, NodeId active) {
  std::string needed;
  std::string number;
  for (const auto& seat : slots_.seats()) {
    const auto sits = seat->slot.record.device();
    const bool waits = sits ? *sits == device : places::fits(seat->slot.spec, device);
    if (!waits || seat->id() == active) continue;
    needed += fmt::format("{}slot {} needs {}", needed.empty() ? "" : ", ", seat->name(), seat->id().value());
    if (number.empty()) number = fmt::format("{}", seat->id().value());
  }
  const Seat* const owner = active.configured() ? slots_.at(active) : nullptr;
  const bool at_home = owner != nullptr && places::fits(owner->slot.spec, device) &&
                       owner->slot.record.device().value_or(device) == device;
  if (at_home) return;  // it is taken as it is
  std::string text = fmt::format("device {} has {}, by its switches, plug or firmware", to_string(device),
                                 active.configured() ? fmt::format("node-ID {}", active.value()) : "a fixed node-ID");
  const auto* const found = found_.of(device);
  const bool blank = found != nullptr && found->lent;
  if (blank) text = fmt::format("device {} has no node-ID", to_string(device));
  if (owner != nullptr && !blank) text += fmt::format(", which belongs to slot {}", owner->name());
  text += needed.empty() ? "; no slot waits for it: take it off the bus"
                         : fmt::format("; {}: set its switches to {}, or put it into the place that has this coding",
                                       needed, number);
  plan_.oddities.push_back({places::OddityKind::fixed_mismatch, device, active, text});
}

namespace {

// A user may install the new device before saying anything about the old one.
void offer_replacements(SlotTable& slots, const places::Plan& plan) {
  for (const auto& seat : slots.seats()) {
    const auto fits = std::ranges::find_if(plan.oddities, [&](const places::Oddity& o) {
      return o.kind == places::OddityKind::surplus && places::fits(seat->slot.spec, o.device);
    });
    offer(slots, *seat, fits == plan.oddities.end() ? std::nullopt : std::optional(fits->device));
  }
}

}  // namespace

void Planning::report() {
  if (!agenda_.search_open) report_questions();  // a missing device may be found yet
  for (const auto& oddity : plan_.oddities) {
    slots_.events().tell_once(event_kind(oddity.kind), oddity.text);
    if (oddity.kind == places::OddityKind::fixed_mismatch) report_mismatch(oddity);
    if (oddity.kind == places::OddityKind::clone) report_clone(oddity);
  }
  offer_replacements(slots_, plan_);
}

void Planning::report_mismatch(const places::Oddity& oddity) {
  for (auto& seat : slots_.seats()) {
    const bool waits =
        !seat->slot.record.device() && seat->life != Life::question && places::fits(seat->slot.spec, oddity.device);
    if (waits) slots_.happened(*seat, SlotEvent::nobody, oddity.text);
    // Only a user can end this: the slot's own device is not alone at its node-ID.
    const bool shares = seat->id() == oddity.id && seat->there() && !seat->sits(oddity.device);
    if (shares) slots_.happened(*seat, SlotEvent::doubted, oddity.text);
  }
}

// A slot with an open question keeps that reason: it names more devices than the two with one address.
void Planning::report_clone(const places::Oddity& oddity) {
  for (auto& seat : slots_.seats()) {
    const auto device = seat->slot.record.device();
    const bool own = device == oddity.device;
    const bool another = std::ranges::any_of(plan_.actions, [&](const Action& a) {
      return a.kind == Action::Kind::bind && slots_.seats()[a.slot].get() == seat.get();
    });
    const bool waits =
        !device && !another && seat->life != Life::question && places::fits(seat->slot.spec, oddity.device);
    // LSS alone does not show the node-ID that both have. A slot that shows this already goes on doing so: otherwise
    // its reason would change at every round.
    const bool here = (waits && seat->doubt.by_two) || (own && seat->reason == Duplicates::reason);
    if (own || waits) slots_.happened(*seat, SlotEvent::doubted, here ? Duplicates::reason : oddity.text);
  }
}

// A slot shows one question, the last about it: otherwise its state would change at every round.
void Planning::report_questions() {
  for (const auto& event : question_events()) {
    slots_.events().tell_once(event);
  }
  std::vector<const Seat*> asked;
  for (auto question = plan_.questions.rbegin(); question != plan_.questions.rend(); ++question) {
    for (const auto i : question->slots) {
      Seat& seat = *slots_.seats()[i];
      if (std::ranges::find(asked, &seat) != asked.end()) continue;
      slots_.happened(seat, SlotEvent::asks_person, question->brief.empty() ? question->text : question->brief);
      asked.push_back(&seat);
    }
  }
  // Its devices left, or sit elsewhere.
  for (auto& seat : slots_.seats()) {
    const bool over = seat->life == Life::question && !seat->slot.record.device() &&
                      std::ranges::find(asked, seat.get()) == asked.end();
    // The end of the round sets the slot's new state.
    if (over) slots_.happened_silently(*seat, SlotEvent::answered);
  }
}

std::vector<Event> Planning::question_events() const {
  std::vector<Event> events;
  for (const auto& question : plan_.questions) {
    Event event{s_.executor.now(), s_.bus.name, EventKind::question, {}, question.text};
    for (const auto i : question.slots) event.slots.push_back(slots_.seats()[i]->name());
    for (const auto& device : question.devices) event.devices.push_back(to_string(device));
    events.push_back(std::move(event));
  }
  return events;
}

}  // namespace berth::operate
