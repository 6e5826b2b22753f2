#include "berth/places/binder.hpp"

#include <algorithm>

#include "berth/co/guarding.hpp"
#include "berth/places/identity.hpp"
#include "berth/places/inquiry.hpp"
#include "berth/places/odd_identity.hpp"

namespace berth::places {
namespace {

using namespace std::chrono_literals;

constexpr std::uint8_t store_unsupported = 1;  // CiA 305, error code of 17h

// The binding holds LSS from the selection (a blanking: from its row in the store) to the release. So a run that ends
// in between has told at most one device a node-ID.
//
// A device without a node-ID that hears `04 00` leaves LSS configuration and boots. One that missed it stays in
// configuration, does not boot, and answers the proof before the next device is told anything. A device that is reset
// may be in configuration and yet deaf while it boots: so no LSS request is sent before it has booted.
bool needs_lss(const Binding& binding) noexcept {
  switch (binding.step()) {
    case Step::write_ask:
    case Step::select:
    case Step::inquire:
    case Step::configure:
    case Step::store:
    case Step::revert:
    case Step::release:
    case Step::reset: return true;
    case Step::await_boot_up: return binding.old_id().configured();
    case Step::identify: return binding.kind() == Binding::Kind::blank;
    default: return false;
  }
}

}  // namespace

rt::Task<void> Binder::take_lss() {
  if (options_.lss_turn == nullptr || lss_held_) co_return;
  co_await options_.lss_turn->take();
  lss_held_.emplace(*options_.lss_turn);
}

Outcome outcome_of(const Error& error) noexcept {
  switch (error.code) {
    case Errc::timeout: return Outcome::silent;
    case Errc::aborted: return Outcome::refused;
    case Errc::mismatch: return Outcome::mismatch;
    case Errc::duplicate: return Outcome::several;
    default: return Outcome::error;
  }
}

Outcome outcome_of(const Result<void>& written, std::optional<Error>& said) noexcept {
  if (written) return Outcome::ok;
  said = written.error();
  return said->code == Errc::duplicate ? Outcome::refused : Outcome::error;
}

std::string words_of(Why why, const std::optional<Error>& store_said) {
  const bool by_store = why == Why::seated_twice || why == Why::store_failed;
  return by_store && store_said ? words_of(*store_said) : std::string(name(why));
}

rt::Task<void> Binder::run(Binding& binding, SlotId slot, const std::string& reason) {
  const lss::MasterOptions before = s_.lss.options();
  while (!binding.ended()) {
    const bool needs = needs_lss(binding);
    if (needs) {
      co_await take_lss();
    } else {
      lss_held_.reset();
    }
    if (options_.before_step) options_.before_step(binding);
    const Outcome outcome = co_await perform(binding, slot, reason);
    binding.advance(outcome);
  }
  lss_held_.reset();
  if (binding.step() != Step::done) s_.lss.set_options(before);
}

rt::Task<Outcome> Binder::perform(Binding& binding, SlotId slot, const std::string& reason) {
  switch (binding.step()) {
    case Step::check_vacant: {
      const Identity device = binding.assignment().device;
      co_return co_await vacant(binding.assignment().id, device);
    }
    case Step::write_ask:
    case Step::write_confirm: co_return write(binding, slot, reason);
    case Step::select: {
      const LssAddress device = binding.assignment().device.address;
      const bool silent = silent_once_;
      const bool inquires = true;
      const Outcome selected = co_await select(device, inquires);
      // Silence does not prove a slow device here: it may be booting.
      if (binding.staying().asked) silent_once_ = silent;
      co_return selected;
    }
    case Step::inquire: co_return co_await inquire(binding);
    case Step::configure:
      if (is_taken(binding)) co_return Outcome::mismatch;
      co_return co_await configure_alone(binding);
    case Step::revert: co_return co_await revert(binding);
    case Step::store:
      if (is_taken(binding)) co_return Outcome::mismatch;
      co_return co_await store_alone(binding);
    case Step::release: co_return co_await release(binding);
    case Step::reset: co_return co_await reset(binding);
    case Step::await_boot_up: co_return co_await await_boot_up(binding);
    case Step::identify: {
      const bool blank = binding.kind() == Binding::Kind::blank;
      if (blank) co_return co_await identify_blank(binding);
      co_return co_await identify(binding);
    }
    case Step::done:
    case Step::power_cycle:
    case Step::failed: break;
  }
  co_return Outcome::error;
}

rt::Task<Outcome> Binder::vacant(NodeId id, const Identity& device) {
  auto& vacant_at = s_.vacancy[id.value() & 0x7FU];
  if (vacant_at && s_.boots.vacant_since(id, *vacant_at)) {
    watch_since_ = *vacant_at;
    co_return Outcome::ok;
  }
  watch_since_ = s_.dispatcher.executor().now();
  vacant_at.reset();
  co::SdoOptions patience = s_.sdo.options();
  patience.retries = options_.tries - 1;
  const auto type = co_await s_.sdo.read<std::uint32_t>(id, 0x1000, 0, patience);
  const bool silent = !type && type.error().code == Errc::timeout;
  if (!type && type.error().code == Errc::bus) co_return Outcome::error;
  if (!silent) {
    const auto who = co_await read_identity(s_.sdo, id);
    bool itself = who && who->agrees(device) && (device.has_serial() || id == options_.uses);
    // The device may have this node-ID on loan from a search, and report another identity in 1018h than by LSS.
    if (who && !itself && id == options_.uses && device.has_serial()) {
      const Identity said = *who;
      const Identity expected = device;
      itself = co_await excuses(id, said, expected);
    }
    answers_there_ = itself;
    co_return itself ? Outcome::ok : Outcome::mismatch;
  }
  if (options_.use_guarding) {
    const auto guarded = co_await co::guard_once(s_.dispatcher, id, options_.guard_timeout, 1);
    if (guarded) co_return Outcome::mismatch;
  }
  vacant_at = watch_since_;
  co_return Outcome::ok;
}

rt::Task<bool> Binder::excuses(NodeId id, Identity who, Identity expected) {
  const bool asks_lss = true;
  rt::Turn* const turn = lss_held_ ? nullptr : options_.lss_turn;
  const Uncompared excused = co_await excuse(s_, id, who, expected, asks_lss, turn);
  if (excused.any() && options_.uncompared != nullptr) *options_.uncompared = excused;
  co_return excused.any();
}

Outcome Binder::write(const Binding& binding, SlotId slot, const std::string& reason) {
  const bool ask = binding.step() == Step::write_ask;
  const Assignment& seat = binding.assignment();
  Result<void> written;
  if (binding.kind() == Binding::Kind::bind) {
    written = ask ? s_.store.ask(slot, seat, reason) : s_.store.confirm(slot, seat, reason);
  } else {
    const UnfinishedBlank blank{seat.device, options_.on.machine, options_.on.bus, binding.old_id()};
    written = ask ? s_.store.ask_blank(blank, reason) : s_.store.confirm_blank(blank.who(), reason);
  }
  return outcome_of(written, store_said_);
}

rt::Task<Outcome> Binder::select(const LssAddress& device, bool inquires) {
  if (silent_once_) {
    lss::MasterOptions slower = s_.lss.options();
    slower.inhibit = std::max(slower.inhibit, options_.slow_inhibit);
    s_.lss.set_options(slower);
  }
  const bool tells = !s_.lss.lacks().has(device, lss::Lackable::inquire_node_id);
  lss::AloneOptions options{
      .parts = options_.parts, .attempts = 1, .without_node_id = options_.among_equals, .followed = inquires && tells};
  window_ = lss::window_of(s_.lss, options);
  if (s_.lss.answer_times().strangers) options.parts = lss::all_parts;
  const auto selected = co_await lss::select_alone(s_.lss, device, options);
  if (!selected) co_return Outcome::error;
  silent_once_ = silent_once_ || *selected == lss::Selection::absent;
  switch (*selected) {
    case lss::Selection::alone: co_return Outcome::ok;
    case lss::Selection::absent: co_return Outcome::silent;
    case lss::Selection::not_alone: co_return Outcome::mismatch;
    case lss::Selection::clones: co_return Outcome::several;
  }
  co_return Outcome::error;
}

// The device was selected, so it is still in configuration although it did not answer.
Outcome Binder::unanswered(const Error& error) noexcept {
  const Outcome outcome = outcome_of(error);
  if (outcome == Outcome::silent) s_.lss.lost_one();
  return outcome;
}

// A second answer comes from a device that heard nothing of the proof. `revert`, which all devices in configuration
// hear, takes back the node-ID that it was told; then the intended device is selected again.
rt::Task<Outcome> Binder::configure(NodeId id) {
  const auto reply = co_await s_.lss.configure_node_id(id);
  if (!reply) co_return unanswered(reply.error());
  co_return lss::suspicious(*reply) ? Outcome::several : Outcome::ok;
}

rt::Task<Outcome> Binder::still_alone(const Binding& binding) {
  const LssAddress device = binding.assignment().device.address;
  const lss::AloneOptions options{.parts = options_.parts};
  const auto alone = co_await lss::still_alone(s_.lss, device, options);
  if (!alone) co_return Outcome::error;
  co_return *alone == lss::Selection::alone ? Outcome::ok : Outcome::several;
}

// A device that was deaf during the proof may have heard the 11h. Berth waits for its answer 1.5 times as long as the
// slowest answer on this bus took; if a device was lost, a whole window. If the 11h was repeated, that device may have
// heard only the repetition, after which Berth does not wait for a second answer: so the proof is asked again.
rt::Task<Outcome> Binder::configure_alone(const Binding& binding) {
  lss::ServiceOptions service = s_.lss.options().service;
  service.full_window = s_.lss.answer_times().lost;
  service.listen = s_.lss.answer_times().slowest * 3 / 2;
  unexpected_ = s_.lss.answer_times().unexpected;
  taken_back_ = s_.lss.answer_times().taken_back;
  const auto reply = co_await s_.lss.configure_node_id(binding.assignment().id, service);
  if (!reply) co_return unanswered(reply.error());
  if (lss::suspicious(*reply)) co_return Outcome::several;
  if (reply->attempts == 1) co_return Outcome::ok;
  s_.lss.lost_one();
  co_return co_await still_alone(binding);
}

// The device gets its old node-ID back only if it is proven alone in configuration: another device there would take
// that node-ID, too, at the next `04 00`. Without the proof, all devices in configuration are told to have no node-ID,
// and nothing is stored.
//
// Otherwise, the reverted node-ID is stored in two cases. If two devices were told the new one, both may have stored
// it. And a node-ID stored before the binding failed would come into use at the device's next reset.
//
// If another device uses the new node-ID, this one may be in LSS waiting with that node-ID pending: Lely core's slaves
// activate it only at the next reset of all nodes. So the device is selected again.
rt::Task<Outcome> Binder::revert(const Binding& binding) {
  const LssAddress device = binding.assignment().device.address;
  NodeId id = binding.revert_to();
  // Since it left its old node-ID, a device was heard there: perhaps another one from elsewhere with the same node-ID.
  const bool used = id.configured() && moved_ != rt::Time{} && !s_.boots.silent_since(id, moved_);
  if (used || id == options_.lent) id = NodeId();
  bool told = true;
  if (id.configured()) {
    const lss::AloneOptions options{.parts = options_.parts};
    const auto alone = co_await lss::still_alone(s_.lss, device, options);
    if (!alone) co_return Outcome::error;
    told = *alone == lss::Selection::alone;
  }
  const NodeId first = told ? id : NodeId();
  Outcome outcome = co_await configure(first);
  const bool waits = outcome == Outcome::silent && binding.why() == Why::other_device;
  if (waits) {
    const bool inquires = false;
    outcome = co_await select(device, inquires);
    if (outcome == Outcome::ok) {
      outcome = co_await configure(id);
      told = true;
    }
  }
  const bool stores = told && (binding.shared() || binding.stored());
  if (binding.shared()) s_.lss.took_back();
  if (!stores) co_return outcome;
  if (!binding.shared()) co_return co_await store(false);
  // Both requests twice: a device that is still storing the earlier node-ID does not hear the first ones.
  co_await store(true);
  co_await configure(first);
  co_return co_await store(true);
}

// A second answer may be the late answer to an earlier request. Two answers to one request within one window come from
// two devices (S1.22).
rt::Task<Outcome> Binder::confirm_clone(const LssAddress& device) {
  lss::ServiceOptions whole = s_.lss.options().service;
  whole.full_window = true;
  unsigned doubled = 0;
  for (int look = 0; look < 3; ++look) {
    const auto quiet = co_await s_.lss.switch_global(lss::State::waiting);
    if (!quiet) co_return Outcome::error;
    const auto reply = co_await s_.lss.switch_selective(device, whole);
    if (!reply) co_return outcome_of(reply.error());
    if (reply->answers > 1) ++doubled;
  }
  co_return doubled >= 2 ? Outcome::several : Outcome::ok;
}

// A device without a node-ID activates the new one at `04 00` and boots by itself (CiA 305). Lely core's slaves wait
// for NMT reset communication, and obey it only under the node-ID that they still have, whatever 5Eh reports: 255,
// which no device with a node-ID has. Slow devices get this command, too; it has no effect on them.
//
// A boot-up under the old node-ID may come from another device that has the same one. This device may be slower, so it
// gets more time.
rt::Task<Outcome> Binder::await_boot_up(const Binding& binding) {
  rt::Executor& executor = s_.dispatcher.executor();
  const BootWatch::BootUp moves{binding.assignment().id, moved_};
  const BootWatch::BootUp stays{binding.old_id(), reset_};
  const rt::Time began = executor.now();
  const bool asks_soon = binding.stored() && !stays.id.configured() && !binding.staying().boots;
  const rt::Time deadline = began + (asks_soon ? 2 * options_.own_boot : options_.boot_timeout);
  const rt::Time first = std::min(deadline, began + options_.own_boot);
  bool heard = co_await s_.boots.wait(moves, stays, first);
  const auto stayed = [&] { return stays.id.configured() && s_.boots.booted_since(stays.id, stays.since); };
  if (!heard && !stayed()) {
    co_await wake();
    heard = co_await s_.boots.wait(moves, stays, deadline);
  }
  if (!heard && stayed()) {
    const rt::Time late = executor.now() + options_.own_boot;
    heard = co_await s_.boots.wait(moves.id, moves.since, late);
  }
  if (heard) co_return Outcome::ok;
  co_return asks_soon || stayed() ? Outcome::mismatch : Outcome::silent;
}

// Takes LSS, so that no other device has a pending node-ID that is not stored yet. No other binding uses LSS until this
// device has booted.
rt::Task<void> Binder::wake() {
  co_await take_lss();
  co_await rt::sleep_for(options_.slow_inhibit);  // a single-slot receive buffer would lose it after another's `04 00`
  wake_unconfigured(s_.dispatcher);
}

void gave_up(BootWatch& boots, VacancyTable& vacancy, NodeId id) noexcept {
  if (!id.configured()) return;
  boots.forget(id);
  vacancy[id.value()].reset();
}

void wake_unconfigured(can::Dispatcher& dispatcher) noexcept {
  can::Frame reset;
  reset.id = 0;
  reset.size = 2;
  reset.data[0] = static_cast<std::uint8_t>(co::NmtCommand::reset_communication);
  reset.data[1] = NodeId::unconfigured_value;
  dispatcher.send(reset);
}

// The last question before the 11h. Another device in configuration that heard it, or an earlier one, answers after the
// first answer: so Berth waits for a second one.
rt::Task<Outcome> Binder::inquire(Binding& binding) {
  const LssAddress device = binding.assignment().device.address;
  lss::ServiceOptions service = s_.lss.options().service;
  service.listen = window_;
  auto told = co_await lss::ask_node_id(s_.lss, device, service);
  if (!told) co_return unanswered(told.error());
  if (!*told) co_return co_await find_node_id(binding);
  auto reply = **told;
  if (lss::suspicious(reply)) {
    s_.lss.suspect_strangers();
    const Outcome single = co_await confirm_clone(device);
    if (single != Outcome::ok) co_return single;
    const Outcome alone = co_await still_alone(binding);
    if (alone != Outcome::ok) co_return alone == Outcome::several ? Outcome::mismatch : alone;
    auto again = co_await s_.lss.inquire_node_id(service);
    if (!again) co_return unanswered(again.error());
    if (lss::suspicious(*again)) co_return Outcome::mismatch;
    reply = *again;
  }
  const auto now = NodeId::make(reply.byte());
  if (!now) co_return Outcome::silent;
  binding.inquired(*now);
  // Then another device uses the intended node-ID: it has no LSS, and the same serial number as the selected device.
  const bool twin = answers_there_ && *now != binding.assignment().id && !options_.may_use_another;
  co_return twin ? Outcome::several : Outcome::ok;
}

// The device does not report its node-ID by LSS. Its known node-ID counts, else the one under which it answers SDO. If
// it has been told another one since, it may use that by now: then only SDO counts.
rt::Task<Outcome> Binder::find_node_id(Binding& binding) {
  const bool told = binding.staying().asked;
  NodeId id = told ? NodeId() : options_.uses;
  if (!id.configured() && !told) id = binding.old_id();
  if (!id.configured()) {
    const LssAddress device = binding.assignment().device.address;
    Inquiry inquiry(s_);
    id = co_await inquiry.where_it_answers(device);
  }
  binding.inquired(id);
  co_return Outcome::ok;
}

// A device that was deaf during the proof but heard the 11h answers it, too: after the first answer, while no request
// is under way. A device that was lost in configuration may have heard the 17h, and answered it instead of this one.
// Either may be slower than all devices that Berth has measured: so the proof waits the longest window for it.
rt::Task<Outcome> Binder::store_alone(const Binding& binding) {
  co_await rt::sleep_until(std::max(s_.lss.earliest(), options_.stores_end));
  if (s_.lss.answer_times().unexpected != unexpected_) {
    s_.lss.suspect_strangers();
    const Outcome alone = co_await still_alone(binding);
    if (alone != Outcome::ok) co_return alone;
  }
  const Outcome outcome = co_await store(false);
  const bool sure = outcome != Outcome::ok || !s_.lss.answer_times().lost;
  // A device that does not answer identity inquiries is identified by SDO, after it has booted.
  const bool mute = s_.lss.lacks().has(binding.assignment().device.address, lss::Lackable::inquire_identity);
  if (sure || mute) co_return outcome;
  s_.lss.suspect_strangers();
  co_return co_await still_alone(binding);
}

// If more than one device was told (`by_all`), Berth waits for each answer: a late one would count for the next 17h.
rt::Task<Outcome> Binder::store(bool by_all) {
  if (s_.dispatcher.executor().now() < options_.stores_end) co_await rt::sleep_until(options_.stores_end);
  lss::ServiceOptions options = s_.lss.options().store;
  options.full_window = options.full_window || by_all;
  const auto reply = co_await s_.lss.store(options);
  if (reply) co_return lss::suspicious(*reply) ? Outcome::several : Outcome::ok;
  const bool unsupported = reply.error().code == Errc::aborted && (reply.error().detail & 0xFFU) == store_unsupported;
  co_return unsupported ? Outcome::unsupported : unanswered(reply.error());
}

// Another device has appeared under the node-ID since the question whether it is vacant.
bool Binder::is_taken(const Binding& binding) const noexcept {
  return binding.kind() == Binding::Kind::bind && binding.old_id() != binding.assignment().id &&
         !s_.boots.silent_since(binding.assignment().id, watch_since_);
}

rt::Task<Outcome> Binder::release(const Binding& binding) {
  const bool gives_up = binding.why() != Why::none;
  if (!gives_up && is_taken(binding)) co_return Outcome::mismatch;
  moved_ = s_.dispatcher.executor().now();
  const auto quiet = co_await s_.lss.switch_global(lss::State::waiting);
  co_return quiet ? Outcome::ok : Outcome::error;
}

rt::Task<Outcome> Binder::reset(const Binding& binding) {
  // A frame under the new node-ID: the device has activated it at 04h 00h already and booted, or another device came
  // with it, perhaps during the pause. Then `identify` shows which one it is.
  const auto heard = [&] {
    return binding.kind() == Binding::Kind::bind && !s_.boots.silent_since(binding.assignment().id, moved_);
  };
  if (heard()) co_return Outcome::ok;
  // A single-slot receive buffer would lose this right after the `04 00`.
  co_await rt::sleep_for(options_.slow_inhibit);
  if (heard()) co_return Outcome::ok;
  const auto command = binding.staying().once ? co::NmtCommand::reset_node : co::NmtCommand::reset_communication;
  const auto sent = co_await s_.nmt.send(command, binding.old_id());
  if (sent) reset_ = *sent;
  co_return sent ? Outcome::ok : Outcome::error;
}

rt::Task<Outcome> Binder::identify(const Binding& binding) {
  const NodeId id = binding.assignment().id;
  // The device did not boot, and neither did a second one that may have the same node-ID. With a single-slot receive
  // buffer, the second one would lose the question right after `04 00`, and the next ones right after the first one's
  // answers.
  const bool stayed = binding.old_id() == id;
  if (stayed) co_await rt::sleep_for(options_.slow_inhibit);
  const auto surplus = s_.sdo.surplus(id);
  const rt::Time began = s_.dispatcher.executor().now();
  auto who = co_await read_identity(s_.sdo, id);
  // A boot-up during the repetitions of the first question comes from the device itself, or from another one that came
  // with this node-ID. Neither must be woken.
  const bool came = !who && who.error().code == Errc::timeout && !s_.boots.silent_since(id, began);
  if (came) who = co_await read_identity(s_.sdo, id);
  // A device in NMT stopped answers no SDO (CiA 301 §7.3.2.2). It may leave that state: after the binding, it is
  // started like any other device.
  const bool stopped = !who && who.error().code == Errc::timeout && stayed && s_.boots.state(id) == NmtState::stopped;
  if (stopped) {
    const auto sent = co_await s_.nmt.send(co::NmtCommand::enter_pre_operational, id);
    if (sent) co_await rt::sleep_for(options_.slow_inhibit);
    who = co_await read_identity(s_.sdo, id);
  }
  // Lely core's slaves report the pending node-ID by 5Eh. So the binding did not wait for their boot-up, and they have
  // not booted yet.
  const bool asleep = !who && who.error().code == Errc::timeout && binding.old_id() == id && !woken_;
  if (asleep) {
    woken_ = true;
    co_await wake();
    moved_ = s_.dispatcher.executor().now();
    const rt::Time deadline = moved_ + options_.own_boot;
    const bool booted = co_await s_.boots.wait(id, moved_, deadline);
    if (booted) who = co_await read_identity(s_.sdo, id);
  }
  if (!who) co_return who.error().code == Errc::timeout ? Outcome::silent : outcome_of(who.error());
  // A slower device that has used the node-ID all along may answer only after the last question.
  if (stayed) co_await rt::sleep_for(second_answer);
  if (s_.sdo.surplus(id) != surplus) {
    co_await rt::sleep_for(second_answer);
    const auto again = co_await places::identify(s_.sdo, id, second_answer);
    if (again.by_two) co_return Outcome::several;
    who = again.who;
    if (!who) co_return outcome_of(who.error());
  }
  s_.vacancy[id.value() & 0x7FU].reset();
  const Identity expected = binding.assignment().device;
  if (!who->agrees(expected)) {
    const Identity said = *who;
    const bool excused = co_await excuses(id, said, expected);
    if (!excused) co_return Outcome::mismatch;
  }
  const auto taken_back = s_.lss.answer_times().taken_back;
  co_return taken_back_.value_or(taken_back) == taken_back ? Outcome::ok : Outcome::taken_back;
}

// The device may still be resetting; it is asked until it answers without a node-ID, or time is up.
rt::Task<Outcome> Binder::identify_blank(const Binding& binding) {
  const LssAddress device = binding.assignment().device.address;
  const rt::Time deadline = s_.dispatcher.executor().now() + options_.boot_timeout;
  Outcome outcome = Outcome::silent;
  while (s_.dispatcher.executor().now() < deadline) {
    const auto quiet = co_await s_.lss.switch_global(lss::State::waiting);
    if (!quiet) co_return Outcome::error;
    const auto selected = co_await s_.lss.switch_selective(device);
    outcome = selected ? Outcome::ok : outcome_of(selected.error());
    if (outcome == Outcome::error) break;
    if (outcome == Outcome::ok) {
      const auto told = co_await lss::ask_node_id(s_.lss, device, s_.lss.options().service);
      const bool mute = told && !told->has_value();
      NodeId now;
      if (mute) {
        Inquiry inquiry(s_);
        now = co_await inquiry.where_it_answers(device);
      } else if (told) {
        now = NodeId::make((*told)->byte()).value_or(binding.old_id());
      }
      if (told) outcome = now.configured() ? Outcome::mismatch : Outcome::ok;
      const bool stayed = outcome == Outcome::mismatch && reset_ != rt::Time{} && now == binding.old_id() &&
                          s_.boots.booted_since(binding.old_id(), reset_);
      if (outcome == Outcome::ok || stayed) break;
    }
    co_await rt::sleep_for(50ms);
  }
  const auto quiet = co_await s_.lss.switch_global(lss::State::waiting);
  co_return quiet ? outcome : Outcome::error;
}

}  // namespace berth::places
