#include "berth/operate/configuring.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <map>
#include <utility>

#include "berth/eds/xdd.hpp"
#include "berth/od/abort_code.hpp"
#include "berth/operate/configuration_fit.hpp"
#include "berth/operate/error_control.hpp"
#include "berth/operate/timing_options.hpp"
#include "berth/places/identity.hpp"

namespace berth::operate {

using manager::ConfigurationReport;
using manager::Configurator;
using manager::ConfiguratorOptions;
using manager::Saved;
using manager::Wanted;
using places::Activate;
using places::Configured;

namespace {

constexpr unsigned most_attempts = most_restarts;

bool has_agreed(const places::SlotRecord& record, const Wanted& wanted) noexcept {
  return record.configured && record.confirmed && record.configured->device == record.confirmed->device &&
         record.configured->days == wanted.date.days && record.configured->ms == wanted.date.ms;
}

/// In this stage, for the slot's device and the configuration wanted now.
bool is_in(const places::SlotRecord& record, Configured::Stage stage, const Wanted& wanted) noexcept {
  return has_agreed(record, wanted) && record.configured->stage == stage;
}

/// Begun for the slot's device, with any file.
bool was_begun(const places::SlotRecord& record) noexcept {
  return record.configured && record.confirmed && record.configured->device == record.confirmed->device &&
         record.configured->stage == Configured::Stage::writing;
}

// The first refusal of the 1017h that the machine file wants beside `config =`.
bool refuses_heartbeat(const Seat& seat, const ConfigurationReport& report) {
  using Why = manager::Failure::Why;
  if (!report.failure || !report.failure->own || !seat.rate.refused.empty()) return false;
  const manager::Failure& failure = *report.failure;
  const bool refused = failure.why == Why::error && failure.error.code == Errc::aborted;
  const bool has_another = failure.why == Why::differs || failure.why == Why::not_kept;
  return failure.object == ObjectRef{0x1017, 0} && (refused || has_another);
}

std::string short_name(const std::string& path) {
  const auto slash = path.rfind('/');
  return slash == std::string::npos ? path : path.substr(slash + 1);
}

struct Read {
  std::shared_ptr<const manager::Configuration> wanted;
  std::string unreadable;
};
using Reads = std::map<std::string, Read>;  // by path

// Reads the slot's file: `config =`, or what an SDO client wrote instead.
void read_files(Seat& seat, const WrittenFiles& files, Reads& known) {
  SeatConfiguration& mine = seat.configuration;
  const std::string written = files.of(seat.slot.spec.name);
  mine.path = written.empty() ? seat.slot.spec.config : written;
  mine.written.reset();
  if (!written.empty())
    mine.written = written.ends_with(".dcf") ? WrittenFiles::Form::dcf : WrittenFiles::Form::concise;
  mine.uploaded.clear();
  mine.wanted.reset();
  mine.unreadable.clear();
  mine.file = short_name(mine.path);
  if (!mine.path.empty()) {
    const auto [it, fresh] = known.try_emplace(mine.path);
    if (fresh) {
      auto loaded = manager::load_configuration(mine.path);
      if (loaded.usable()) {
        it->second.wanted = std::make_shared<manager::Configuration>(std::move(loaded.configuration));
      } else {
        const auto error = std::ranges::find(loaded.findings, Finding::Severity::error, &Finding::severity);
        it->second.unreadable = to_string(*error);
      }
    }
    mine.wanted = it->second.wanted;
    mine.unreadable = it->second.unreadable;
  }
  // The machine file may have changed since the file was written.
  const std::string other = mine.written && mine.wanted ? not_for(seat.slot.spec, *mine.wanted) : std::string();
  if (!other.empty()) {
    mine.wanted.reset();
    mine.unreadable = fmt::format("{}: {}, or remove the file", mine.path, other);
  }
}

}  // namespace

std::string restarted_each_time(const std::string& cause, unsigned times) {
  return fmt::format("{}, {} times in a row: it is configured again when it was switched off and on", cause, times);
}

unsigned restarts_by_configuration(SeatConfiguration& configuration, rt::Time booted, rt::Duration within) {
  const rt::Time unanswered = std::exchange(configuration.unanswered, rt::Time{});
  const bool by_it = unanswered != rt::Time{} && booted < unanswered + within;
  configuration.restarts = by_it ? configuration.restarts + 1 : 0;
  return configuration.restarts;
}

void Configuring::load(const manager::SlotSettings& more, const SlotDescriptions& descriptions, WrittenFiles written) {
  linked_ = more;
  written_ = std::move(written);
  Reads known;
  for (auto& seat : slots_.seats()) {
    const auto eds = descriptions.find(seat->name());
    if (eds != descriptions.end()) seat->configuration.eds = eds->second;
    read_files(*seat, written_, known);
    add_links(*seat);
  }
}

void Configuring::load(Seat& seat) {
  Reads known;
  read_files(seat, written_, known);
  add_links(seat);
}

void Configuring::begin_with(Seat& seat, manager::Configuration configuration, const std::string& path) {
  SeatConfiguration& mine = seat.configuration;
  mine.path = path;
  mine.file = short_name(configuration.file);
  mine.wanted = std::make_shared<manager::Configuration>(std::move(configuration));
  mine.uploaded.clear();
  mine.unreadable.clear();
  mine.failed_savings = 0;
  mine.stuck = false;
  add_links(seat);
}

const manager::Configuration* Configuring::linked(const Seat& seat) const {
  const auto linked = linked_.find(seat.name());
  return linked == linked_.end() ? nullptr : linked->second.get();
}

void Configuring::add_links(Seat& seat) {
  SeatConfiguration& mine = seat.configuration;
  const auto linked = linked_.find(seat.name());
  if (linked == linked_.end() || !mine.unreadable.empty()) return;
  if (mine.wanted == nullptr) {
    mine.wanted = linked->second;
    mine.file = short_name(linked->second->file);
  } else {
    mine.wanted = std::make_shared<manager::Configuration>(manager::joined(*mine.wanted, *linked->second));
  }
}

bool Configuring::rebooted(const Seat& seat) const noexcept {
  const auto booted = s_.boots.boot_up(seat.id());
  return booted && *booted > seat.checked;
}

bool Configuring::note(Seat& seat, Configured::Stage stage, const Wanted& wanted) {
  const auto& confirmed = seat.slot.record.confirmed;
  if (!confirmed) return true;
  const Configured fact{stage, confirmed->device, wanted.date.days, wanted.date.ms};
  if (seat.slot.record.configured == fact) return true;
  const auto written = slots_.store().configure(seat.slot.record.slot, fact, wanted.file);
  if (!written) {
    slots_.events().tell(EventKind::error, seat.name(),
                         "the slot table cannot be written: " + describe(written.error()));
    return false;
  }
  seat.slot.record.configured = fact;
  return true;
}

rt::Task<Result<Wanted>> Configuring::wanted_of(Seat& seat) {
  std::vector<manager::Entry> own;
  const NodeId id = seat.id();
  ErrorControl control(s_, slots_);
  const auto has = co_await control.look(seat);
  if (!has) co_return fail(has.error());
  if (*has) {
    manager::Entry heartbeat;
    heartbeat.object = {0x1017, 0};
    heartbeat.type = od::DataType::unsigned16;
    heartbeat.name = "Producer heartbeat time (heartbeat_period of the machine file)";
    const std::uint16_t ms = co::whole_ms(heartbeat_time(s_.bus.timing, seat));
    heartbeat.bytes = {static_cast<std::uint8_t>(ms), static_cast<std::uint8_t>(ms >> 8U)};
    own.push_back(std::move(heartbeat));
  }
  auto all = manager::wanted(*seat.configuration.wanted, id, own);
  if (all) all->file = short_name(all->file);
  co_return all;
}

// One configuration of one device, and its progress.
struct Configuring::Attempt {
  const Wanted& wanted;
  Configurator& looking;
  ConfigurationReport& report;
  ConfiguratorOptions options;
  rt::Time identified{};  ///< a device that booted later may be another one
  bool verifies = false;  ///< it was power-cycled to load what it saved
  unsigned number = 1;
};

bool Configuring::may_be_configured(Seat& seat) {
  if (!seat.configuration.wanted) {
    seat.configuration.stuck = true;
    slots_.happened(seat, SlotEvent::boot_failed, seat.configuration.unreadable);
    return false;
  }
  if (seat.configuration.failed_savings < most_attempts) return true;
  seat.configuration.stuck = true;
  slots_.happened(seat, SlotEvent::boot_failed,
                  fmt::format("it failed to save its configuration {} times; Berth does not try again, to spare its "
                              "memory; `berth configure` tries again",
                              most_attempts));
  return false;
}

rt::Task<bool> Configuring::configure(Seat& seat, ConfigurationReport& report) {
  const bool may = may_be_configured(seat);
  if (!may) co_return false;
  slots_.happened(seat, SlotEvent::configures, "comparing with " + seat.configuration.file);
  const rt::Time identified = seat.checked;
  const auto wanted = co_await wanted_of(seat);
  if (!wanted) {
    slots_.happened(seat, SlotEvent::boot_failed, "not configured: " + describe(wanted.error()));
    co_return false;
  }
  const NodeId id = seat.id();
  co::NodeAccess values(s_.sdo, id);
  Configurator looking(values, values, *wanted, configurator_options(s_.bus.timing));
  const bool waits = co_await waits_for_power(seat, looking, *wanted);
  if (waits) co_return false;
  if (rebooted(seat)) {
    slots_.happened(seat, SlotEvent::boots_while_prepared, "rebooted; checking identity");
    co_return false;
  }
  Attempt attempt{*wanted, looking, report, configurator_options(s_.bus.timing), identified};
  attempt.verifies = is_in(seat.slot.record, Configured::Stage::power_cycle, *wanted);
  attempt.options.write = !attempt.verifies;
  const bool by_date = seat.slot.spec.configuring.when == places::Configure::by_date;
  attempt.options.trust_date = by_date && !attempt.verifies && !was_begun(seat.slot.record);
  attempt.options.save_anyway = is_in(seat.slot.record, Configured::Stage::writing, *wanted);
  seat.configuration.waits_since.reset();
  Next next = Next::again;
  for (; next == Next::again; ++attempt.number) next = co_await try_once(seat, attempt);
  if (next == Next::not_now && refuses_heartbeat(seat, report)) {
    ErrorControl control(s_, slots_);
    const std::vector<std::uint8_t> held = report.failure->held;
    const bool learnt = co_await control.learn(seat, held);
    report = {};
    if (learnt) co_return co_await configure(seat, report);
  }
  if (next == Next::not_now) co_return false;
  seat.checked = s_.executor.now();
  const bool noted = note(seat, Configured::Stage::done, *wanted);
  if (!noted) {
    slots_.happened(seat, SlotEvent::boot_failed, "the slot table cannot be written");
    co_return false;
  }
  slots_.events().tell(EventKind::configured, seat.name(), summary(report, wanted->file));
  slots_.happened(seat, SlotEvent::prepared);
  co_return true;
}

rt::Task<Configuring::Next> Configuring::try_once(Seat& seat, Attempt& attempt) {
  const ConfigurationReport& report = attempt.report;
  const bool good = co_await configure_once(seat, attempt);
  const bool restarted = !good && report.failure && report.failure->why == manager::Failure::Why::restarted;
  // Or another device booted under this node-ID, sends no heartbeat, and does not answer while it saves values meant
  // for this one: the two are separated when this one runs.
  if (restarted) seat.doubt.shared = std::max(seat.doubt.shared, 1U);
  if (restarted) {
    const std::string cause = seat.reason;
    co_await asker_->ask_seat(seat);  // another device may have appeared under this node-ID
    attempt.identified = seat.checked;
    if (!seat.there() || seat.is_booted()) co_return Next::not_now;
    if (attempt.number < most_attempts) co_return Next::again;
    // A device may restart because 1017h was written; this is checked first (`ErrorControl::leave_as_it_is`).
    const bool by_heartbeat = seat.rate.written != rt::Time{};
    const unsigned times = ++seat.configuration.restarts * most_attempts;
    if (by_heartbeat && seat.configuration.restarts < most_restarts) {
      slots_.happened(seat, SlotEvent::boot_failed, cause);
      co_return Next::not_now;
    }
    // Its last boot-up does not restart the configuration, because the written values caused it.
    seat.configuration.restarts = 0;
    seat.configuration.stuck = true;
    slots_.happened(seat, SlotEvent::boot_failed, restarted_each_time(cause, times));
    co_return Next::not_now;
  }
  if (!good) co_return Next::not_now;
  seat.rate.written = {};  // all was read back: it did not reset itself because of its heartbeat time
  if (attempt.verifies && !report.differences.empty()) {
    forgot(seat, report, attempt.wanted);
    co_return Next::not_now;
  }
  co_return co_await take_into_use(seat, attempt);
}

rt::Task<Configuring::Next> Configuring::take_into_use(Seat& seat, Attempt& attempt) {
  const ConfigurationReport& report = attempt.report;
  const bool changed = report.changed() || report.saved != Saved::no_need;
  const Activate activate = changed ? seat.slot.spec.configuring.activate : Activate::at_once;
  const bool unsure = report.saved == Saved::unanswered;
  if (activate != Activate::at_once && report.saved == Saved::cannot) {
    seat.configuration.stuck = true;
    slots_.happened(seat, SlotEvent::boot_failed,
                    "by the machine file its configuration needs a restart, and the device cannot save it");
    co_return Next::not_now;
  }
  if (!unsure && activate == Activate::at_once) co_return Next::done;
  const bool resets = (unsure || activate == Activate::reset) && s_.may_command() && attempt.number < most_attempts;
  const bool by_power = activate == Activate::power_cycle && !unsure;
  if (by_power || !resets) {
    std::string reason = "its configuration is saved; reset the device, or switch it off and on";
    if (by_power) reason = "its configuration is saved; switch the device off and on";
    if (unsure) reason = "it did not answer the save command for its configuration; switch it off and on";
    co_await wait_for_power(seat, attempt.looking, attempt.wanted, reason);
    co_return Next::not_now;
  }
  slots_.happened(seat, SlotEvent::configures,
                  unsure ? "it did not answer the save command: it is reset to see what it has saved"
                         : "it is reset to take its configuration into use");
  // Some devices answer first and save afterwards: the previous reset was too early for them.
  if (attempt.number > 1) co_await rt::sleep_for(s_.bus.timing.save_timeout / 4);
  const bool back = co_await reset_and_wait(seat, attempt.identified);
  if (!back) co_return Next::not_now;
  attempt.options.trust_date = false;
  attempt.options.save_anyway = false;
  co_return Next::again;
}

// The device lost the saved values in the power cycle. Its next boot-up, or a user, starts anew.
void Configuring::forgot(Seat& seat, const ConfigurationReport& report, const Wanted& wanted) {
  seat.configuration.stuck = true;
  (void)note(seat, Configured::Stage::writing, wanted);
  slots_.happened(seat, SlotEvent::boot_failed,
                  fmt::format("after its power cycle it does not have what it saved: {}",
                              describe(report.differences.front(), wanted.file)));
}

rt::Task<bool> Configuring::configure_once(Seat& seat, Attempt& attempt) {
  const Wanted& wanted = attempt.wanted;
  ConfiguratorOptions& options = attempt.options;
  ConfigurationReport& report = attempt.report;
  const NodeId id = seat.id();
  co::NodeAccess values(s_.sdo, id);
  const co::SdoOptions patience = saving_options(s_.bus.timing);
  co::NodeAccess saving(s_.sdo, id, patience);
  options.restarted = [this, id, since = attempt.identified] {
    const auto booted = s_.boots.boot_up(id);
    return booted && *booted > since;
  };
  options.before_change = [this, &seat, &wanted] { return note(seat, Configured::Stage::writing, wanted); };
  const auto late = s_.sdo.late(id);
  options.answered_late = [this, id, late] { return s_.sdo.late(id) > late; };
  options.progress = [this, &seat, &wanted](const manager::Progress& progress) {
    using manager::Stage;
    const std::string what = progress.stage == Stage::saving
                                 ? std::string("its configuration")
                                 : fmt::format("{} values of {}", progress.total, wanted.file);
    const bool worth_telling = progress.stage != Stage::dating && progress.stage != Stage::comparing;
    if (worth_telling) slots_.happened(seat, SlotEvent::configures, fmt::format("{} {}", name(progress.stage), what));
  };
  Configurator configurator(values, saving, wanted, options);
  co_await configurator.run(report);
  slots_.diagnosis().compared(id, report.differences.size(), report.good() && !attempt.verifies);
  if (report.good()) {
    if (report.saved != Saved::unanswered) seat.configuration.failed_savings = 0;
    seat.configuration.restarts = 0;
    co_return true;
  }
  if (refuses_heartbeat(seat, report)) co_return false;
  // If it is still saving for an earlier run of Berth, it wrote nothing for this one.
  const Error& error = report.failure->error;
  const bool busy =
      error.code == Errc::aborted && error.detail == static_cast<std::uint32_t>(od::AbortCode::device_state);
  if (report.failure->stage == manager::Stage::saving && !busy) ++seat.configuration.failed_savings;
  seat.configuration.stuck = !report.failure->passing();
  const bool unanswered = error.code == Errc::timeout && report.failure->why == manager::Failure::Why::error;
  seat.configuration.unanswered = unanswered ? s_.executor.now() : rt::Time{};
  slots_.happened(seat, SlotEvent::boot_failed, "its configuration failed: " + describe(*report.failure, wanted.file));
  co_return false;
}

// While it waits, its active date is 0 and its saved date is right: a date that agrees was loaded at power-on. Without
// 1020h only a boot-up message shows the power cycle.
rt::Task<bool> Configuring::waits_for_power(Seat& seat, Configurator& configurator, const Wanted& wanted) {
  const bool waits = is_in(seat.slot.record, Configured::Stage::power_cycle, wanted);
  if (!waits) co_return false;
  const auto booted = s_.boots.boot_up(seat.id());
  const bool has_booted = booted && (!seat.configuration.waits_since || *booted > *seat.configuration.waits_since);
  if (has_booted) co_return false;
  const bool dated = co_await configurator.has_date();
  if (dated) co_return false;
  if (!seat.configuration.waits_since) seat.configuration.waits_since = s_.executor.now();
  seat.checked = s_.executor.now();
  slots_.happened(seat, SlotEvent::saves_for_power, "its configuration is saved; switch the device off and on");
  co_return true;
}

rt::Task<void> Configuring::wait_for_power(Seat& seat, Configurator& configurator, const Wanted& wanted,
                                           const std::string& reason) {
  co_await configurator.take_date();
  seat.checked = s_.executor.now();
  seat.configuration.waits_since = s_.executor.now();
  const bool noted = note(seat, Configured::Stage::power_cycle, wanted);
  slots_.happened(seat, noted ? SlotEvent::saves_for_power : SlotEvent::boot_failed,
                  noted ? reason : "the slot table cannot be written");
}

// A missed boot-up message only costs the waiting time (HU.18).
rt::Task<bool> Configuring::reset_and_wait(Seat& seat, rt::Time& identified) {
  const NodeId id = seat.id();
  const rt::Time began = s_.executor.now();
  const auto sent = co_await s_.nmt.send(co::NmtCommand::reset_node, id);
  if (!sent) {
    slots_.happened(seat, SlotEvent::boot_failed, "it could not be reset: " + describe(sent.error()));
    co_return false;
  }
  const rt::Time deadline = began + s_.bus.timing.boot_timeout;
  while (!s_.boots.booted_since(id, began) && s_.executor.now() < deadline) {
    co_await rt::sleep_for(std::chrono::milliseconds(5));
  }
  identified = s_.executor.now();
  const auto who = co_await places::read_identity(s_.sdo, id);
  const bool same = who && seat.sits(*who);
  if (same || (who && !seat.slot.record.confirmed)) co_return true;
  slots_.happened(seat, SlotEvent::boot_failed,
                  who ? fmt::format("device {} answers after it was reset", to_string(*who))
                      : "it did not come back after it was reset: " + describe(who.error()));
  co_return false;
}

rt::Task<void> Configuring::look_at_running(Seat& seat) {
  if (s_.only_observes()) co_return;
  const auto wanted = co_await wanted_of(seat);
  if (!wanted) co_return;
  ConfiguratorOptions options = configurator_options(s_.bus.timing);
  options.write = false;
  const NodeId id = seat.id();
  co::NodeAccess values(s_.sdo, id);
  Configurator configurator(values, values, *wanted, options);
  ConfigurationReport report;
  co_await configurator.run(report);
  slots_.diagnosis().compared(id, report.differences.size(), false);
  if (report.differences.empty()) co_return;
  slots_.events().tell(
      EventKind::configured, seat.name(),
      fmt::format("it runs and is left alone, though {} of its values differ from {}; `berth configure --check` names "
                  "them",
                  report.differences.size(), wanted->file));
}

// Why the device under the slot's node-ID is not read further; empty: it is the slot's device.
rt::Task<std::string> Configuring::belongs_elsewhere(Seat& seat) {
  const NodeId id = seat.id();
  const auto who = co_await places::read_identity(s_.sdo, id);
  if (!who) co_return "its identity cannot be read: " + describe(who.error());
  const auto& confirmed = seat.slot.record.confirmed;
  const bool right = confirmed ? seat.sits(*who) : places::fits(seat.slot.spec, *who);
  if (right) co_return std::string();
  co_return fmt::format("device {} answers at node-ID {}, which does not belong there", to_string(*who), id.value());
}

rt::Task<void> Configuring::upload(Seat& seat, SlotUpload& into) {
  into.bus = s_.bus.name;
  into.slot = seat.name();
  into.id = seat.id();
  into.file = short_name(seat.slot.spec.config);
  seat.configuration.upload = Uploading::under_way;
  co_await upload_from(seat, into);
  seat.configuration.upload = into.problem.empty() ? Uploading::done : Uploading::failed;
}

rt::Task<void> Configuring::upload_from(Seat& seat, SlotUpload& into) {
  const std::string elsewhere = co_await belongs_elsewhere(seat);
  into.problem = elsewhere;
  if (!elsewhere.empty()) co_return;
  const NodeId id = seat.id();
  co::NodeAccess device(s_.sdo, id);
  eds::Reading reading;
  if (!seat.configuration.eds.empty()) {
    reading = eds::read_any_file(seat.configuration.eds);
  } else {
    auto own = co_await manager::read_own_eds(device);
    if (!own) {
      into.problem = fmt::format("its description is not known (eds = of the slot): {}", describe(own.error()));
      co_return;
    }
    reading = eds::read_any(std::move(*own), "1021h");
  }
  const auto error = std::ranges::find(reading.findings, Finding::Severity::error, &Finding::severity);
  if (error != reading.findings.end()) {
    into.problem = to_string(*error);
    co_return;
  }
  auto uploaded = co_await manager::upload_configuration(device, reading.file, id);
  if (!uploaded) {
    into.problem = describe(uploaded.error());
    co_return;
  }
  into.uploaded = std::move(*uploaded);
  take(seat, into.uploaded.dcf, into);
}

// Replaces what the slot wants.
void Configuring::take(Seat& seat, const std::string& dcf, SlotUpload& into) {
  auto loaded = manager::read_configuration(dcf, "1F20h");
  if (!loaded.usable()) {
    into.problem = "what was read of it makes no DCF";
    return;
  }
  SeatConfiguration& mine = seat.configuration;
  const auto has = manager::wanted(loaded.configuration, seat.id());
  if (!has) {
    into.problem = describe(has.error());
    return;
  }
  const auto wanted = mine.wanted ? manager::wanted(*mine.wanted, seat.id()) : Result<Wanted>(Wanted{});
  for (const auto& entry : wanted ? wanted->entries : std::vector<manager::Entry>{}) {
    const auto held = std::ranges::find(has->entries, entry.object, &manager::Entry::object);
    if (held == has->entries.end() || held->bytes == entry.bytes) continue;
    into.changes.push_back({entry.object, entry.name, entry.line, entry.type, entry.bytes, held->bytes, false});
  }
  begin_with(seat, std::move(loaded.configuration), {});
  mine.uploaded = dcf;
}

rt::Task<void> Configuring::compare(Seat& seat, bool write, SlotConfiguration& into) {
  const NodeId id = seat.id();
  into.bus = s_.bus.name;
  into.slot = seat.name();
  into.id = id;
  into.file = seat.configuration.file;
  if (!seat.configuration.wanted) {
    into.problem = seat.configuration.unreadable;
    co_return;
  }
  const rt::Time asked = s_.executor.now();
  const std::string elsewhere = co_await belongs_elsewhere(seat);
  into.problem = elsewhere;
  if (!elsewhere.empty()) co_return;
  const auto heard = s_.boots.heard(id);
  const bool runs = (seat.is_booted() && !seat.held) || (heard && s_.boots.state(id) == NmtState::operational);
  if (write && !runs) {
    seat.configuration.stuck = false;
    seat.configuration.failed_savings = 0;
    if (!seat.there()) slots_.happened(seat, SlotEvent::identified);
    seat.checked = asked;
    const bool ready = co_await configure(seat, into.report);
    (void)ready;
    co_return;
  }
  const auto wanted = co_await wanted_of(seat);
  if (!wanted) {
    into.problem = describe(wanted.error());
    co_return;
  }
  ConfiguratorOptions options = configurator_options(s_.bus.timing);
  options.write = false;
  options.trust_date = false;
  co::NodeAccess values(s_.sdo, id);
  Configurator configurator(values, values, *wanted, options);
  co_await configurator.run(into.report);
  slots_.diagnosis().compared(id, into.report.differences.size(), false);
  if (write && into.report.good() && !into.report.differences.empty()) {
    into.problem = fmt::format("it runs and is left alone; give --restart, or `berth nmt preop {}` first", id.value());
  }
}

}  // namespace berth::operate
