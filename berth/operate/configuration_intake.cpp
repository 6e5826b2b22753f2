#include "berth/operate/configuration_intake.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <filesystem>
#include <vector>

#include "berth/base/counted.hpp"
#include "berth/base/words.hpp"
#include "berth/design/machine.hpp"
#include "berth/eds/concise_dcf.hpp"
#include "berth/eds/xdd.hpp"
#include "berth/od/notation.hpp"
#include "berth/operate/configuration_fit.hpp"

namespace berth::operate {

using od::AbortCode;
using Form = WrittenFiles::Form;

namespace {

constexpr std::uint16_t identity = 0x1018;
constexpr std::uint16_t heartbeat = 0x1017;

const char* object_of(Form form) noexcept { return form == Form::dcf ? "1F20h" : "1F22h"; }

bool is_empty(Form form, std::span<const std::uint8_t> bytes) noexcept {
  if (bytes.empty()) return true;
  return form == Form::concise && bytes.size() == 4 && std::ranges::all_of(bytes, [](auto b) { return b == 0; });
}

// The slot's description: `eds =`, else the DCF or XDC of `config =`. Null: neither is there.
std::shared_ptr<const od::Description> description_of(const Seat& seat) {
  for (const std::string& path : {seat.configuration.eds, seat.slot.spec.config}) {
    if (path.empty()) continue;
    const auto reading = eds::read_any_file(path);
    if (reading.usable()) return reading.file.description;
  }
  return nullptr;
}

}  // namespace

std::string where_it_is(const WrittenFiles& files, const Seat& seat) {
  const std::string& path = seat.configuration.path;
  const std::string& named = seat.slot.spec.config;
  if (path.empty()) return "; it applies until Berth ends: there is no slot table file beside which it could be kept";
  const std::string instead =
      named.empty() ? std::string() : fmt::format(" instead of {}", berth::quoted(files.as_named(named)));
  return fmt::format("; it is kept in {}; to name it in the machine file, give the [[slot]] {} config = {}{}", path,
                     berth::quoted(seat.name()), berth::quoted(files.as_named(path)), instead);
}

void tell_written(SlotTable& slots, const WrittenFiles& files) {
  for (const auto& seat : slots.seats()) {
    const SeatConfiguration& mine = seat->configuration;
    std::error_code none;
    const bool named = !mine.path.empty() && std::filesystem::equivalent(mine.path, seat->slot.spec.config, none);
    if (!mine.written || named) continue;
    slots.events().tell(
        EventKind::step, seat->name(),
        fmt::format("the {} that was given while Berth ran applies{}; without its file, {} applies",
                    mine.written == WrittenFiles::Form::dcf ? "DCF" : "concise DCF", where_it_is(files, *seat),
                    seat->slot.spec.config.empty() ? "nothing" : "config ="));
  }
}

ConfigurationIntake::Refusal ConfigurationIntake::judge(const Seat& seat, const manager::LoadedConfiguration& loaded) {
  if (!loaded.usable()) {
    const auto error = std::ranges::find(loaded.findings, Finding::Severity::error, &Finding::severity);
    return {AbortCode::invalid_value, to_string(*error)};
  }
  std::string other = not_for(seat.slot.spec, loaded.configuration);
  if (!other.empty()) return {AbortCode::parameter_incompatible, std::move(other)};
  const auto wanted = manager::wanted(loaded.configuration, seat.id());
  if (!wanted) return {AbortCode::invalid_value, describe(wanted.error())};
  return {AbortCode::none, {}};
}

// A concise DCF says neither types nor access: the slot's description does.
ConfigurationIntake::Refusal ConfigurationIntake::judge_objects(const Seat& seat,
                                                                std::span<const std::uint8_t> stream) {
  const auto description = description_of(seat);
  auto dcf = eds::decode_concise_dcf(stream);
  if (description == nullptr || !dcf) return {AbortCode::none, {}};
  // The entries that identify the device.
  std::erase_if(dcf->entries, [](const auto& entry) { return entry.object.index == identity; });
  const auto values = eds::parameters(*dcf, *description, seat.id());
  if (!values) {
    return {AbortCode::parameter_incompatible,
            describe(values.error()) + "; write entries that fit the description of the slot's device"};
  }
  for (const auto& entry : dcf->entries) {
    if (od::writable(description->find(entry.object)->access)) continue;
    return {AbortCode::read_only,
            fmt::format("{} cannot be written, by the description of the slot's device; leave its entry out",
                        od::write_object(entry.object))};
  }
  return {AbortCode::none, {}};
}

// In messages about its content.
std::string ConfigurationIntake::name_of(const Given& given) {
  return given.file.empty() ? object_of(given.form) : given.file;
}

ConfigurationIntake::Answer ConfigurationIntake::refuse(const Seat& seat, const Given& given, const Refusal& refusal) {
  const std::string what = given.file.empty() ? fmt::format("what an SDO client wrote to {}:{:02X}",
                                                            object_of(given.form), seat.id().value())
                                              : "the configuration from " + berth::quoted(given.file);
  std::string words = fmt::format("{} is refused, and nothing has changed: {}", what, refusal.why);
  slots_.events().tell(EventKind::error, seat.name(), words);
  return {refusal.code, std::move(words)};
}

ConfigurationIntake::Answer ConfigurationIntake::tell(const Seat& seat, std::string words) {
  slots_.events().tell(EventKind::step, seat.name(), words);
  return {AbortCode::none, std::move(words)};
}

// Where both differ, the machine file takes precedence (`Configuring::add_links`, 1017h).
std::string ConfigurationIntake::counted_by_berth(const Seat& seat, const manager::Configuration& written) const {
  std::vector<std::string> names;
  const auto has = manager::wanted(written, seat.id());
  const auto* const links = configuring_.linked(seat);
  const auto over = links != nullptr ? manager::wanted(*links, seat.id()) : Result<manager::Wanted>(manager::Wanted{});
  for (const auto& entry : has ? has->entries : std::vector<manager::Entry>{}) {
    if (entry.object.index == heartbeat) names.emplace_back("1017h (heartbeat_period)");
    if (!over) continue;
    const auto at = std::ranges::find(over->entries, entry.object, &manager::Entry::object);
    if (at != over->entries.end() && at->bytes != entry.bytes) names.push_back(od::write_object(entry.object));
  }
  if (names.empty()) return {};
  return "; Berth keeps what the machine file says of " + some_of(names);
}

// Each value is compared, because the device's date is not that of the configuration wanted now.
void ConfigurationIntake::not_configured_yet(Seat& seat) {
  const auto& confirmed = seat.slot.record.confirmed;
  if (!confirmed) return;
  const places::Configured fact{places::Configured::Stage::writing, confirmed->device, 0, 0};
  if (seat.slot.record.configured == fact) return;
  const auto noted = slots_.store().configure(seat.slot.record.slot, fact, seat.configuration.file);
  if (!noted) {
    slots_.events().tell(EventKind::error, seat.name(), "the slot table cannot be written: " + describe(noted.error()));
  }
  seat.slot.record.configured = fact;
}

ConfigurationIntake::Answer ConfigurationIntake::take_away(Seat& seat, const Given& given) {
  SeatConfiguration& mine = seat.configuration;
  if (mine.written != given.form) return {};
  const WrittenFiles& files = configuring_.written();
  const std::string kept = files.of(seat.slot.spec.name);
  std::error_code none;
  if (!kept.empty() && std::filesystem::equivalent(kept, seat.slot.spec.config, none)) {
    return refuse(seat, given,
                  {AbortCode::local_control,
                   fmt::format("config = of the machine file names {}; leave it out there first", kept)});
  }
  const auto dropped = files.drop(seat.slot.spec.name);
  if (!dropped) return refuse(seat, given, {AbortCode::not_stored, describe(dropped.error())});
  configuring_.load(seat);
  not_configured_yet(seat);
  return tell(seat, fmt::format("{} removed what was written to {}; {} applies from the next configuration on",
                                given.file.empty() ? "an SDO client" : "a user", object_of(given.form),
                                mine.any() ? mine.file : std::string("no configuration")));
}

ConfigurationIntake::Answer ConfigurationIntake::take(Seat& seat, Form form, std::span<const std::uint8_t> bytes,
                                                      const std::string& file) {
  const Given given{form, file};
  if (is_empty(form, bytes)) return take_away(seat, given);
  auto loaded = form == Form::dcf ? manager::read_configuration(std::string(bytes.begin(), bytes.end()), name_of(given))
                                  : manager::read_concise_configuration(bytes, name_of(given));
  Refusal refusal = judge(seat, loaded);
  if (refusal.code == AbortCode::none && form == Form::concise) refusal = judge_objects(seat, bytes);
  if (refusal.code != AbortCode::none) return refuse(seat, given, refusal);
  const auto kept = configuring_.written().keep(seat.slot.spec.name, form, bytes);
  if (!kept) return refuse(seat, given, {AbortCode::not_stored, describe(kept.error())});
  auto& configuration = loaded.configuration;
  if (!kept->empty()) configuration.file = *kept;
  const char* const what = form == Form::dcf ? "a DCF" : "a concise DCF";
  const std::string came = file.empty() ? fmt::format("an SDO client wrote {} to {}", what, object_of(form))
                                        : fmt::format("a user gave {} ({})", what, berth::quoted(file));
  const std::string text =
      fmt::format("{}: {} apply from the next configuration on (at its next boot-up, or by {}){}", came,
                  counted(configuration.settings.size(), "value"), file.empty() ? "1F25h" : "`berth configure`",
                  counted_by_berth(seat, configuration));
  configuring_.begin_with(seat, std::move(configuration), *kept);
  SeatConfiguration& mine = seat.configuration;
  mine.written = form;
  if (kept->empty() && form == Form::dcf) mine.uploaded.assign(bytes.begin(), bytes.end());
  not_configured_yet(seat);
  return tell(seat, text + where_it_is(configuring_.written(), seat));
}

}  // namespace berth::operate
