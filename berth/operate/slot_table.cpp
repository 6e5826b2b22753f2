#include "berth/operate/slot_table.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <chrono>
#include <utility>

#include "berth/base/shell_word.hpp"
#include "berth/base/words.hpp"
#include "berth/decode/emcy_words.hpp"

namespace berth::operate {

using places::Mark;
using places::SlotState;
using places::UnfinishedBlank;

namespace {

constexpr rt::Duration former_pause = std::chrono::seconds(10);  // before a slot's former device is asked for again

}  // namespace

SlotTable::SlotTable(BusServices& services, std::string machine, std::vector<places::SlotSpec> specs,
                     places::SlotStore& store, NetworkObserver observer)
    : s_(services),
      bus_{std::move(machine), services.bus.name},
      store_(&store),
      events_(services.executor, services.bus.name, std::move(observer)) {
  for (auto& spec : specs) {
    seats_.push_back(std::make_unique<Seat>(services.executor, std::move(spec)));
  }
}

Result<void> SlotTable::open() {
  for (auto& seat : seats_) {
    auto slot = store_->declare(seat->slot.spec.name);
    if (!slot) return fail(slot.error());
    seat->slot.record.slot = *slot;
    seat->slot.record.name = seat->slot.spec.name;
    refresh(*seat);
    const auto cleared = forget_who_had_switches(*seat);
    if (!cleared) return cleared;
  }
  return {};
}

// A device without a serial number is identified by its node-ID: another node-ID means another device.
Result<void> SlotTable::forget_who_had_switches(Seat& seat) {
  const auto device = seat.slot.record.device();
  const bool other =
      seat.slot.spec.assign == places::Assign::fixed && device && device->at.configured() && device->at != seat.id();
  if (!other) return {};
  const auto cleared = store_->clear(seat.slot.record.slot, "its node-ID is another now, and it has no serial number");
  refresh(seat);
  return cleared;
}

Seat* SlotTable::at(NodeId id) const noexcept {
  const auto it = std::ranges::find_if(seats_, [&](const auto& s) { return s->id() == id; });
  return it == seats_.end() ? nullptr : it->get();
}

Seat* SlotTable::named(const std::string& name) const noexcept {
  const auto it = std::ranges::find_if(seats_, [&](const auto& s) { return s->name() == name; });
  return it == seats_.end() ? nullptr : it->get();
}

Seat* SlotTable::of(const Identity& device) const noexcept {
  const auto it = std::ranges::find_if(seats_, [&](const auto& s) { return s->slot.record.device() == device; });
  return it == seats_.end() ? nullptr : it->get();
}

std::vector<places::Slot> SlotTable::plain() const {
  std::vector<places::Slot> slots;
  for (const auto& seat : seats_) slots.push_back(seat->slot);
  return slots;
}

std::vector<SlotReport> SlotTable::report() const {
  std::vector<SlotReport> slots;
  for (const auto& seat : seats_) {
    SlotReport slot{s_.bus.name,         seat->id(),  seat->name(), seat->slot.spec.type, seat->slot.record.device(),
                    seat->shown_state(), seat->since, seat->reason, seat->letter(),       seat->slot.spec.asks.unasked};
    // An observer sends nothing, so it never learns which device this is.
    if (s_.only_observes() && slot.state == SlotState::empty && s_.boots.heard(seat->id())) {
      slot.state = SlotState::unknown;
      slot.reason = "a device sends under this node-ID; an observer asks nobody which one it is";
    }
    if (!seat->polled) {
      slot.reason += slot.reason.empty() ? "" : "; ";
      slot.reason += "it is not asked for until it is heard: polling was stopped";
    }
    // The last message of a device that has left is no state of the slot.
    if (slot.state != SlotState::empty) slot.heard = s_.boots.heard(seat->id());
    if (slot.heard && slot.state != SlotState::absent) slot.nmt = s_.boots.state(seat->id());
    if (const auto& error = seat->last.emergency) {
      slot.emcy = {error->message.code, error->message.error_register,
                   decode::emcy_words(error->message.code, seat->profile()), error->at, error->count};
    }
    slots.push_back(std::move(slot));
  }
  std::ranges::sort(slots, {}, &SlotReport::id);
  return slots;
}

bool SlotTable::operational() const noexcept {
  return std::ranges::all_of(seats_,
                             [](const auto& s) { return s->slot.spec.optional || s->life == Life::operational; });
}

void SlotTable::refresh(Seat& seat) {
  auto record = store_->load(seat.slot.record.slot);
  if (!record)
    return events_.tell(EventKind::error, seat.name(), "the slot table cannot be read: " + describe(record.error()));
  seat.slot.record = std::move(*record);
}

bool SlotTable::happened(Seat& seat, SlotEvent event, std::string reason, std::optional<manager::BootStatus> letter) {
  const SlotState before = seat.shown_state();
  const bool failed = seat.life == Life::unbound || seat.life == Life::doubled;
  if (!happened_silently(seat, event)) return false;
  if (letter) seat.set_letter(*letter);
  if (failed && event == SlotEvent::binds) {  // reported if it ends differently
    seat.last.failed = before;
    return true;
  }
  const SlotState state = seat.state();
  if (reason.empty() && seat.life == Life::operational) reason = seat.rate.how;
  if (before == state && seat.reason == reason) return true;
  if (before != state) seat.since = s_.executor.now();
  seat.reason = std::move(reason);
  events_.tell(EventKind::state, seat.name(),
               seat.reason.empty() ? places::name(state) : fmt::format("{}: {}", places::name(state), seat.reason));
  return true;
}

bool SlotTable::happened_silently(Seat& seat, SlotEvent event) noexcept {
  const auto to = next(seat.life, event);
  if (!to) return false;
  const Life before = std::exchange(seat.life, *to);
  seat.last.failed.reset();
  if (forgets_boot_up(before, event, *to)) seat.slave.forget();
  if (seat.there()) seat.last.seen = true;
  return true;
}

void SlotTable::set_absent(Seat& seat, const std::string& fact) {
  seat.absence = fact;
  const std::string advice =
      seat.offered ? fmt::format("{} of its type is on the bus and has no slot: `berth replace {}` gives it this one",
                                 to_string(*seat.offered), shell_word(seat.name()))
                   : "switch the device on, or `berth replace` it";
  happened(seat, SlotEvent::gone, fact + "; " + advice, manager::BootStatus::b);
}

Seat* SlotTable::with_record(places::SlotId slot) const noexcept {
  const auto it = std::ranges::find_if(seats_, [&](const auto& s) { return s->slot.record.slot == slot; });
  return it == seats_.end() ? nullptr : it->get();
}

Result<void> SlotTable::clear(Seat& seat, const std::string& reason) {
  const auto cleared = store_->clear(seat.slot.record.slot, reason);
  if (!cleared) return cleared;
  s_.unwatch(seat.id());
  if (seat.slot.record.confirmed) {
    seat.doubt.former_pause = former_pause;
    seat.doubt.former_at = s_.executor.now() + former_pause;
  }
  seat.slot.record.intended.reset();
  seat.slot.record.confirmed.reset();
  seat.slot.record.configured.reset();
  seat.power_cycle.binding.reset();
  seat.offered.reset();
  seat.configuration.waits_since.reset();
  seat.configuration.stuck = false;
  seat.configuration.failed_savings = 0;
  seat.guarded = false;
  seat.rate = {};
  seat.uncompared = {};
  happened(seat, SlotEvent::freed, reason);
  seat.last.seen = false;
  return {};
}

bool SlotTable::is_marked(Mark mark, const Identity& device) const {
  const auto marked = store_->is_marked(mark, known(device));
  return marked && *marked;
}

void SlotTable::set_mark(Mark mark, const Identity& device, NodeId id, const std::string& reason) {
  if (is_marked(mark, device)) return;
  const auto marked = store_->mark(mark, known(device), id, reason);
  if (!marked) events_.tell(EventKind::error, "", "the slot table cannot be written: " + describe(marked.error()));
}

void SlotTable::take_mark(Mark mark, const Identity& device, const std::string& reason) {
  if (!is_marked(mark, device)) return;
  const auto taken = store_->unmark(mark, known(device), reason);
  if (!taken) events_.tell(EventKind::error, "", "the slot table cannot be written: " + describe(taken.error()));
}

std::optional<places::FormerSeat> SlotTable::former_seat_of(const Identity& device) const {
  const auto lines = store_->history_of(known(device));
  return lines ? places::former_seat(*lines) : std::nullopt;
}

std::vector<UnfinishedBlank> SlotTable::unfinished_here() const {
  std::vector<UnfinishedBlank> here;
  const auto all = store_->unfinished_blanks();
  if (!all) return here;
  std::ranges::copy_if(*all, std::back_inserter(here),
                       [&](const UnfinishedBlank& b) { return b.who().on.covers(bus_); });
  return here;
}

void offer(SlotTable& slots, Seat& seat, const std::optional<Identity>& device) {
  if (std::exchange(seat.offered, device) != device && seat.life == Life::absent) slots.set_absent(seat, seat.absence);
}

bool has_vacancy_for(const SlotTable& slots, const Identity& device) {
  return std::ranges::any_of(slots.seats(), [&](const auto& seat) {
    const auto& spec = seat->slot.spec;
    return !seat->slot.record.device() && spec.assign == places::Assign::lss && places::fits(spec, device);
  });
}

}  // namespace berth::operate
