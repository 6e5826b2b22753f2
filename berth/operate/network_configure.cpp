// Configuration before start (CiA 302-2 boot slave, steps 7 and 8; CiA 302-3): what `config =` wants is brought into
// the device, saved and dated; only then is it started. What a device lacks stops that device and nobody else.
#include <fmt/format.h>

#include <algorithm>
#include <map>

#include "berth/od/abort_code.hpp"
#include "berth/operate/network_seat.hpp"
#include "berth/operate/timing_options.hpp"

namespace berth::operate {

using manager::ConfigurationReport;
using manager::Configurator;
using manager::ConfiguratorOptions;
using manager::Saved;
using manager::Wanted;
using places::Activate;
using places::Configured;
using places::SlotState;

namespace {

constexpr unsigned most_attempts = 3;

bool has_agreed(const places::SlotRecord& record, const Wanted& wanted) noexcept {
  return record.configured && record.confirmed && record.configured->device == record.confirmed->device &&
         record.configured->days == wanted.date.days && record.configured->ms == wanted.date.ms;
}

/// In this stage, for the device that sits there and for what is wanted now.
bool is_in(const places::SlotRecord& record, Configured::Stage stage, const Wanted& wanted) noexcept {
  return has_agreed(record, wanted) && record.configured->stage == stage;
}

/// Begun for the device that sits there, with whatever file.
bool was_begun(const places::SlotRecord& record) noexcept {
  return record.configured && record.confirmed && record.configured->device == record.confirmed->device &&
         record.configured->stage == Configured::Stage::writing;
}

std::string short_name(const std::string& path) {
  const auto slash = path.rfind('/');
  return slash == std::string::npos ? path : path.substr(slash + 1);
}

}  // namespace

// One file may stand for many slots.
void Network::load_configurations() {
  std::map<std::string, std::pair<std::shared_ptr<const manager::Configuration>, std::string>> known;
  for (auto& seat : seats_) {
    const auto& path = seat->slot.spec.config;
    if (path.empty()) continue;
    auto it = known.find(path);
    if (it == known.end()) {
      auto loaded = manager::load_configuration(path);
      it = known.try_emplace(path).first;
      if (loaded.usable()) {
        it->second.first = std::make_shared<manager::Configuration>(std::move(loaded.configuration));
      } else {
        const auto error = std::ranges::find(loaded.findings, Finding::Severity::error, &Finding::severity);
        it->second.second = to_string(*error);
      }
    }
    seat->configuration = it->second.first;
    seat->unreadable = it->second.second;
  }
}

// A boot-up that was heard after the device was looked at last: what was found belongs to the life before.
bool Network::rebooted(const Seat& seat) const noexcept {
  const auto booted = boots_.boot_up(seat.id());
  return booted && *booted > seat.checked;
}

bool Network::note_configured(Seat& seat, Configured::Stage stage, const Wanted& wanted) {
  const auto& confirmed = seat.slot.record.confirmed;
  if (!confirmed) return true;
  const Configured fact{stage, confirmed->device, wanted.date.days, wanted.date.ms};
  if (seat.slot.record.configured == fact) return true;
  const auto written = store_->configure(seat.slot.record.slot, fact, wanted.file);
  if (!written) {
    tell("error", seat.name(), "the slot table cannot be written: " + describe(written.error()));
    return false;
  }
  seat.slot.record.configured = fact;
  return true;
}

// The file's values, and the heartbeat of the machine file, which is what this network watches. Errors: the device did
// not answer, or the file's values cannot be had for this node-ID.
rt::Task<Result<Wanted>> Network::wanted_of(Seat& seat) {
  const auto period = std::chrono::duration_cast<std::chrono::milliseconds>(bus_->timing.heartbeat_period).count();
  std::vector<manager::Entry> own;
  const NodeId id = seat.id();
  const auto has = co_await sdo_.read<std::uint16_t>(id, 0x1017, 0);
  seat.guarded = !has && has.error().code == Errc::aborted;
  if (!has && !seat.guarded) co_return fail(has.error());
  if (!seat.guarded) {
    manager::Entry heartbeat;
    heartbeat.object = {0x1017, 0};
    heartbeat.type = od::DataType::unsigned16;
    heartbeat.name = "Producer heartbeat time (heartbeat_period of the machine file)";
    const auto ms = static_cast<std::uint16_t>(std::clamp<std::int64_t>(period, 0, 0xFFFF));
    heartbeat.bytes = {static_cast<std::uint8_t>(ms), static_cast<std::uint8_t>(ms >> 8U)};
    own.push_back(std::move(heartbeat));
  }
  auto all = manager::wanted(*seat.configuration, id, own);
  if (all) all->file = short_name(all->file);
  co_return all;
}

// True: the device has its configuration, in use, and may be started. Else the slot's state says why not.
rt::Task<bool> Network::configure_seat(Seat& seat, ConfigurationReport& report) {
  if (!seat.configuration) {
    seat.stuck = true;
    set_state(seat, SlotState::failed, seat.unreadable);
    co_return false;
  }
  if (seat.failed_savings >= most_attempts) {
    seat.stuck = true;
    set_state(seat, SlotState::failed,
              fmt::format("it failed to save its configuration {} times and is not asked again, for its memory's sake; "
                          "`berth configure` does",
                          most_attempts));
    co_return false;
  }
  set_state(seat, SlotState::configuring, "comparing with " + short_name(seat.slot.spec.config));
  const auto wanted = co_await wanted_of(seat);
  if (!wanted) {
    set_state(seat, SlotState::failed, "not configured: " + describe(wanted.error()));
    co_return false;
  }
  ConfiguratorOptions options = configurator_options(bus_->timing);
  const NodeId id = seat.id();
  co::NodeAccess values(sdo_, id);
  Configurator looking(values, values, *wanted, options);
  const bool waits = co_await waits_for_power(seat, looking, *wanted);
  if (waits) co_return false;
  const bool verifies = is_in(seat.slot.record, Configured::Stage::power_cycle, *wanted);
  options.write = !verifies;
  options.trust_date = !verifies && !was_begun(seat.slot.record);
  options.save_anyway = is_in(seat.slot.record, Configured::Stage::writing, *wanted);
  seat.waits_since.reset();
  const Wanted& all = *wanted;
  for (unsigned attempt = 1;; ++attempt) {
    const bool good = co_await configure_once(seat, all, options, report);
    const bool restarted = !good && report.failure && report.failure->why == manager::Failure::Why::restarted;
    if (restarted && attempt < most_attempts) {
      co_await ask_seat(seat);  // another device may have come under this node-ID
      if (!seat.there || seat.started) co_return false;
      continue;
    }
    if (!good) co_return false;
    if (verifies && !report.differences.empty()) {
      forgot(seat, report, all);
      co_return false;
    }
    const bool changed = report.changed() || report.saved != Saved::no_need;
    const Activate activate = changed ? seat.slot.spec.activate : Activate::at_once;
    const bool unsure = report.saved == Saved::unanswered;
    if (activate != Activate::at_once && report.saved == Saved::cannot) {
      seat.stuck = true;
      set_state(seat, SlotState::failed,
                "its configuration is in use only after a restart, says the machine file, and it cannot save it");
      co_return false;
    }
    const bool resets = (unsure || activate == Activate::reset) && may_command() && attempt < most_attempts;
    if (activate == Activate::power_cycle && !unsure) {
      const std::string reason = "its configuration is saved; switch the device off and on";
      co_await wait_for_power(seat, looking, all, reason);
      co_return false;
    }
    if (!unsure && activate == Activate::at_once) break;
    if (!resets) {
      const std::string reason = unsure ? "it did not answer the saving of its configuration; switch it off and on"
                                        : "its configuration is saved; reset the device, or switch it off and on";
      co_await wait_for_power(seat, looking, all, reason);
      co_return false;
    }
    set_state(seat, SlotState::configuring,
              unsure ? "it did not answer the saving: it is reset to see what it has saved"
                     : "it is reset to take its configuration into use");
    // Some answer first and save then: the reset before came too early for them.
    if (attempt > 1) co_await rt::sleep_for(bus_->timing.save_timeout / 4);
    const bool back = co_await reset_and_wait(seat);
    if (!back) co_return false;
    options.trust_date = false;
    options.save_anyway = false;
  }
  seat.checked = executor_->now();
  const bool noted = note_configured(seat, Configured::Stage::done, all);
  if (!noted) {
    set_state(seat, SlotState::failed, "the slot table cannot be written");
    co_return false;
  }
  tell("configured", seat.name(), summary(report, all.file));
  set_state(seat, SlotState::present);
  co_return true;
}

// After its power cycle it does not have what it saved. The next boot-up, or a person, begins anew.
void Network::forgot(Seat& seat, const ConfigurationReport& report, const Wanted& wanted) {
  seat.stuck = true;
  (void)note_configured(seat, Configured::Stage::writing, wanted);
  set_state(seat, SlotState::failed,
            fmt::format("after its power cycle it does not have what it saved: {}",
                        describe(report.differences.front(), wanted.file)));
}

rt::Task<bool> Network::configure_once(Seat& seat, const Wanted& wanted, ConfiguratorOptions& options,
                                       ConfigurationReport& report) {
  const NodeId id = seat.id();
  co::NodeAccess values(sdo_, id);
  const co::SdoOptions patience = saving_options(bus_->timing);
  co::NodeAccess saving(sdo_, id, patience);
  const rt::Time began = executor_->now();
  options.restarted = [this, id, began] { return boots_.booted_since(id, began); };
  options.before_change = [this, &seat, &wanted] { return note_configured(seat, Configured::Stage::writing, wanted); };
  const auto late = sdo_.late(id);
  options.answered_late = [this, id, late] { return sdo_.late(id) > late; };
  options.progress = [this, &seat, &wanted](const manager::Progress& progress) {
    using manager::Stage;
    const std::string what = progress.stage == Stage::saving
                                 ? std::string("its configuration")
                                 : fmt::format("{} values of {}", progress.total, wanted.file);
    const bool worth_telling = progress.stage != Stage::dating && progress.stage != Stage::comparing;
    if (worth_telling) set_state(seat, SlotState::configuring, fmt::format("{} {}", name(progress.stage), what));
  };
  Configurator configurator(values, saving, wanted, options);
  co_await configurator.run(report);
  if (report.good()) {
    if (report.saved != Saved::unanswered) seat.failed_savings = 0;
    co_return true;
  }
  // One that is saving still, for a run of Berth before this one, wrote nothing for this one.
  const Error& error = report.failure->error;
  const bool busy =
      error.code == Errc::aborted && error.detail == static_cast<std::uint32_t>(od::AbortCode::device_state);
  if (report.failure->stage == manager::Stage::saving && !busy) ++seat.failed_savings;
  seat.stuck = !report.failure->passing();
  set_state(seat, SlotState::failed, "its configuration failed: " + describe(*report.failure, wanted.file));
  co_return false;
}

// ---- power cycles and resets ----

// While it waits, its date in use is 0 and the saved one is right: a date that agrees was loaded at a power-on. Without
// 1020h only a boot-up message tells.
rt::Task<bool> Network::waits_for_power(Seat& seat, Configurator& configurator, const Wanted& wanted) {
  const bool waits = is_in(seat.slot.record, Configured::Stage::power_cycle, wanted);
  if (!waits) co_return false;
  const auto booted = boots_.boot_up(seat.id());
  const bool has_booted = booted && (!seat.waits_since || *booted > *seat.waits_since);
  if (has_booted) co_return false;
  const bool dated = co_await configurator.has_date();
  if (dated) co_return false;
  if (!seat.waits_since) seat.waits_since = executor_->now();
  seat.checked = executor_->now();
  set_state(seat, SlotState::power_cycle, "its configuration is saved; switch the device off and on");
  co_return true;
}

rt::Task<void> Network::wait_for_power(Seat& seat, Configurator& configurator, const Wanted& wanted,
                                       const std::string& reason) {
  co_await configurator.take_date();
  seat.checked = executor_->now();
  seat.waits_since = executor_->now();
  const bool noted = note_configured(seat, Configured::Stage::power_cycle, wanted);
  set_state(seat, noted ? SlotState::power_cycle : SlotState::failed,
            noted ? reason : "the slot table cannot be written");
}

// A boot-up message that is missed costs the time it was waited for, and nothing else (HU.18).
rt::Task<bool> Network::reset_and_wait(Seat& seat) {
  const NodeId id = seat.id();
  const rt::Time began = executor_->now();
  const auto sent = co_await nmt_.send(co::NmtCommand::reset_node, id);
  if (!sent) {
    set_state(seat, SlotState::failed, "it could not be reset: " + describe(sent.error()));
    co_return false;
  }
  const rt::Time deadline = began + bus_->timing.boot_timeout;
  while (!boots_.booted_since(id, began) && executor_->now() < deadline) {
    co_await rt::sleep_for(std::chrono::milliseconds(5));
  }
  const auto who = co_await places::Binder::read_identity(sdo_, id);
  const bool same = who && seat.slot.record.confirmed && *who == seat.slot.record.confirmed->device;
  if (same || (who && !seat.slot.record.confirmed)) co_return true;
  set_state(seat, SlotState::failed,
            who ? fmt::format("device {} answers after it was reset", to_string(*who))
                : "it did not come back after it was reset: " + describe(who.error()));
  co_return false;
}

// A device that runs is left alone; that it runs with something else is said.
rt::Task<void> Network::look_at_running(Seat& seat) {
  if (bus_->role == design::Role::observer) co_return;
  const auto wanted = co_await wanted_of(seat);
  if (!wanted) co_return;
  ConfiguratorOptions options = configurator_options(bus_->timing);
  options.write = false;
  const NodeId id = seat.id();
  co::NodeAccess values(sdo_, id);
  Configurator configurator(values, values, *wanted, options);
  ConfigurationReport report;
  co_await configurator.run(report);
  if (report.differences.empty()) co_return;
  tell("configured", seat.name(),
       fmt::format("it runs and is left alone, though {} of its values differ from {}; `berth configure --check` names "
                   "them",
                   report.differences.size(), wanted->file));
}

// ---- berth configure ----

rt::Task<void> Network::compare_seat(Seat& seat, bool write, SlotConfiguration& into) {
  const NodeId id = seat.id();
  into.bus = bus_->name;
  into.slot = seat.name();
  into.id = id;
  into.file = short_name(seat.slot.spec.config);
  if (!seat.configuration) {
    into.problem = seat.unreadable;
    co_return;
  }
  const auto who = co_await places::Binder::read_identity(sdo_, id);
  if (!who) {
    into.problem = "its identity cannot be read: " + describe(who.error());
    co_return;
  }
  const auto& confirmed = seat.slot.record.confirmed;
  const bool right = confirmed ? confirmed->device == *who : places::fits(seat.slot.spec, *who);
  if (!right) {
    into.problem =
        fmt::format("device {} answers at node-ID {}, which does not belong there", to_string(*who), id.value());
    co_return;
  }
  const auto heard = boots_.heard(id);
  const bool runs = seat.started || (heard && boots_.state(id) == NmtState::operational);
  if (write && !runs) {
    seat.stuck = false;
    seat.failed_savings = 0;
    seat.there = true;
    const bool ready = co_await configure_seat(seat, into.report);
    (void)ready;
    co_return;
  }
  const auto wanted = co_await wanted_of(seat);
  if (!wanted) {
    into.problem = describe(wanted.error());
    co_return;
  }
  ConfiguratorOptions options = configurator_options(bus_->timing);
  options.write = false;
  options.trust_date = false;
  co::NodeAccess values(sdo_, id);
  Configurator configurator(values, values, *wanted, options);
  co_await configurator.run(into.report);
  if (write && into.report.good() && !into.report.differences.empty()) {
    into.problem = fmt::format("it runs and is left alone; `berth nmt preop {}` first", id.value());
  }
}

rt::Task<Result<std::vector<SlotConfiguration>>> Network::configure(std::string slot, bool write) {
  co_await turn_.take();
  const rt::Held held(turn_);
  std::vector<Seat*> chosen;
  for (auto& seat : seats_) {
    const bool named = slot.empty() ? !seat->slot.spec.config.empty() : seat->name() == slot;
    if (named) chosen.push_back(seat.get());
  }
  if (!slot.empty() && chosen.empty()) co_return fail(Errc::not_found, "no slot of this name on this bus");
  std::vector<SlotConfiguration> results(chosen.size());
  {
    rt::Scope side_by_side(*executor_, most_at_once());
    for (std::size_t i = 0; i < chosen.size(); ++i) side_by_side.spawn(compare_seat(*chosen[i], write, results[i]));
    co_await side_by_side.join();
  }
  for (std::size_t i = 0; i < chosen.size(); ++i) {
    results[i].state = chosen[i]->state;
    results[i].reason = chosen[i]->reason;
  }
  co_return results;
}

}  // namespace berth::operate
