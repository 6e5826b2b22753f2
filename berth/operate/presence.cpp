#include "berth/operate/presence.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>

#include "berth/base/shell_word.hpp"
#include "berth/co/guarding.hpp"
#include "berth/operate/duplicates.hpp"
#include "berth/operate/error_control.hpp"
#include "berth/places/odd_identity.hpp"
#include "berth/rt/scope.hpp"

namespace berth::operate {

namespace {

// The first part of its identity that differs from the expected one (1F85h to 1F88h).
manager::BootStatus letter_of(const Identity& is, const Identity& expected) noexcept {
  constexpr std::array letters{manager::BootStatus::d, manager::BootStatus::m, manager::BootStatus::n};
  for (unsigned i = 0; i < letters.size(); ++i) {
    const bool both = is.knows(i) && expected.knows(i);
    if (both && is.address.part(i) != expected.address.part(i)) return letters[i];
  }
  return manager::BootStatus::o;
}

// `who` answered under its node-ID, once or twice: are there two devices? CAN sometimes repeats a frame, and two
// devices do not always answer at different moments. When Berth begins, two devices with one node-ID on their switches
// may both be silent, and one may lose a question.
rt::Task<bool> is_shared(co::SdoClient& sdo, const Seat& seat, Identity who, bool by_two) {
  const bool news = by_two != (seat.life == Life::doubled);
  const bool begins = seat.life == Life::unknown && seat.slot.spec.assign == places::Assign::fixed;
  if (by_two && !news) co_return true;
  const int looks = news ? 3 : begins ? 1 : 0;
  for (int look = 0; look < looks; ++look) {
    const auto again = co_await places::identify(sdo, seat.id(), places::second_answer);
    if (again.by_two || (again.who && seat.sits(*again.who) != seat.sits(who))) co_return true;
  }
  co_return false;
}

}  // namespace

rt::Task<void> Presence::prepare() {
  const bool any =
      std::ranges::any_of(slots_.seats(), [](const auto& s) { return s->slot.record.confirmed.has_value(); });
  if (!any) co_return;
  agenda_.phase = Phase::preparation;
  slots_.events().tell(EventKind::step, "", "preparation: looking for the devices of the bound slots");
  const rt::Time began = s_.executor.now();
  const rt::Time deadline = began + s_.bus.timing.heartbeat_period + s_.bus.timing.heartbeat_period / 4;
  const auto all_heard = [&] {
    return std::ranges::all_of(slots_.seats(), [&](const auto& s) {
      const auto heard = s_.boots.heard(s->id());
      return !s->slot.record.confirmed || (heard && *heard >= began);
    });
  };
  while (s_.executor.now() < deadline && !all_heard()) {
    co_await rt::sleep_for(s_.bus.timing.heartbeat_period / 16 + std::chrono::milliseconds(1));
  }
  rt::Scope asked(s_.executor, asking_.most_at_once());
  for (auto& seat : slots_.seats()) {
    if (seat->slot.record.confirmed) asked.spawn(ask_seat(*seat));
  }
  co_await asked.join();
  for (auto& seat : slots_.seats()) {
    const bool silent = seat->slot.record.confirmed && !seat->there();
    if (silent) co_await look_by_lss(*seat);
  }
}

rt::Task<Presence::Sign> Presence::sign_of_life(NodeId id) {
  Seat* const seat = slots_.at(id);
  const rt::Duration patience =
      seat == nullptr ? s_.bus.timing.heartbeat_timeout : heartbeat_timeout(s_.bus.timing, *seat);
  const bool beats = s_.heard_within(id, patience);
  const bool untyped = seat != nullptr && seat->last.untyped;  // letter B is asked again, although it sends
  if (beats && !untyped) co_return Sign{true, s_.boots.state(id)};
  const rt::Time asked = s_.executor.now();
  const auto type = co_await s_.sdo.read<std::uint32_t>(id, 0x1000, 0);
  const bool typed = type || type.error().code == Errc::aborted;
  if (typed && seat != nullptr) seat->last.typed = asked;
  if (typed) co_return Sign{true, beats ? std::optional(s_.boots.state(id)) : std::nullopt};
  if (untyped) {
    const auto vendor = co_await s_.sdo.read<std::uint32_t>(id, 0x1018, 1);
    if (vendor || vendor.error().code == Errc::aborted) co_return Sign{true, std::nullopt, false};
  }
  if (beats) co_return Sign{true, s_.boots.state(id)};
  const auto guarded = co_await co::guard_once(s_.dispatcher, id, s_.bus.timing.guard_timeout, s_.bus.timing.tries);
  if (!guarded) co_return Sign{};
  co_return Sign{true, guarded->state};
}

// An observer asks nothing: it only knows that the slot's device sends under its node-ID.
void Presence::hear_seat(Seat& seat) {
  const NodeId id = seat.id();
  const rt::Duration patience = heartbeat_timeout(s_.bus.timing, seat);
  seat.checked = s_.executor.now();
  if (!s_.heard_within(id, patience)) {
    slots_.set_absent(seat, fmt::format("no heartbeat from node-ID {}, and an observer sends nothing", id.value()));
    return;
  }
  s_.heartbeats.supervise(id, patience);
  const bool runs = s_.boots.state(id) == NmtState::operational;
  slots_.happened(seat, runs ? SlotEvent::runs : SlotEvent::identified, "by its heartbeat alone");
  seat.slave.status.phase = runs ? network::SlavePhase::started : network::SlavePhase::ready;
}

rt::Task<void> Presence::ask_seat(Seat& seat) {
  if (s_.only_observes()) {
    hear_seat(seat);
    co_return;
  }
  const NodeId id = seat.id();
  const Sign sign = co_await sign_of_life(id);
  seat.checked = s_.executor.now();
  if (!sign.alive) {
    seat.last.untyped = false;
    slots_.set_absent(seat, fmt::format("no heartbeat, SDO or guarding answer from node-ID {}", id.value()));
    co_return;
  }
  if (!sign.typed) co_return slots_.set_absent(seat, Seat::no_type);
  seat.last.untyped = false;
  const bool shares = sign.state != NmtState::operational && waits_beside_another(seat);
  if (shares) co_return;
  const bool own = co_await is_its_own(seat, sign.state);
  if (!own) co_return;
  const bool stays = co_await places_.stays_in_place(seat);
  if (!stays) co_return;
  if (sign.state != NmtState::operational || configuring_.rebooted(seat)) {
    slots_.happened(seat, SlotEvent::identified);
    if (seat.held) seat.slave.status.phase = network::SlavePhase::awaited;
    co_return;
  }
  co_await take_running(seat);
}

rt::Task<void> Presence::take_running(Seat& seat) {
  ErrorControl control(s_, slots_);
  co_await control.watch_running(seat);
  slots_.happened(seat, SlotEvent::runs, {}, manager::BootStatus::l);
  seat.slave.status.phase = network::SlavePhase::started;
  if (seat.configuration.wanted) co_await configuring_.look_at_running(seat);
}

// False: the slot's state gives the reason, and shows whether its device is there.
rt::Task<bool> Presence::is_its_own(Seat& seat, std::optional<NmtState> state) {
  const NodeId id = seat.id();
  // A second device's answer may come a little after the first one's.
  const auto answer = co_await places::identify(s_.sdo, id, places::second_answer);
  const auto& who = answer.who;
  if (!who) {
    // Stopped devices have no SDO; only their error control identifies them (the paper's figure).
    const bool stopped = state == NmtState::stopped;
    if (!stopped) {
      // An unanswered question to an absent device is no news; how it left is the better reason.
      const auto heard = s_.boots.heard(id);
      const bool away = seat.life == Life::absent && !seat.absence.empty() && (!heard || *heard <= seat.since);
      if (!away) slots_.set_absent(seat, "its identity cannot be read: " + describe(who.error()));
      co_return false;
    }
    take_stopped(seat);
    co_return false;
  }
  const bool doubled = co_await is_shared(s_.sdo, seat, *who, answer.by_two);
  if (!doubled && seat.sits(*who)) co_return true;
  if (!doubled) {
    const Identity said = *who;
    const bool excused = co_await is_it_all_the_same(seat, said);
    if (excused) co_return true;
  }
  const bool replaces =
      !doubled && seat.slot.spec.assign == places::Assign::fixed && places::fits(seat.slot.spec, *who);
  if (replaces) {
    const Identity device = *who;
    co_await take_replacement(seat, device);
    co_return false;
  }
  seat.doubt.shared = Duplicates::most_tries;
  agenda_.look_anew = true;
  if (doubled) {
    slots_.happened(seat, SlotEvent::two_answer, Duplicates::reason, manager::BootStatus::booted);
  } else {
    slots_.happened(seat, SlotEvent::gone, fmt::format("device {} answers under its node-ID", to_string(*who)),
                    letter_of(*who, seat.slot.record.confirmed->device));
  }
  co_return false;
}

// Its 1018h changes, or differs from its LSS address. Each device that answers is asked once.
rt::Task<bool> Presence::is_it_all_the_same(Seat& seat, Identity who) {
  if (std::exchange(seat.doubt.other, who) == who) co_return false;
  const Identity expected = seat.slot.record.confirmed->device;
  const bool asks_lss = seat.slot.spec.assign == places::Assign::lss && !asking_.has_equals(expected);
  const auto services = asking_.binder_services();
  const auto excused = co_await places::excuse(services, seat.id(), who, expected, asks_lss, &s_.lss_turn);
  if (!excused.any()) co_return false;
  take_uncompared(seat, excused);
  co_return true;
}

void Presence::take_uncompared(Seat& seat, const places::Uncompared& parts) {
  seat.uncompared = parts;
  seat.doubt.other = {};
  slots_.events().tell_once(EventKind::step, fmt::format("{}: {}", seat.name(), places::words_of(parts)));
}

// A new device whose switches, plug or firmware set its node-ID.
rt::Task<void> Presence::take_replacement(Seat& seat, Identity device) {
  const Identity& before = seat.slot.record.confirmed->device;
  if (seat.slot.spec.replacement != places::Replacement::automatic) {
    slots_.happened(seat, SlotEvent::gone,
                    fmt::format("device {} answers under its node-ID instead of {}: `berth replace {}` takes it, or "
                                "replacement = \"auto\" in the machine file",
                                to_string(device), to_string(before), shell_word(seat.name())),
                    letter_of(device, before));
    co_return;
  }
  const auto cleared = slots_.clear(seat, fmt::format("{} has its fixed node-ID now, and the machine file says "
                                                      "replacement = \"auto\"",
                                                      to_string(device)));
  if (!cleared) {
    slots_.happened(seat, SlotEvent::binding_failed, places::words_of(cleared.error()));
    co_return;
  }
  co_await adopt_fixed(seat);
}

// A user or another master stopped it before this Berth began: it stays so unless the machine file says otherwise.
void Presence::take_stopped(Seat& seat) {
  const NodeId id = seat.id();
  if (!seat.guarded) s_.heartbeats.supervise(id, heartbeat_timeout(s_.bus.timing, seat));
  const bool starts = s_.bus.startup.starts_stopped && s_.may_command() && !seat.held;
  if (starts) s_.nmt.queue(co::NmtCommand::enter_pre_operational, id);
  slots_.happened(seat, SlotEvent::stopped,
                  starts ? "it is in NMT stopped: it is made pre-operational, and booted"
                         : fmt::format("it is in NMT stopped; `berth nmt start {}` starts it", id.value()));
}

const Identity* Presence::other_at(const Seat& seat) const noexcept {
  for (const auto& each : slots_.seats()) {
    const bool waits =
        each.get() != &seat && each->power_cycle.binding && each->power_cycle.binding->old_id() == seat.id();
    if (waits) return &each->power_cycle.binding->assignment().device;
  }
  return erased_.user_of(seat.id());
}

// It is asked again, like any slot's absent device.
bool Presence::waits_beside_another(Seat& seat) {
  const Identity* const other = other_at(seat);
  if (other == nullptr) return false;
  slots_.happened(seat, SlotEvent::waits_for_power, ErasedNodeIds::reason(*other));
  return true;
}

rt::Task<void> Presence::look_by_lss(Seat& seat) {
  if (seat.life == Life::doubled || s_.only_observes()) co_return;
  const Identity device = seat.slot.record.confirmed->device;
  const auto id = co_await asking_.active_id(device);
  if (!id) co_return;
  found_.note({device, *id});
}

// 1000h first, then the vendor-ID: one of the two may be lost, and a device may not answer 1000h.
rt::Task<bool> Presence::answers_first(Seat& seat) {
  const NodeId id = seat.id();
  const co::SdoOptions how = asking_.first_patience();
  const auto answers = [](const auto& read) { return read || read.error().code == Errc::aborted; };
  const auto type = co_await s_.sdo.read<std::uint32_t>(id, 0x1000, 0, how);
  if (answers(type)) co_return true;
  const auto vendor = co_await s_.sdo.read<std::uint32_t>(id, 0x1018, 1, how);
  if (answers(vendor)) {
    const auto again = co_await s_.sdo.read<std::uint32_t>(id, 0x1000, 0);
    if (answers(again)) co_return true;
    seat.last.untyped = true;
    slots_.set_absent(seat, Seat::no_type);
    co_return false;
  }
  // The previous device left, or no longer answers.
  const bool other = seat.life == Life::stranger;
  const bool told = other || seat.life == Life::absent;
  if (told && !s_.heard_within(id, s_.bus.timing.heartbeat_timeout)) {
    slots_.happened(seat, SlotEvent::nobody,
                    other ? "the device of another type that had its node-ID has left" : "no device has its node-ID");
  }
  co_return false;
}

rt::Task<void> Presence::adopt_fixed(Seat& seat) {
  const NodeId id = seat.id();
  const bool there = co_await answers_first(seat);
  if (!there) co_return;
  const auto answer = co_await places::identify(s_.sdo, id, places::second_answer);
  const auto& who = answer.who;
  if (!who) co_return;
  if (answer.by_two) {  // the parts may be those of two devices
    slots_.happened(seat, SlotEvent::two_answer, Duplicates::reason, manager::BootStatus::booted);
    co_return;
  }
  Identity device = seat.uncompared.of(*who).with(id);
  if (!places::fits(seat.slot.spec, device) && seat.life != Life::stranger) {
    const bool by_lss = false;
    const auto services = asking_.binder_services();
    const auto changes = co_await places::excuse(services, id, device, device, by_lss, nullptr);
    if (changes.any()) take_uncompared(seat, changes);
    device = changes.of(device).with(id);
  }
  if (!places::fits(seat.slot.spec, device)) {
    const TypeCode& wanted = seat.slot.spec.type;
    // It may belong to another slot and be moved there.
    const bool fresh = who->unknown == 0 && !found_.uses(*who, id) && slots_.of(*who) == nullptr;
    if (fresh) found_.note({*who, id});
    agenda_.look_anew = agenda_.look_anew || fresh;
    slots_.happened(seat, SlotEvent::wrong_type, fmt::format("device {} has its node-ID", to_string(*who)),
                    letter_of(*who, Identity(wanted.vendor, wanted.product, 0, 0)));
    co_return;
  }
  const places::Assignment wanted{device, id};
  const auto asked = slots_.store().ask(seat.slot.record.slot, wanted, "found under its fixed node-ID");
  const auto confirmed =
      asked ? slots_.store().confirm(seat.slot.record.slot, wanted, "found under its fixed node-ID") : asked;
  slots_.refresh(seat);
  if (!confirmed) {
    slots_.happened(seat, SlotEvent::binding_failed, places::words_of(confirmed.error()));
    co_return;
  }
  slots_.events().tell(EventKind::bound, seat.name(),
                       fmt::format("{} sits there by its fixed node-ID {}", to_string(device), id.value()));
  co_await ask_seat(seat);
}

rt::Task<void> Presence::adopt_all_fixed() {
  rt::Scope adopted(s_.executor, asking_.most_first_at_once());
  for (const auto& seat : slots_.seats()) {
    const bool fixed = seat->slot.spec.assign == places::Assign::fixed && !seat->slot.record.confirmed;
    if (!fixed || !seat->polled) continue;
    // A device with a single receive buffer loses a question that follows one to another device.
    if (adopted.running() > 0) co_await rt::sleep_for(s_.bus.timing.rand_response);
    adopted.spawn(adopt_fixed(*seat));
  }
  co_await adopted.join();
}

rt::Task<bool> Presence::take_where_it_is(Seat& seat, Identity device) {
  const auto answer = co_await places::identify(s_.sdo, seat.id(), places::second_answer);
  if (!answer.who || answer.by_two || !answer.who->agrees(device)) co_return false;
  // Only LSS reports its serial number: a device that reports none may be another one beside it.
  if (device.has_serial() && !answer.who->has_serial()) {
    const auto active = co_await asking_.active_id(device);
    if (!active) co_return false;
  }
  const places::Assignment wanted{device, seat.id()};
  const std::string reason = "it has the slot's node-ID, and LSS does not change it";
  const auto asked = slots_.store().ask(seat.slot.record.slot, wanted, reason);
  const auto confirmed = asked ? slots_.store().confirm(seat.slot.record.slot, wanted, reason) : asked;
  slots_.refresh(seat);
  if (!confirmed) {
    slots_.happened(seat, SlotEvent::binding_failed, places::words_of(confirmed.error()));
    co_return true;
  }
  found_.forget(device);
  slots_.events().tell(EventKind::bound, seat.name(),
                       fmt::format("{} sits there by its own node-ID {}", to_string(device), seat.id().value()));
  seat.fresh = true;
  seat.power_cycle = {};
  co_await ask_seat(seat);
  co_return true;
}

}  // namespace berth::operate
