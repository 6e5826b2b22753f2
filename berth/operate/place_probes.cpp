#include "berth/operate/place_probes.hpp"

#include <fmt/format.h>

#include <algorithm>

namespace berth::operate {

using places::Probe;
using places::Reading;

namespace {

constexpr std::size_t longest_probe = 8;  // longer or endless values are no place

std::string name_of(const Probe& probe) { return fmt::format("{:04X}h:{:02X}", probe.index, probe.sub); }

std::string text_of(const std::optional<std::uint32_t>& value) {
  return value ? fmt::format("{:X}h", *value) : std::string("nothing");
}

}  // namespace

void PlaceProbes::forget(const Identity& device) {
  std::erase_if(readings_, [&](const Reading& r) { return r.device == device; });
}

// False: it does not answer.
rt::Task<bool> PlaceProbes::read_probes(Identity device, NodeId id) {
  const std::vector<places::Slot> all = slots_.plain();
  const std::vector<Probe> probes = places::probes_for(all, device);
  forget(device);
  co::SdoOptions patience = s_.sdo.options();
  patience.longest = longest_probe;
  for (const Probe& probe : probes) {
    const auto value = co_await s_.sdo.upload(id, probe.index, probe.sub, patience);
    const bool there = value || value.error().code == Errc::aborted || value.error().code == Errc::mismatch;
    if (!there) co_return false;
    Reading reading{device, probe.index, probe.sub, std::nullopt};
    if (value) {
      const auto bytes = value->bytes();
      std::uint32_t number = 0;
      for (std::size_t i = 0; i < bytes.size() && i < 4; ++i) number |= static_cast<std::uint32_t>(bytes[i]) << (8 * i);
      if (!bytes.empty() && bytes.size() <= 4) reading.value = number;
    }
    readings_.push_back(reading);
  }
  co_return true;
}

void PlaceProbes::note_puzzling(const std::vector<places::Question>& questions) {
  for (const auto& question : questions) {
    const bool probed = std::ranges::any_of(
        question.slots, [&](std::size_t i) { return slots_.seats()[i]->slot.spec.probe.has_value(); });
    if (probed) puzzling_ = question.devices;
  }
}

rt::Task<bool> PlaceProbes::read_places(std::vector<Identity> devices) {
  constexpr unsigned patience = 3;
  bool any = false;
  co_await lending_.prepare();
  for (const Identity& device : devices) {
    const auto read = co_await read_place(device);
    any = any || read;
  }
  const auto unheard = [&](const Identity& device) {
    return slots_.of(device) == nullptr && found_.of(device) == nullptr;
  };
  const bool gone = std::ranges::any_of(devices, unheard) || std::ranges::any_of(puzzling_, unheard);
  unread_rounds_ = gone ? unread_rounds_ + 1 : 0;
  if (gone && unread_rounds_ <= patience) {
    agenda_.look_anew = true;
    co_return false;
  }
  puzzling_.clear();
  co_return any;
}

rt::Task<bool> PlaceProbes::read_place(Identity device) {
  const auto active = co_await asking_.active_id(device);
  if (!active) {
    if (active.error().code == Errc::duplicate) found_.note({device, NodeId(), true});
    if (active.error().code == Errc::timeout) found_.forget(device);
    co_return true;
  }
  NodeId id = *active;
  found_.note({device, id});
  const Seat* const holder = slots_.at(id);
  const bool taken = holder != nullptr && holder->slot.record.device() && holder->slot.record.device() != device;
  if (taken) co_return false;  // it is blanked first
  if (!id.configured()) {
    const auto lent = co_await lending_.lend_to(device);
    if (!lent) {
      slots_.events().tell_once(
          EventKind::error, fmt::format("the place of {} cannot be read: {}", to_string(device), lent.error().text));
      co_return false;
    }
    id = *lent;
    found_.note({device, id});
  }
  bool read = co_await read_probes(device, id);
  if (!read) {
    const bool woken = co_await lending_.wake(device, id);
    if (woken) read = co_await read_probes(device, id);
  }
  if (read) {
    for (const auto& r : readings_) {
      if (r.device != device) continue;
      slots_.events().tell(
          EventKind::step, "",
          fmt::format("{} has {} in {:04X}h:{:02X}", to_string(device), text_of(r.value), r.index, r.sub));
    }
  } else {
    slots_.events().tell(
        EventKind::error, "",
        fmt::format("{} does not answer under node-ID {} to its probe", to_string(device), id.value()));
  }
  co_return read;
}

rt::Task<bool> PlaceProbes::stays_in_place(Seat& seat) {
  if (!seat.slot.spec.probe || s_.only_observes()) co_return true;
  const Identity device = seat.slot.record.confirmed->device;
  const NodeId id = seat.id();
  const Probe own = *seat.slot.spec.probe;
  const auto read = co_await read_probes(device, id);
  const auto shows = [&](const Probe& probe) {
    return std::ranges::any_of(readings_, [&](const Reading& r) {
      return r.device == device && r.index == probe.index && r.sub == probe.sub && r.value && probe.matches(*r.value);
    });
  };
  if (shows(own)) {
    forget(device);
    co_return true;
  }
  const auto other = std::ranges::find_if(slots_.seats(), [&](const auto& s) {
    const auto& spec = s->slot.spec;
    return s.get() != &seat && spec.probe && places::fits(spec, device) && shows(*spec.probe);
  });
  if (other == slots_.seats().end()) {
    const auto it = std::ranges::find_if(
        readings_, [&](const Reading& r) { return r.device == device && r.index == own.index && r.sub == own.sub; });
    const std::string has = !read                   ? "it does not answer"
                            : it == readings_.end() ? "it was not read"
                                                    : "it has " + text_of(it->value);
    slots_.happened(seat, SlotEvent::misplaced,
                    fmt::format("its probe {} must be {:X}h in this place, and {}; is it in the right place?",
                                name_of(own), own.value, has));
    co_return false;
  }
  const std::string reason =
      fmt::format("by its probe {} its device is in the place of slot {}", name_of(own), (*other)->name());
  slots_.events().tell(EventKind::moved, seat.name(), reason);
  const auto cleared = slots_.clear(seat, reason);
  if (!cleared) {
    slots_.happened(seat, SlotEvent::binding_failed, "the slot table cannot be written: " + describe(cleared.error()));
    co_return false;
  }
  found_.note({device, id});
  agenda_.look_anew = true;
  agenda_.wakes.push({Wake::Kind::look, id, s_.executor.now()});
  co_return false;
}

}  // namespace berth::operate
