#include "berth/operate/starter.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <utility>

#include "berth/co/guarding.hpp"
#include "berth/co/sdo_access.hpp"
#include "berth/decode/emcy_words.hpp"
#include "berth/od/cia302.hpp"
#include "berth/operate/duplicates.hpp"
#include "berth/operate/seat_target.hpp"
#include "berth/rt/scope.hpp"

namespace berth::operate {

namespace {

// CANopenNode's CO_EM_NON_VOLATILE_MEMORY (301/CO_Emergency.h): its programs report it while they have no storage
// files.
bool lacks_first_save(const co::Emcy& message) noexcept {
  constexpr std::uint16_t hardware = 0x5000;
  constexpr std::uint8_t non_volatile_memory = 0x2F;
  return message.code == hardware && message.info[0] == non_volatile_memory;
}

std::string text_of_first_save(NodeId id) {
  return fmt::format(
      "it was started and stays pre-operational: its memory holds nothing that was saved (EMCY 5000h, CANopenNode's "
      "error 2Fh). `berth store {0}` saves its parameters, `berth nmt reset-node {0}` restarts it; if its program ends "
      "at that, start it again",
      id.value());
}

// Asks the user first: the device is theirs, and its program may end at NMT reset node instead of restarting.
void offer_first_save(const BusServices& services, SlotTable& slots, const Seat& seat) {
  const std::string text = fmt::format(
      "{}: its memory holds nothing that was saved, and it stays pre-operational (EMCY 5000h): save its parameters "
      "(1010h:01) and reset it (NMT reset node)?",
      seat.name());
  Event event{services.executor.now(), services.bus.name, EventKind::question, {}, text};
  event.slots = {seat.name()};
  event.offers_save = true;
  slots.events().tell_once(event);
}

}  // namespace

// A slot's device as the boot-up sees it, and what is done around its start.
class Starter::Target final : public SeatTarget {
 public:
  Target(Starter& starter, Seat& seat) noexcept : SeatTarget(starter.s_, seat), starter_(starter), seat_(seat) {}
  rt::Task<bool> runs() override { return starter_.runs_already(seat_); }
  rt::Task<void> start_sent() override {
    if (seat_.guarded) co_await starter_.control_.ask_started(seat_);
  }

 private:
  Starter& starter_;
  Seat& seat_;
};

// What the boot-up writes to a device before its start: `config =`, or only the heartbeat time.
class Starter::Source final : public network::BootSource {
 public:
  Source(Starter& starter, Seat& seat) noexcept : starter_(starter), seat_(seat) {}
  void renew(manager::SlaveRules& rules) const noexcept override {
    rules = {.assigned = true, .boots = true, .mandatory = seat_.slot.spec.mandatory};
    rules.device_type = seat_.slot.spec.device_type;
    if (const auto device = seat_.slot.record.device()) {
      rules.vendor = device->address.vendor;
      rules.product = device->address.product;
      rules.revision = device->address.revision;
      rules.serial = device->address.serial;
    }
    starter_.programming_.expect(seat_, rules);
  }
  rt::Task<Result<void>> configure(network::BootTarget&, manager::SlaveRules&) override {
    co_return co_await starter_.configure(seat_);
  }
  rt::Task<Result<std::string>> other_programs(network::BootTarget& target, const manager::SlaveRules&) override {
    co_return co_await starter_.programming_.others(seat_, target);
  }
  rt::Task<Result<void>> update(network::BootTarget& target, const manager::SlaveRules&) override {
    co_return co_await starter_.update(seat_, target);
  }

 private:
  Starter& starter_;
  Seat& seat_;
};

Starter::Starter(BusServices& services, SlotTable& slots, Agenda& agenda, SlotStartup& startup, Asking& asking,
                 Configuring& configuring, Spares& spares, Presence& presence)
    : s_(services),
      slots_(slots),
      agenda_(agenda),
      startup_(startup),
      asking_(asking),
      configuring_(configuring),
      spares_(spares),
      presence_(presence),
      control_(services, slots),
      programming_(services, slots),
      boots_(services.executor, *this, {}) {
  for (const auto& seat : slots_.seats()) {
    targets_.push_back(std::make_unique<Target>(*this, *seat));
    sources_.push_back(std::make_unique<Source>(*this, *seat));
    seat->slave.what.target = targets_.back().get();
    seat->slave.what.source = sources_.back().get();
  }
}

Starter::~Starter() = default;

bool Starter::is_due() const noexcept {
  return startup_.released() || std::ranges::any_of(slots_.seats(), [](const auto& s) { return s->is_to_boot(); });
}

// The transfers of a configuration would occupy a single receive buffer: the device would lose the `04 00` of the
// bindings beside it, and the questions that show that it is not in LSS configuration.
rt::Task<void> Starter::start_early(Seat& seat) {
  const bool configures = seat.configuration.any() || !seat.slot.spec.software.programs.empty();
  const bool waits = slots_.events().beneath().of(seat.id());
  const bool plain =
      seat.is_to_boot() && !configures && !waits && seat.slot.record.confirmed && !spares_.has_past(seat);
  if (plain) co_await boot(seat);
}

rt::Task<bool> Starter::check_and_start() {
  agenda_.phase = Phase::start;
  rt::Scope starts(s_.executor, asking_.most_at_once());
  for (auto& seat : slots_.seats()) {
    if (seat->is_to_boot()) starts.spawn(boot(*seat));
  }
  co_await starts.join();
  const SlotStartup::Go go = startup_.goes_on();
  if (go == SlotStartup::Go::all) co_await start_all();
  if (go == SlotStartup::Go::each) co_await start_waiting();
  co_await await_operational();
  const bool all = slots_.operational() && s_.may_command();
  if (all) slots_.events().reach(Milestone::operational);
  co_return all;
}

rt::Task<void> Starter::boot(Seat& seat) {
  const bool may = co_await may_boot(seat);
  if (!may) co_return;
  const bool ran = co_await takes_running(seat);
  if (ran) co_return;
  const bool clear = co_await spares_.clear_past(seat);
  if (!clear) co_return;
  const auto booted = s_.boots.boot_up(seat.id());
  const bool typed = seat.last.typed != rt::Time{} && (!booted || *booted < seat.last.typed);
  co_await boots_.boot_found(seat.slave, typed);
  // Another master starts the device. Without a heartbeat, it is asked whether it runs.
  const bool guards = !s_.may_command() && seat.guarded && seat.slave.status.ready();
  if (guards) co_await control_.watch_running(seat);
}

// Another master started it, or an earlier run of Berth whose store is lost: it is left as it is, and not asked again.
rt::Task<bool> Starter::takes_running(Seat& seat) {
  const NodeId id = seat.id();
  // If Berth is the master, it also configures a device that booted while Berth ran, and started itself.
  const bool before_us = !s_.boots.boot_up(id);
  const bool may_run = s_.boots.state(id) == NmtState::operational && (before_us || !s_.may_command());
  if (!may_run) co_return false;
  const bool runs = co_await runs_already(seat);
  if (!runs || configuring_.rebooted(seat)) co_return false;
  co_await presence_.take_running(seat);
  co_return true;
}

// Settles first whether this is the right device: which one booted, and whether another shares its node-ID.
rt::Task<bool> Starter::may_boot(Seat& seat) {
  if (configuring_.rebooted(seat)) co_return false;  // first ask which device booted
  const bool shares = presence_.waits_beside_another(seat);
  if (shares) co_return false;
  // A second answer was heard under its node-ID: before anything is written or saved, the two are separated once.
  if (seat.doubt.shared >= Duplicates::most_tries && !s_.only_observes()) {
    agenda_.look_anew = true;
    co_return false;
  }
  co_return true;
}

bool Starter::starts(const network::Slave& slave) noexcept {
  const Seat& seat = seat_of(slave);
  return s_.may_command() && startup_.starts(seat);
}

void Starter::ended(network::Slave& slave) noexcept {
  Seat& seat = seat_of(slave);
  if (!slave.status.ready()) {
    const bool letter = boot_failed(seat, slave.status.result);
    if (!letter) seat.set_letter(seat.life == Life::absent ? manager::BootStatus::b : manager::BootStatus::booted);
  } else if (configuring_.rebooted(seat)) {
    seat.boot_again();
  } else if (!s_.may_command() && s_.watched_state(seat.id()) == NmtState::operational) {
    // It reported operational while it was checked: its next heartbeat is no news.
    slave.status.phase = network::SlavePhase::started;
    slots_.happened(seat, SlotEvent::operational);
  } else if (slave.starting) {
    awaited_.push_back(&seat);
  } else {
    startup_.tell_why_waiting(seat);
  }
}

void Starter::started(network::Slave& slave, const Result<bool>& ran) noexcept {
  Seat& seat = seat_of(slave);
  if (ran && *ran) slots_.happened(seat, SlotEvent::operational);
  if (ran) return;
  std::erase(awaited_, &seat);
  seat.boot_again();
  slots_.happened(seat, SlotEvent::boot_failed, "NMT start could not be sent: " + describe(ran.error()));
}

// True: the letter is that of this boot-up. Otherwise it is that of another device or of an earlier boot-up.
bool Starter::boot_failed(Seat& seat, const network::BootResult& result) {
  using Status = manager::BootStatus;
  const bool unwritten = result.status == Status::i && seat.life == Life::present;
  if (unwritten && configuring_.rebooted(seat)) {
    slots_.happened(seat, SlotEvent::boots_while_prepared, "rebooted; checking identity");
    return false;
  }
  switch (result.status) {
    case Status::b:
      seat.last.untyped = true;
      slots_.set_absent(seat, "no answer to the upload of 1000h");
      return true;
    case Status::c: slots_.happened(seat, SlotEvent::wrong_type, result.text()); return true;
    case Status::g:
    case Status::h:
    case Status::i:
    case Status::n: {
      const std::string unreadable = programming_.unreadable(seat);
      const bool counts =
          slots_.happened(seat, SlotEvent::boot_failed, unreadable.empty() ? result.text() : unreadable);
      if (!counts) return false;
      // Its flash memory is not written again before it boots, or a user asks for it.
      if (result.status == Status::i) seat.configuration.stuck = true;
      return true;
    }
    case Status::j: return seat.life == Life::failed;
    default: return false;
  }
}

// It restarts into its boot loader and out of it; the device that answers afterwards must be the same.
rt::Task<Result<void>> Starter::update(Seat& seat, network::BootTarget& target) {
  if (configuring_.rebooted(seat)) co_return fail(Errc::mismatch, "another device may have booted here");
  const auto updated = co_await programming_.update(seat, target);
  // Its restarts do not mean another device, and are no reason to write its flash memory again.
  const rt::Time asked = s_.executor.now();
  const auto who = co_await places::read_identity(s_.sdo, seat.id());
  const bool same = who && seat.sits(*who);
  if (same) seat.checked = asked;
  if (same && updated) slots_.happened(seat, SlotEvent::prepared, "it has its programs");
  // A device on a bus without acknowledgement is away, too.
  const bool silent = !who && (who.error().code == Errc::timeout || who.error().code == Errc::bus);
  if (silent) {
    slots_.set_absent(seat, "it fell silent while it was programmed");
  }
  co_return updated;
}

// The slot's state shows what failed.
rt::Task<Result<void>> Starter::configure(Seat& seat) {
  bool ready = false;
  if (seat.configuration.any() && !s_.only_observes()) {
    manager::ConfigurationReport report;
    ready = co_await configuring_.configure(seat, report);
    if (seat.doubt.shared > 0) agenda_.look_anew = true;
  } else {
    ready = co_await control_.set(seat);
  }
  if (!ready) co_return fail(Errc::invalid, "the slot says why");
  if (slots_.events().beneath().of(seat.id()) && s_.may_command()) co_return co_await bring_up_beneath(seat);
  co_return Result<void>{};
}

// From the bottom up: a gateway is started when the buses beneath it run.
rt::Task<Result<void>> Starter::bring_up_beneath(Seat& seat) {
  auto task = slots_.events().beneath().bring_up(seat.id());
  const auto done = co_await task;
  if (!done) slots_.happened(seat, SlotEvent::boot_failed, describe(done.error()));
  co_return done;
}

// Another master has started it, or it ran on while out of reach, and the slot does not know: no second start.
rt::Task<bool> Starter::runs_already(Seat& seat) {
  const NodeId id = seat.id();
  // On a bus with one master, only a device that last reported operational is asked.
  const bool alone = !s_.bus.flying;
  if (alone && (seat.guarded || s_.boots.state(id) != NmtState::operational)) co_return false;
  if (seat.guarded) {
    const auto guarded = co_await co::guard_once(s_.dispatcher, id, s_.bus.timing.guard_timeout, s_.bus.timing.tries);
    co_return guarded && guarded->state == NmtState::operational;
  }
  // A device that was out of reach answers questions before its next heartbeat reports its state.
  const rt::Time asked = s_.executor.now();
  const auto told = [&] { return beats(seat) && (!alone || *s_.boots.heard(id) > asked); };
  const rt::Duration period = heartbeat_period(s_.bus.timing, seat);
  const rt::Time deadline = asked + period + period / 4;
  while (!told() && s_.executor.now() < deadline) {
    co_await rt::sleep_for(period / 16 + std::chrono::milliseconds(1));
  }
  co_return told() && s_.boots.state(id) == NmtState::operational;
}

bool Starter::beats(const Seat& seat) const noexcept {
  return s_.heard_within(seat.id(), heartbeat_timeout(s_.bus.timing, seat));
}

// All mandatory devices are ready, or a user asked for the start.
rt::Task<void> Starter::start_waiting() {
  rt::Scope starts(s_.executor, asking_.most_at_once());
  for (auto& seat : slots_.seats()) {
    const bool waits = seat->there() && seat->slave.waits_for_start() && !seat->held;
    if (!waits || !startup_.starts(*seat)) continue;
    awaited_.push_back(seat.get());
    starts.spawn(boots_.start(seat->slave));
  }
  co_await starts.join();
}

rt::Task<void> Starter::start_all() {
  const auto sent = co_await s_.nmt.send(co::NmtCommand::start, co::NmtTarget::all());
  if (!sent) co_return slots_.events().tell_failure("NMT start of all devices", sent.error());
  for (auto& seat : slots_.seats()) {
    if (!seat->there() || !seat->slave.waits_for_start()) continue;
    seat->slave.status.phase = network::SlavePhase::started;
    awaited_.push_back(seat.get());
    if (seat->guarded) co_await control_.ask_started(*seat);
  }
}

// A device whose program does not run stays in its boot loader, and in pre-operational (CiA 302-3). Empty: it has no
// programs, or runs them.
rt::Task<std::string> Starter::stopped_program(NodeId id) {
  constexpr std::uint8_t started = 1;            // 1F51h
  constexpr std::uint32_t no_valid_program = 1;  // 1F57h, bits 1 to 7
  const char* const cure = ": `berth program download` gives it one, and so does programs = [...] of its slot";
  co::NodeAccess device(s_.sdo, id);
  const auto control = co_await device.read_up_to(od::cia302::program_control, 1, 4);
  if (!control || control->bytes().empty() || control->bytes().front() == started) co_return std::string();
  const auto flash = co_await device.read_u32(od::cia302::flash_status, 1);
  if (flash && (*flash >> 1U & 0x7FU) == no_valid_program)
    co_return fmt::format("; it has no valid program (1F57h:01){}", cure);
  co_return fmt::format("; its program 1 does not run (1F51h:01){}", cure);
}

// The device's heartbeat decides whether it is operational, not the command that it got.
rt::Task<void> Starter::await_operational() {
  // A device that boots again is asked anew.
  const auto waits = [this](const Seat* s) {
    return s->slave.status.phase == network::SlavePhase::started && s->life == Life::present &&
           !configuring_.rebooted(*s);
  };
  const rt::Time began = s_.executor.now();
  rt::Duration longest = s_.bus.timing.heartbeat_timeout;
  for (const Seat* const seat : awaited_) longest = std::max(longest, heartbeat_timeout(s_.bus.timing, *seat));
  const rt::Time deadline = s_.executor.now() + longest;
  const rt::Duration patience = s_.bus.timing.heartbeat_period + s_.bus.timing.heartbeat_period / 4;
  rt::Time again = s_.executor.now() + patience;
  while (s_.executor.now() < deadline && std::ranges::any_of(awaited_, waits)) {
    co_await rt::sleep_for(s_.bus.timing.heartbeat_period / 16 + std::chrono::milliseconds(1));
    if (s_.executor.now() < again) continue;
    co_await start_again(again - patience);
    again = s_.executor.now() + patience;
  }
  for (Seat* const seat : std::exchange(awaited_, {})) {
    if (!waits(seat)) continue;
    const auto heard = s_.boots.heard(seat->id());
    const bool unheard = (!heard || *heard <= began) && !seat->last.emergency;
    bool watched = false;
    if (unheard) watched = co_await control_.watch_unheard(*seat);
    if (!waits(seat)) continue;
    std::string why =
        watched ? control_.text_of_unheard(*seat) : "it was started and no heartbeat reported operational";
    if (const auto& e = seat->last.emergency) {
      why += fmt::format("; it reported an error: EMCY {:04X}h ({})", e->message.code,
                         decode::emcy_words(e->message.code, seat->profile()));
    }
    const std::string program = co_await stopped_program(seat->id());
    why += program;
    const bool unsaved = seat->last.emergency && lacks_first_save(seat->last.emergency->message);
    if (unsaved) why = text_of_first_save(seat->id());
    seat->set_letter(manager::BootStatus::k);
    slots_.happened(*seat, SlotEvent::boot_failed, why);
    // Nothing changes before it boots, sends a heartbeat, or a user acts.
    seat->configuration.stuck = unsaved || watched;
    if (unsaved) offer_first_save(s_, slots_, *seat);
  }
}

// NMT commands have no answer, and every device receives the commands for all others: a hundred frames back to back
// overrun a slow device's receive buffer. A device that reports that it is not operational yet is commanded again, one
// after the other, at a pace that any device follows. A silent device may run.
rt::Task<void> Starter::start_again(rt::Time since) {
  const std::vector<Seat*> all = awaited_;
  for (Seat* const seat : all) {
    if (seat->held || seat->life != Life::present || configuring_.rebooted(*seat)) continue;
    const NodeId id = seat->id();
    const auto heard = s_.boots.heard(id);
    const bool waits = heard && *heard >= since && s_.boots.state(id) != NmtState::operational;
    if (!waits) continue;
    const auto sent = co_await s_.nmt.send(co::NmtCommand::start, id);
    if (!sent) co_return;
    co_await rt::sleep_for(s_.bus.timing.rand_response);
  }
}

}  // namespace berth::operate
