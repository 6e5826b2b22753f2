#include "berth/operate/spares.hpp"

#include <fmt/format.h>

#include <algorithm>

namespace berth::operate {

using places::Mark;

namespace {

constexpr std::uint32_t load_signature = 0x6461'6F6C;  // "load", CiA 301 §7.5.2.14
constexpr std::size_t most_formers = 4;                // of one slot; others are not looked for

}  // namespace

// The devices that may have this slot's node-ID in their memory and sit nowhere now, newest first: they sat here, were
// assigned it and never heard under it, or were to give it up.
std::vector<Identity> Spares::formers_of(const Seat& seat) const {
  std::vector<Identity> devices;
  const auto lines = slots_.store().history(seat.slot.record.slot);
  if (!lines) return devices;
  for (auto line = lines->rbegin(); line != lines->rend() && devices.size() < most_formers; ++line) {
    const bool told = (line->event == "confirmed" || line->event == "asked") && line->device && line->id == seat.id();
    if (!told || slots_.of(*line->device) != nullptr) continue;
    if (std::ranges::find(devices, *line->device) == devices.end()) devices.push_back(*line->device);
  }
  for (const auto& blank : slots_.unfinished_here()) {
    const bool known = std::ranges::find(devices, blank.device) != devices.end();
    if (blank.id == seat.id() && !known && slots_.of(blank.device) == nullptr) devices.push_back(blank.device);
  }
  return devices;
}

rt::Task<bool> Spares::isolate_former(Seat& seat) {
  if (s_.only_observes() || !seat.slot.record.confirmed) co_return false;
  const Formers formers = co_await isolate(seat, formers_of(seat));
  // The device that was heard here may have missed the question: it is asked for twice more.
  seat.doubt.suspect = formers.silent && !formers.isolated && ++seat.doubt.suspected < 3;
  if (!seat.doubt.suspect) seat.doubt.suspected = 0;
  if (seat.doubt.suspect) agenda_.look_anew = true;
  co_return formers.isolated;
}

rt::Task<bool> Spares::look_for_formers() {
  bool untold = false;
  for (const auto& seat : slots_.seats()) {
    Doubt& doubt = seat->doubt;
    const bool due = doubt.former_at && s_.executor.now() >= *doubt.former_at && seat->there();
    if (!due || s_.only_observes() || !seat->slot.record.confirmed) continue;
    const std::vector<Identity> formers = formers_of(*seat);
    co_await isolate(*seat, formers);
    doubt.former_pause = std::min(2 * doubt.former_pause, longest_pause);
    doubt.former_at = s_.executor.now() + doubt.former_pause;
    if (formers.empty()) doubt.former_at.reset();
    const auto is_untold = [this](const Identity& d) { return !d.has_serial() || planning_.never_by_lss(d); };
    if (std::ranges::none_of(formers, is_untold)) continue;
    doubt.shared = std::max(doubt.shared, 1U);
    untold = true;
  }
  co_return untold;
}

rt::Task<Spares::Formers> Spares::isolate(Seat& seat, std::vector<Identity> formers) {
  Formers result;
  for (const auto& device : formers) {
    if (erased_.uses(device, seat.id())) continue;  // it gave the node-ID up already
    Result<NodeId> id = co_await asking_.active_id_once(device);
    const bool slowly = !id && seat.doubt.suspected > 0;
    if (slowly) id = co_await asking_.active_id(device);
    result.silent = result.silent || !id;
    if (!id || *id != seat.id()) continue;
    const auto sat = slots_.former_seat_of(device);
    const std::string text =
        sat ? planning_.text_of_return(device, *sat)
            : fmt::format("a device that sat in slot {} is back: {}", seat.name(), to_string(device));
    if (planning_.never_by_lss(device)) {  // it refused: only a user can remove it
      slots_.events().tell_once(EventKind::returned, text);
      planning_.returned(device, *id, text);
      continue;
    }
    slots_.events().tell(EventKind::returned, seat.name(), text);
    const std::string reason = "its slot was given to another device";
    // The reset also reaches the slot's own device; its boot-up then is no error.
    if (seat.is_booted()) seat.slave.status.phase = network::SlavePhase::awaited;
    const bool gone = co_await seating_.blank(device, reason);
    planning_.returned(device, gone ? NodeId() : *id, text);
    result.isolated = true;
    agenda_.look_anew = true;  // so that the plan includes this device
  }
  co_return result;
}

rt::Task<bool> Spares::clear_past(Seat& seat) {
  if (s_.only_observes()) co_return true;
  const Identity device = seat.slot.record.confirmed->device;
  const bool fresh = std::exchange(seat.fresh, false);
  bool restores = slots_.is_marked(Mark::restore, device);
  bool asks = slots_.is_marked(Mark::looks_used, device);
  const bool spare = fresh && !restores && !asks && had_another(seat, device);
  if (spare) {
    const auto dated = co_await foreign_date(seat);
    if (!dated) {
      seat.fresh = true;
      slots_.set_absent(seat, "its configuration date cannot be read: " + describe(dated.error()));
      co_return false;
    }
    const bool welcome =
        std::ranges::find(welcome_, device) != welcome_.end() || places::listed_spare(seat.slot.spec, device);
    restores = *dated && welcome;
    asks = *dated && !welcome;
    if (restores) slots_.set_mark(Mark::restore, device, seat.id(), "it has the configuration of another place");
    if (asks) slots_.set_mark(Mark::looks_used, device, seat.id(), "it has the configuration of another place");
  }
  if (asks) {
    slots_.happened(seat, SlotEvent::asks_person,
                    fmt::format("device {} has a configuration that is not of this slot (1020h): use it? `berth "
                                "replace {} --used` gives it its factory settings first; otherwise take it off the bus",
                                to_string(device), seat.name()));
    co_return false;
  }
  if (!restores) co_return true;
  co_return co_await restore_seat(seat);
}

bool Spares::has_past(const Seat& seat) const {
  const Identity& device = seat.slot.record.confirmed->device;
  const bool marked = slots_.is_marked(Mark::restore, device) || slots_.is_marked(Mark::looks_used, device);
  return marked || had_another(seat, device);
}

bool Spares::had_another(const Seat& seat, const Identity& device) const {
  const auto lines = slots_.store().history(seat.slot.record.slot);
  return lines && std::ranges::any_of(*lines, [&](const places::HistoryEntry& line) {
           return line.event == "confirmed" && line.device != device;
         });
}

rt::Task<Result<bool>> Spares::foreign_date(Seat& seat) {
  const NodeId id = seat.id();
  const auto days = co_await s_.sdo.read<std::uint32_t>(id, 0x1020, 1);
  if (!days && days.error().code != Errc::aborted) co_return fail(days.error());
  if (!days || *days == 0) co_return false;
  const auto ms = co_await s_.sdo.read<std::uint32_t>(id, 0x1020, 2);
  if (!ms && ms.error().code != Errc::aborted) co_return fail(ms.error());
  if (!seat.configuration.wanted) co_return true;
  const auto wanted = co_await configuring_.wanted_of(seat);
  if (!wanted) co_return fail(wanted.error());
  const manager::ConfigurationDate has{*days, ms.value_or(0)};
  co_return has != wanted->date;
}

// 1011h:01 "load", then a reset. The device then has its factory settings, perhaps no node-ID, and is bound again.
rt::Task<bool> Spares::restore_seat(Seat& seat) {
  const NodeId id = seat.id();
  const Identity device = seat.slot.record.confirmed->device;
  co::SdoOptions patience = s_.sdo.options();
  patience.timeout = s_.bus.timing.save_timeout;
  const auto loaded = co_await s_.sdo.write<std::uint32_t>(id, 0x1011, 1, load_signature, patience);
  if (!loaded && loaded.error().code != Errc::aborted) {
    slots_.set_absent(seat, "its factory settings could not be asked for: " + describe(loaded.error()));
    co_return false;
  }
  if (!loaded) {
    slots_.events().tell(EventKind::restored, seat.name(),
                         "it cannot restore its factory settings (1011h): " + describe(loaded.error()));
    slots_.take_mark(Mark::restore, device, "it has no 1011h, or refuses");
    co_return true;
  }
  if (!s_.may_command()) {
    slots_.happened(seat, SlotEvent::saves_for_power, "its factory settings are in use after a power cycle");
    slots_.take_mark(Mark::restore, device, "loaded; in use after a power cycle");
    co_return false;
  }
  const rt::Time began = s_.executor.now();
  const auto sent = co_await s_.nmt.send(co::NmtCommand::reset_node, id);
  if (!sent) {
    slots_.happened(seat, SlotEvent::boot_failed, "it could not be reset: " + describe(sent.error()));
    co_return false;
  }
  const bool booted = co_await s_.boots.wait(id, began, began + s_.bus.timing.boot_timeout);
  slots_.take_mark(Mark::restore, device, booted ? "loaded, and booted with them" : "loaded, and reset");
  slots_.events().tell(EventKind::restored, seat.name(), fmt::format("{} has its factory settings", to_string(device)));
  const auto who = co_await places::read_identity(s_.sdo, id);
  const bool same = who && seat.sits(*who);
  seat.checked = s_.executor.now();
  if (same) co_return true;
  agenda_.look_anew = true;
  slots_.set_absent(seat, "it did not come back under its node-ID when it got its factory settings");
  co_await presence_.look_by_lss(seat);
  co_return false;
}

void Spares::make_welcome(const Identity& device) {
  welcome_.push_back(device);
  if (slots_.former_seat_of(device))
    slots_.set_mark(Mark::restore, device, NodeId(), "factory reset requested by operator");
  slots_.take_mark(Mark::looks_used, device, "released for use by operator");
  slots_.take_mark(Mark::fixed, device, "the user named it: Berth tries again");
}

}  // namespace berth::operate
