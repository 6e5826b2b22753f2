#include "berth/manager/configurator.hpp"

#include <algorithm>
#include <array>

#include "berth/base/bytes.hpp"

namespace berth::manager {
namespace {

constexpr ObjectRef date_days{0x1020, 1};
constexpr ObjectRef date_ms{0x1020, 2};
constexpr std::array<ObjectRef, 2> date_objects{date_days, date_ms};
constexpr ObjectRef store_all{0x1010, 1};
constexpr const char* date_name = "Verify configuration";
constexpr const char* store_name = "Store parameters";
constexpr std::uint32_t save_signature = 0x6576'6173;  // "save"
constexpr std::uint32_t saves_on_command = 1;
constexpr std::uint32_t saves_by_itself = 2;

bool aborted_with(const Error& error, std::initializer_list<od::AbortCode> codes) noexcept {
  return error.code == Errc::aborted &&
         std::ranges::find(codes, static_cast<od::AbortCode>(error.detail)) != codes.end();
}
bool missing(const Error& error) noexcept {
  return aborted_with(error, {od::AbortCode::no_object, od::AbortCode::no_sub_index});
}
// A DOMAIN that was never written.
bool has_no_value(const Error& error) noexcept { return aborted_with(error, {od::AbortCode::no_data}); }
bool not_ready(const Error& error) noexcept {
  return aborted_with(error, {od::AbortCode::local_control, od::AbortCode::device_state});
}

std::array<std::uint8_t, 4> four_bytes(std::uint32_t value) noexcept {
  std::array<std::uint8_t, 4> bytes{};
  store_le(bytes.data(), value);
  return bytes;
}

// The failure concerns one value, and the user wants the others anyway.
bool goes_on(const ConfiguratorOptions& options, ConfigurationReport& report) {
  using enum Failure::Why;
  if (!options.refused || !report.failure) return false;
  const Failure& failure = *report.failure;
  const bool refused = failure.why == error && failure.error.code == Errc::aborted;
  if (!refused && failure.why != differs && failure.why != not_kept) return false;
  options.refused(failure);
  ++report.refused;
  report.failure.reset();
  return true;
}

}  // namespace

bool same_value(od::DataType type, std::span<const std::uint8_t> held, std::span<const std::uint8_t> wanted) noexcept {
  if (std::ranges::equal(held, wanted)) return true;
  const bool longer = held.size() > wanted.size();
  if (type == od::DataType::visible_string || type == od::DataType::unicode_string) {
    const auto& rest = longer ? held.subspan(wanted.size()) : wanted.subspan(held.size());
    const auto common = std::min(held.size(), wanted.size());
    return std::ranges::equal(held.first(common), wanted.first(common)) &&
           std::ranges::all_of(rest, [](std::uint8_t byte) { return byte == 0; });
  }
  const bool unsized = held.size() == 4 && longer && od::byte_size(type) == wanted.size() && !wanted.empty();
  return unsized && std::ranges::equal(held.first(wanted.size()), wanted);
}

namespace {

// A value got no answer because the device booted.
void tell_restart(ConfigurationReport& report, const ConfiguratorOptions& options) {
  const bool unanswered = report.failure && report.failure->why == Failure::Why::error &&
                          report.failure->error.code == Errc::timeout && report.failure->stage != Stage::saving;
  if (unanswered && options.restarted && options.restarted()) report.failure->why = Failure::Why::restarted;
}

}  // namespace

struct Configurator::DateRead {
  bool missing = false;
  std::optional<Error> error;
  ConfigurationDate date;
};

// ---- one access ----

// A device that is not ready is asked again (HU.20); the SDO client already repeated unanswered requests.
rt::Task<Result<co::SdoValue>> Configurator::read(ObjectRef object, std::size_t wanted) {
  // A device may hold a longer text than the wanted one, but there is a limit.
  constexpr std::size_t least = 4096;
  const std::size_t most = std::max(least, 2 * wanted);
  for (unsigned attempt = 1;; ++attempt) {
    auto value = co_await values_->read_up_to(object.index, object.sub, most);
    if (!value && has_no_value(value.error())) co_return co::SdoValue();
    if (value || attempt >= options_->tries || !not_ready(value.error())) co_return value;
    co_await rt::sleep_for(options_->pause);
  }
}

rt::Task<Result<void>> Configurator::write(ObjectRef object, std::span<const std::uint8_t> data) {
  for (unsigned attempt = 1;; ++attempt) {
    const auto done = co_await values_->write(object.index, object.sub, data);
    if (done || attempt >= options_->tries || !not_ready(done.error())) co_return done;
    co_await rt::sleep_for(options_->pause);
  }
}

rt::Task<void> Configurator::read_date(DateRead& into) {
  into = {};
  for (const ObjectRef object : date_objects) {
    const auto value = co_await read(object);
    const auto number = value ? value->as<std::uint32_t>() : std::nullopt;
    if (number) {
      (object == date_days ? into.date.days : into.date.ms) = *number;
    } else if (value || value.error().code == Errc::aborted) {  // CiA 302-2 §Boot-up: any abort means download
      into.missing = true;
      co_return;
    } else {
      into.error = value.error();
      co_return;
    }
  }
}

// ---- reports ----

void Configurator::tell(Stage stage, std::size_t done, std::size_t total) const {
  if (options_->progress) options_->progress({stage, done, total});
}

void Configurator::tell_value(Stage stage, std::size_t done, std::size_t total) const {
  if (options_->each_value) tell(stage, done, total);
}

void Configurator::fail_at(ConfigurationReport& report, Stage stage, const Entry& entry, const Error& error) const {
  Failure failure;
  failure.stage = stage;
  failure.object = entry.object;
  failure.name = entry.name;
  failure.line = entry.line;
  failure.own = entry.own;
  failure.type = entry.type;
  failure.wanted = entry.bytes;
  failure.error = error;
  report.failure = std::move(failure);
}

void Configurator::fail_at(ConfigurationReport& report, Stage stage, ObjectRef object, const char* name,
                           const Error& error) const {
  Failure failure;
  failure.stage = stage;
  failure.object = object;
  failure.name = name;
  failure.error = error;
  report.failure = std::move(failure);
}

bool Configurator::still_there(ConfigurationReport& report, Stage stage) const {
  if (!options_->restarted || !options_->restarted()) return true;
  Failure failure;
  failure.why = Failure::Why::restarted;
  failure.stage = stage;
  report.failure = std::move(failure);
  return false;
}

bool Configurator::may_change(ConfigurationReport& report) const {
  if (!options_->before_change || options_->before_change()) return true;
  Failure failure;
  failure.why = Failure::Why::not_allowed;
  failure.stage = Stage::writing;
  report.failure = std::move(failure);
  return false;
}

// ---- the whole ----

rt::Task<void> Configurator::run(ConfigurationReport& report) {
  report = {};
  held_.clear();
  changes_.assign(wanted_->entries.size(), false);
  readable_.assign(wanted_->entries.size(), true);
  tell(Stage::dating, 0, 0);
  DateRead date;
  co_await read_date(date);
  if (date.error) {
    fail_at(report, Stage::dating, date_days, date_name, *date.error);
    co_return;
  }
  report.has_date = !date.missing;
  const bool right_date = report.has_date && date.date == wanted_->date;
  if (right_date && options_->trust_date && !options_->save_anyway) {
    report.by_date = true;
    const bool own = co_await own_agree(report);
    if (own) (void)still_there(report, Stage::dating);
    if (own || !report.good()) co_return;
    report.by_date = false;
  }
  const bool compared = co_await compare(report);
  if (!compared || !options_->write) co_return;
  const bool differs = std::ranges::find(changes_, true) != changes_.end();
  const bool needs_date = report.has_date && !right_date;
  // An unreadable value is no reason to save: a device without a date would save at every start.
  const bool worth_saving = !report.differences.empty() || needs_date || options_->save_anyway;
  if (!differs && !worth_saving) {
    (void)still_there(report, Stage::comparing);
    co_return;
  }
  if (!may_change(report)) co_return;
  if (differs && report.has_date && date.date != ConfigurationDate{}) co_await take_date();
  const bool right = co_await make_right(report, differs, needs_date, worth_saving);
  if (!right) tell_restart(report, *options_);
  // The date stays only if its values were verified.
  if (!right && report.dated) co_await take_date();
}

rt::Task<bool> Configurator::make_right(ConfigurationReport& report, bool differs, bool needs_date, bool saves) {
  if (differs) {
    co_await read_needed();
    const bool done = co_await download(report);
    if (!done) co_return false;
  }
  if (differs || needs_date) {
    const bool dated = co_await put_date(report);
    if (!dated) co_return false;
    const bool kept = co_await read_back(report);
    if (!kept) co_return false;
  }
  if (report.refused > 0 && report.dated) {
    co_await take_date();
    report.dated = report.has_date = false;
  }
  if (!saves) co_return true;
  const bool saved = co_await save(report);
  co_return saved&& still_there(report, Stage::saving);
}

// ---- comparing ----

rt::Task<bool> Configurator::own_agree(ConfigurationReport& report) {
  for (std::size_t i = 0; i < wanted_->entries.size(); ++i) {
    if (!wanted_->entries[i].own) continue;
    const bool read = co_await read_entry(i, report);
    if (!read) co_return false;
  }
  const bool agrees = report.differences.empty();
  if (!agrees) {
    report.differences.clear();
    report.compared = 0;
    changes_.assign(changes_.size(), false);
  }
  co_return agrees;
}

rt::Task<bool> Configurator::read_entry(std::size_t index, ConfigurationReport& report) {
  const Entry& entry = wanted_->entries[index];
  const ObjectRef object = entry.object;
  auto value = co_await read(object, entry.bytes.size());
  if (!value) {
    const bool write_only = !entry.compare_only && aborted_with(value.error(), {od::AbortCode::write_only});
    if (!write_only) {
      fail_at(report, Stage::comparing, entry, value.error());
      co_return goes_on(*options_, report);
    }
    readable_[index] = false;
    co_return true;
  }
  ++report.compared;
  const auto bytes = value->bytes();
  held_[object] = {bytes.begin(), bytes.end()};
  if (same_value(entry.type, bytes, entry.bytes)) co_return true;
  changes_[index] = !entry.compare_only;
  report.differences.push_back({object, entry.name, entry.line, entry.type, entry.bytes,
                                std::vector<std::uint8_t>(bytes.begin(), bytes.end()), entry.own});
  co_return true;
}

rt::Task<bool> Configurator::compare(ConfigurationReport& report) {
  const auto& entries = wanted_->entries;
  tell(Stage::comparing, 0, entries.size());
  for (std::size_t i = 0; i < entries.size(); ++i) {
    const bool read = co_await read_entry(i, report);
    if (!read) co_return false;
    tell_value(Stage::comparing, i + 1, entries.size());
  }
  // Unreadable values are written whenever anything is, and when the date does not confirm them.
  for (std::size_t i = 0; i < entries.size(); ++i) {
    if (!readable_[i]) changes_[i] = true;
  }
  for (std::size_t i = 0; i < entries.size(); ++i) {
    const auto& entry = entries[i];
    const auto held = held_.find(entry.object);
    const bool wrong = entry.compare_only && held != held_.end() && !same_value(entry.type, held->second, entry.bytes);
    if (!wrong) continue;
    fail_at(report, Stage::comparing, entry, {});
    report.failure->why = Failure::Why::differs;
    report.failure->held = held->second;
    if (!goes_on(*options_, report)) co_return false;
  }
  co_return true;
}

// Missing or unreadable objects are then not switched off.
rt::Task<void> Configurator::read_needed() {
  const auto needed = also_needed(wanted_->entries, changes_);
  for (const ObjectRef object : needed) {
    const auto value = co_await read(object);
    if (!value) continue;
    const auto bytes = value->bytes();
    held_[object] = {bytes.begin(), bytes.end()};
  }
}

// ---- writing ----

rt::Task<void> Configurator::take_date() {
  const auto nothing = four_bytes(0);
  for (const ObjectRef object : date_objects) {
    const auto done = co_await write(object, nothing);
    if (!done) co_return;  // no 1020h, or not writable: the device's own matter
  }
}

rt::Task<bool> Configurator::has_date() {
  DateRead date;
  co_await read_date(date);
  co_return !date.missing && !date.error && date.date == wanted_->date;
}

rt::Task<bool> Configurator::download(ConfigurationReport& report) {
  const auto steps = plan(wanted_->entries, changes_, held_);
  tell(Stage::writing, 0, steps.size());
  for (const auto& step : steps) {
    const ObjectRef object = step.object;
    const std::span<const std::uint8_t> bytes(step.bytes);
    const auto done = co_await write(object, bytes);
    if (!done) {
      fail_at(report, Stage::writing, wanted_->entries[step.entry], done.error());
      report.failure->object = object;
      report.failure->wanted = step.bytes;
      if (!goes_on(*options_, report)) co_return false;
      changes_[step.entry] = false;  // it is not read back
      continue;
    }
    ++report.written;
    tell_value(Stage::writing, report.written, steps.size());
  }
  co_return still_there(report, Stage::writing);
}

// A device that refuses the date, or shows another one, has no reliable date.
rt::Task<bool> Configurator::put_date(ConfigurationReport& report) {
  if (report.refused > 0) report.has_date = false;  // a part of a configuration carries none
  if (!report.has_date) co_return true;
  const auto days = four_bytes(wanted_->date.days);
  const auto ms = four_bytes(wanted_->date.ms);
  const auto first = co_await write(date_days, days);
  auto second = first;
  if (first) second = co_await write(date_ms, ms);
  if (second) {
    report.dated = true;
  } else if (second.error().code == Errc::aborted) {
    report.has_date = false;
  } else {
    fail_at(report, Stage::dating, date_days, date_name, second.error());
  }
  co_return report.good();
}

// Read after the date: a device that restarted since the writing shows its old values or its old date here. If it shows
// its old date after the new values, it restarted between them or keeps no date: its values decide.
rt::Task<bool> Configurator::read_back(ConfigurationReport& report) {
  const bool kept = co_await read_values_back(report);
  if (!kept) {
    co_await tell_a_restart(report);
    co_return false;
  }
  if (report.dated) {
    DateRead date;
    co_await read_date(date);
    if (date.error) {
      fail_at(report, Stage::reading_back, date_days, date_name, *date.error);
      co_return false;
    }
    report.has_date = report.dated = date.date == wanted_->date;
    if (!report.dated) {
      const bool still = co_await read_values_back(report);
      const bool restarted = !still && report.failure->why == Failure::Why::not_kept;
      if (restarted) report.failure->why = Failure::Why::restarted;
      if (!still) co_return false;
    }
  }
  co_return still_there(report, Stage::reading_back);
}

// The date was written after the values: if the date and a value are lost, the device restarted without its boot-up
// message being heard.
rt::Task<void> Configurator::tell_a_restart(ConfigurationReport& report) {
  const bool doubtful = report.dated && report.failure->why == Failure::Why::not_kept;
  if (!doubtful) co_return;
  DateRead date;
  co_await read_date(date);
  const bool gone = !date.error && !date.missing && date.date != wanted_->date;
  if (gone) report.failure->why = Failure::Why::restarted;
}

rt::Task<bool> Configurator::read_values_back(ConfigurationReport& report) {
  const auto& entries = wanted_->entries;
  const auto total = static_cast<std::size_t>(std::ranges::count(changes_, true));
  tell(Stage::reading_back, 0, total);
  for (std::size_t i = 0; i < entries.size(); ++i) {
    if (!changes_[i] || !readable_[i]) continue;
    const ObjectRef object = entries[i].object;
    const auto value = co_await read(object, entries[i].bytes.size());
    if (!value) {
      fail_at(report, Stage::reading_back, entries[i], value.error());
      co_return false;
    }
    if (same_value(entries[i].type, value->bytes(), entries[i].bytes)) continue;
    if (!still_there(report, Stage::reading_back)) co_return false;
    const auto bytes = value->bytes();
    fail_at(report, Stage::reading_back, entries[i], {});
    report.failure->why = Failure::Why::not_kept;
    report.failure->held.assign(bytes.begin(), bytes.end());
    if (!goes_on(*options_, report)) co_return false;
  }
  co_return true;
}

// ---- saving ----

rt::Task<bool> Configurator::save(ConfigurationReport& report) {
  const auto able = co_await read(store_all);
  if (!able && !missing(able.error())) {
    fail_at(report, Stage::saving, store_all, store_name, able.error());
    co_return false;
  }
  const auto bits = able ? able->as<std::uint32_t>().value_or(0) : 0;
  if ((bits & saves_on_command) == 0) {
    report.saved = (bits & saves_by_itself) != 0 ? Saved::by_itself : Saved::cannot;
    co_return true;
  }
  tell(Stage::saving, 0, 1);
  const auto signature = four_bytes(save_signature);
  const std::span<const std::uint8_t> data(signature);
  const auto done = co_await saving_->write(store_all.index, store_all.sub, data);
  if (!done) {
    if (done.error().code == Errc::timeout) co_return co_await ask_after_saving(report, done.error());
    fail_at(report, Stage::saving, store_all, store_name, done.error());
    co_return false;
  }
  co_return co_await check_saved(report);
}

// A restart between the last reading and the save would have saved the old values.
rt::Task<bool> Configurator::check_saved(ConfigurationReport& report) {
  report.saved = Saved::saved;
  if (!report.has_date) co_return true;
  DateRead date;
  co_await read_date(date);
  if (date.error) {
    fail_at(report, Stage::saving, date_days, date_name, *date.error);
    co_return false;
  }
  if (date.date == wanted_->date) co_return true;
  fail_at(report, Stage::saving, date_days, date_name, {});
  report.failure->why = Failure::Why::not_saved;
  co_return false;
}

// The device may still be storing and not answer meanwhile, or it restarted. It is not told to save again before it was
// heard; and a question could make some devices drop the pending answer.
rt::Task<bool> Configurator::ask_after_saving(ConfigurationReport& report, Error unanswered) {
  for (unsigned wait = 0; options_->answered_late && wait < options_->asks; ++wait) {
    co_await rt::sleep_for(options_->ask_pause);
    if (!still_there(report, Stage::saving)) co_return false;
    if (options_->answered_late()) co_return co_await check_saved(report);
  }
  for (unsigned ask = 0; ask < options_->asks; ++ask) {
    co_await rt::sleep_for(options_->ask_pause);
    if (!still_there(report, Stage::saving)) co_return false;
    DateRead date;
    co_await read_date(date);
    if (date.error) continue;
    if (report.has_date && (date.missing || date.date != wanted_->date)) {
      fail_at(report, Stage::saving, store_all, store_name, unanswered);
      report.failure->why = Failure::Why::not_saved;
      co_return false;
    }
    report.saved = Saved::unanswered;
    co_return true;
  }
  fail_at(report, Stage::saving, store_all, store_name, unanswered);
  co_return false;
}

}  // namespace berth::manager
