#include "berth/places/plan.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <map>
#include <optional>

#include "berth/base/words.hpp"
#include "berth/places/assignment.hpp"

namespace berth::places {
namespace {

/// The slots and the new devices of one type.
struct Group {
  std::vector<std::size_t> free;
  std::vector<Found> fresh;
};

std::string capital(std::string text) {
  if (!text.empty() && text[0] >= 'a' && text[0] <= 'z') text[0] = static_cast<char>(text[0] - 'a' + 'A');
  return text;
}

/// The unfinished plan.
class Draft {
 public:
  Draft(const std::vector<Slot>& slots, const std::vector<Found>& found, NodeId master)
      : slots_(slots), found_(found), master_(master) {}

  [[nodiscard]] Plan& plan() noexcept { return plan_; }
  [[nodiscard]] const Slot* seat_of(const Identity& device) const {
    auto it = std::ranges::find_if(slots_, [&](const Slot& s) { return s.record.device() == device; });
    // A device without a serial number counts as the one that a slot waits for, whatever its node-ID.
    if (it == slots_.end() && !device.has_serial()) {
      it = std::ranges::find_if(slots_, [&](const Slot& s) {
        return s.record.intended && s.record.intended->device.address == device.address;
      });
    }
    return it == slots_.end() ? nullptr : &*it;
  }

  void blank(const Identity& device, std::string reason) {
    const bool planned = std::ranges::any_of(
        plan_.actions, [&](const Action& a) { return a.kind == Action::Kind::blank && a.device == device; });
    if (!planned) plan_.actions.push_back({Action::Kind::blank, 0, device, std::move(reason)});
  }

  void bind(std::size_t slot, const Identity& device, std::string reason) {
    plan_.actions.push_back({Action::Kind::bind, slot, device, std::move(reason)});
  }

  /// Another device than `device` that was found at `id` must give up that node-ID first.
  void make_way(const Identity& device, NodeId id) {
    for (const auto& other : found_) {
      if (other.device != device && other.active == id && !other.clone && !other.lent) {
        blank(other.device, fmt::format("it holds node-ID {} of another slot", id.value()));
      }
    }
  }

  void report_clone(const Found& f) {
    plan_.oddities.push_back(
        {OddityKind::clone, f.device, f.active,
         f.device.has_serial()
             ? fmt::format("more than one device answers to LSS address {}; take one away, or give it a serial number "
                           "of its own",
                           to_string(f.device))
             : fmt::format("several devices {} have no serial number and wait for a node-ID: LSS cannot distinguish "
                           "them; switch them on one at a time",
                           to_string(f.device))});
  }

  /// A device without a slot may keep its node-ID only if no slot of this bus needs it.
  void keep_off_our_ids(const Found& f) {
    if (f.active.configured() && id_is_taken(f.active) && !f.clone && !f.lent) {
      blank(f.device, fmt::format("it holds node-ID {}, which belongs to {}", f.active.value(),
                                  f.active == master_ ? "the master" : "a slot"));
    }
  }

  void leave(const Found& f, OddityKind kind, const std::string& what) {
    plan_.oddities.push_back({kind, f.device, f.active, fmt::format("device {} {}", to_string(f.device), what)});
    keep_off_our_ids(f);
  }

  /// The free slot whose node-ID the device had when it came.
  [[nodiscard]] std::optional<std::size_t> own_place(const std::vector<std::size_t>& free, const Found& f) const {
    if (!f.active.configured() || f.lent || f.shared) return std::nullopt;
    const auto own = std::ranges::find_if(
        free, [&](std::size_t i) { return slots_[i].spec.id == f.active && fits(slots_[i].spec, f.device); });
    const bool alone = std::ranges::count(found_, f.active, &Found::active) == 1;
    if (own == free.end() || !alone) return std::nullopt;
    return *own;
  }

  void seat(std::size_t slot, const Found& f) {
    const NodeId id = slots_[slot].spec.id;
    make_way(f.device, id);
    if (f.active != id) keep_off_our_ids(f);
    bind(slot, f.device, "discovered");
  }

  void ask(const std::vector<std::size_t>& free, const std::vector<Found>& fresh, const char* what_else) {
    Question q;
    q.slots = free;
    std::vector<std::string> devices;
    for (const auto& f : fresh) {
      q.devices.push_back(f.device);
      devices.push_back(to_string(f.device));
    }
    std::vector<std::string> names;
    for (const auto i : free) names.push_back(slots_[i].spec.name.name);
    q.brief = fmt::format("{} new device{} of type {} and {} free slot{}: which belongs where?", fresh.size(),
                          fresh.size() == 1 ? "" : "s", to_string(fresh.front().device.type()), free.size(),
                          free.size() == 1 ? "" : "s");
    q.text = fmt::format("{} Devices: {}. Slots: {}. {}ame them with `berth replace SLOT --device ADDRESS`", q.brief,
                         some_of(devices), names.empty() ? "-" : some_of(names),
                         what_else == nullptr ? std::string("N") : capital(what_else) + ", or n");
    for (const auto& f : fresh) {
      if (!own_place(free, f)) keep_off_our_ids(f);
    }
    plan_.questions.push_back(std::move(q));
  }

  [[nodiscard]] std::vector<std::size_t> places_free(std::vector<std::size_t> places) const {
    std::erase_if(places, [&](std::size_t i) {
      return std::ranges::any_of(plan_.actions,
                                 [&](const Action& a) { return a.kind == Action::Kind::bind && a.slot == i; });
    });
    return places;
  }

 private:
  [[nodiscard]] bool id_is_taken(NodeId id) const {
    return id == master_ || std::ranges::any_of(slots_, [&](const Slot& s) { return s.spec.id == id; });
  }

  const std::vector<Slot>& slots_;
  const std::vector<Found>& found_;
  NodeId master_;
  Plan plan_;
};

class PlanMaker {
 public:
  PlanMaker(const std::vector<Slot>& slots, const std::vector<Found>& found, const std::vector<Identity>& blanks,
            NodeId master, const std::vector<Reading>& readings)
      : slots_(slots),
        found_(found),
        blanks_(blanks),
        master_(master),
        readings_(readings),
        draft_(slots, found, master) {}

  Plan make() {
    finish_blanks();
    finish_and_repair();
    seat_new_devices();
    // A device that holds another's node-ID gives it up before any device is bound.
    std::ranges::stable_partition(draft_.plan().actions, [](const Action& a) { return a.kind == Action::Kind::blank; });
    return std::move(draft_.plan());
  }

 private:
  void finish_blanks() {
    for (const auto& device : blanks_) {
      if (draft_.seat_of(device) == nullptr) draft_.blank(device, "finishing what an earlier run began");
    }
  }

  void finish_and_repair() {
    for (std::size_t i = 0; i < slots_.size(); ++i) {
      const auto& [spec, record] = slots_[i];
      if (record.intended) {
        draft_.make_way(record.intended->device, spec.id);
        draft_.bind(i, record.intended->device, "finishing what an earlier run began");
      } else if (record.confirmed && record.confirmed->id != spec.id) {
        draft_.make_way(record.confirmed->device, spec.id);
        draft_.bind(i, record.confirmed->device, fmt::format("the slot's node-ID is {} now", spec.id.value()));
      } else if (record.confirmed) {
        const auto heard = std::ranges::find(found_, record.confirmed->device, &Found::device);
        if (heard == found_.end() || heard->active == spec.id) continue;
        if (heard->clone) {
          draft_.report_clone(*heard);
          continue;
        }
        draft_.make_way(heard->device, spec.id);
        draft_.bind(i, heard->device,
                    heard->active.configured() ? fmt::format("it came with node-ID {}", heard->active.value())
                                               : "it came without its node-ID");
      }
    }
  }

  void seat_new_devices() {
    std::map<TypeCode, Group> groups;
    for (std::size_t i = 0; i < slots_.size(); ++i) {
      if (!slots_[i].record.device() && slots_[i].spec.assign == Assign::lss)
        groups[slots_[i].spec.type].free.push_back(i);
    }
    for (const auto& f : found_) {
      if (draft_.seat_of(f.device) != nullptr) continue;
      if (f.clone) {
        draft_.report_clone(f);
        draft_.keep_off_our_ids(f);
        continue;
      }
      groups[group_of(f)].fresh.push_back(f);
    }
    const auto first = draft_.plan().actions.size();
    for (auto& [type, group] : groups) seat_group(group);
    // In the order of the slots, as in paper 1's Figure 10.
    std::stable_sort(draft_.plan().actions.begin() + static_cast<std::ptrdiff_t>(first), draft_.plan().actions.end(),
                     [&](const Action& a, const Action& b) { return rank(a) < rank(b); });
  }

  /// A successor (`also`) belongs to the type of a slot that it may sit in, a free one if there is one. A device that
  /// does not report its whole type belongs to the type of the slot whose node-ID it came with.
  [[nodiscard]] TypeCode group_of(const Found& found) const {
    const Identity& device = found.device;
    const auto takes = [&](const Slot& s) {
      return !s.record.device() && s.spec.assign == Assign::lss && fits(s.spec, device);
    };
    const auto own = std::ranges::find_if(
        slots_, [&](const Slot& s) { return s.spec.id == found.active && !found.lent && takes(s); });
    if (own != slots_.end()) return own->spec.type;
    const auto free = std::ranges::find_if(slots_, takes);
    if (free != slots_.end()) return free->spec.type;
    const auto any = std::ranges::find_if(slots_, [&](const Slot& s) { return fits(s.spec, device); });
    return any == slots_.end() ? device.type() : any->spec.type;
  }

  [[nodiscard]] bool fixed_slot_waits(const TypeCode& type) const {
    return std::ranges::any_of(slots_, [&](const Slot& s) {
      return s.spec.type == type && s.spec.assign != Assign::lss && !s.record.device();
    });
  }

  [[nodiscard]] bool takes(std::size_t slot, const Found& f) const {
    return fits(slots_[slot].spec, f.device) && (!f.keeps || slots_[slot].spec.id == f.active);
  }

  [[nodiscard]] unsigned rank(const Action& a) const {
    return a.kind == Action::Kind::blank ? 0U : slots_[a.slot].spec.id.value();
  }

  void seat_group(Group& group) {
    auto& [free, fresh] = group;
    // Rule 2: among the devices of this run, the larger R_SN belongs in the slot of the larger number (S1.35).
    std::ranges::sort(free, {}, [&](std::size_t i) { return slots_[i].spec.id; });
    std::ranges::sort(fresh, {}, [](const Found& f) { return f.device.r_sn(); });
    seat_listed_spares(group);
    leave_who_fits_nowhere(group);
    seat_by_probe(group);
    seat_who_has_one_place(group);
    for (auto& part : parts(group)) seat_by_mode(part);
  }

  [[nodiscard]] FitGraph graph_of(const Group& group) const {
    FitGraph graph{group.free.size(), {}};
    for (const auto& f : group.fresh) {
      std::vector<std::size_t> slots;
      for (std::size_t k = 0; k < group.free.size(); ++k) {
        if (takes(group.free[k], f)) slots.push_back(k);
      }
      graph.fits.push_back(std::move(slots));
    }
    return graph;
  }

  /// Binds devices that can sit in only one slot: there is nothing to ask about them.
  void seat_who_has_one_place(Group& group) {
    const Group all = group;
    const auto places = only_places(graph_of(all));
    for (std::size_t d = 0; d < places.size(); ++d) {
      if (places[d]) take(group, all.free[*places[d]], all.fresh[d]);
    }
  }

  /// The rest, in independent parts, such as two revisions of one type.
  [[nodiscard]] std::vector<Group> parts(const Group& group) const {
    std::vector<Group> all;
    for (const auto& component : components(graph_of(group))) {
      Group part;
      for (const auto d : component.devices) part.fresh.push_back(group.fresh[d]);
      for (const auto k : component.slots) part.free.push_back(group.free[k]);
      all.push_back(std::move(part));
    }
    return all;
  }

  void take(Group& group, std::size_t slot, const Found& f) {
    draft_.seat(slot, f);
    std::erase(group.free, slot);
    const Identity device = f.device;  // a copy: `f` may be the erased element
    std::erase_if(group.fresh, [&](const Found& each) { return each.device == device; });
  }

  /// A spare that two slots list goes to the lower one.
  void seat_listed_spares(Group& group) {
    const std::vector<Found> fresh = group.fresh;
    for (const auto& f : fresh) {
      const auto slot = std::ranges::find_if(
          group.free, [&](std::size_t i) { return takes(i, f) && listed_spare(slots_[i].spec, f.device); });
      if (slot != group.free.end()) take(group, *slot, f);
    }
  }

  void leave_who_fits_nowhere(Group& group) {
    std::erase_if(group.fresh, [&](const Found& f) {
      const auto fits_it = [&](std::size_t i) { return fits(slots_[i].spec, f.device); };
      if (std::ranges::any_of(group.free, [&](std::size_t i) { return takes(i, f); })) return false;
      const bool known_type = std::ranges::any_of(
          slots_, [&](const Slot& s) { return s.spec.type == f.device.type() || fits(s.spec, f.device); });
      const bool waits_for_another = misplaced(f);
      if (waits_for_another) return true;
      if (!known_type) {
        draft_.leave(
            f, OddityKind::foreign,
            fmt::format("is of a type that this machine has no slot for; take it off the bus, add a slot, or "
                        "write into the slot that may have it: also = [{{ vendor = 0x{:X}, product = 0x{:X} }}]",
                        f.device.type().vendor, f.device.type().product));
      } else if (fixed_slot_waits(f.device.type()) || std::ranges::any_of(group.free, fits_it)) {
        draft_.plan().oddities.push_back(
            {OddityKind::fixed_mismatch, f.device, f.active,
             fmt::format("device {} is of a type whose slot expects a fixed node-ID, and does not have "
                         "it; set its switches, or put it into the right place",
                         to_string(f.device))});
      } else if (group.free.empty()) {
        draft_.leave(f, OddityKind::surplus, surplus(f));
      } else {
        draft_.leave(f, OddityKind::wrong_revision,
                     "has a revision that no free slot accepts; see the slots' `revision`");
      }
      return true;
    });
  }

  [[nodiscard]] std::string surplus(const Found& f) const {
    std::vector<std::string> names;
    for (const Slot& slot : slots_) {
      if (slot.spec.type == f.device.type() || fits(slot.spec, f.device)) names.push_back(slot.spec.name.name);
    }
    return fmt::format("is of the type of {}, and {} device; take it off the bus, or `berth replace` {}",
                       some_of(names), names.size() == 1 ? "that has its" : "each has its",
                       names.size() == 1 ? "that" : "one of them");
  }

  // ---- probe ----

  [[nodiscard]] const Reading* reading(const Identity& device, const Probe& probe) const {
    const auto it = std::ranges::find_if(readings_, [&](const Reading& r) {
      return r.device == device && r.index == probe.index && r.sub == probe.sub;
    });
    return it == readings_.end() ? nullptr : &*it;
  }
  [[nodiscard]] bool shows(const Identity& device, const Probe& probe) const {
    const auto* const read = reading(device, probe);
    return read != nullptr && read->value && probe.matches(*read->value);
  }
  /// By its probe, the device sits in the place of a slot that has another device.
  bool misplaced(const Found& f) {
    const auto place = std::ranges::find_if(slots_, [&](const Slot& s) {
      return s.spec.probe && s.record.device() && fits(s.spec, f.device) && shows(f.device, *s.spec.probe);
    });
    if (place == slots_.end()) return false;
    draft_.leave(f, OddityKind::misplaced,
                 fmt::format("sits in the place of slot {} by its probe, and that slot waits for {}; if this is its "
                             "replacement, `berth replace` the slot",
                             place->spec.name.name, to_string(*place->record.device()))
                     .c_str());
    return true;
  }

  /// Binds each device to the one slot whose probe it shows, if no other device shows it, too. A device that has not
  /// been read yet is listed in `Plan::probes` and waits.
  void seat_by_probe(Group& group) {
    std::vector<std::size_t> places;
    std::ranges::copy_if(group.free, std::back_inserter(places),
                         [&](std::size_t i) { return slots_[i].spec.probe.has_value(); });
    if (places.empty()) return;
    const bool others = places.size() < group.free.size();
    const std::vector<Found> fresh = group.fresh;
    std::vector<Found> puzzling;
    bool waits = false;
    for (const auto& f : fresh) {
      const bool asks = std::ranges::any_of(probes_for(slots_, f.device),
                                            [&](const Probe& p) { return reading(f.device, p) == nullptr; });
      if (!asks) continue;
      waits = true;
      draft_.plan().probes.push_back(f.device);
      keep_off_others(f);
    }
    if (waits) return group.fresh.clear();  // whether only one device shows a place is known after all are read
    for (const auto& f : fresh) {
      std::vector<std::size_t> mine;
      std::ranges::copy_if(places, std::back_inserter(mine),
                           [&](std::size_t i) { return takes(i, f) && shows(f.device, *slots_[i].spec.probe); });
      const bool alone = mine.size() == 1 && std::ranges::none_of(fresh, [&](const Found& other) {
                           return other.device != f.device && fits(slots_[mine.front()].spec, other.device) &&
                                  shows(other.device, *slots_[mine.front()].spec.probe);
                         });
      if (alone) {
        take(group, mine.front(), f);
      } else if (!mine.empty() || !others) {
        std::erase_if(group.fresh, [&](const Found& each) { return each.device == f.device; });
        if (mine.empty() && misplaced(f)) continue;
        puzzling.push_back(f);
      }
    }
    if (others) std::erase_if(group.free, [&](std::size_t i) { return slots_[i].spec.probe.has_value(); });
    if (!puzzling.empty()) draft_.ask(draft_.places_free(places), puzzling, "their probes do not show their places");
  }

  /// The device is read under its present node-ID, unless that belongs to another.
  void keep_off_others(const Found& f) {
    const bool taken = f.active == master_ || std::ranges::any_of(slots_, [&](const Slot& s) {
                         return s.spec.id == f.active && s.record.device() && s.record.device() != f.device;
                       });
    if (taken) draft_.keep_off_our_ids(f);
  }

  // ---- the rest ----

  void seat_by_mode(Group& group) {
    auto& [free, fresh] = group;
    const auto mode = slots_[free.front()].spec.when_ambiguous;
    switch (mode) {
      case WhenAmbiguous::ascending:
        leave_where_they_are(group);
        if (fresh.empty() || free.empty()) return;
        if (fresh.size() != free.size()) break;
        if (const auto device_of = pairs_in_order(graph_of(group))) {
          for (std::size_t k = 0; k < free.size(); ++k) draft_.seat(free[k], fresh[(*device_of)[k]]);
          return;
        }
        break;
      case WhenAmbiguous::one_at_a_time:
        if (fresh.size() != 1) {
          return draft_.ask(free, fresh, "they come one at a time here: leave only the next one switched on");
        }
        return seat_in_turn(group);
      case WhenAmbiguous::first_seen: std::ranges::stable_sort(fresh, {}, &Found::seen); return seat_in_turn(group);
      case WhenAmbiguous::in_order: leave_where_they_are(group); return seat_in_turn(group);
      case WhenAmbiguous::ask:
      case WhenAmbiguous::probe: break;
    }
    const bool unnumbered = std::ranges::any_of(fresh, [](const Found& f) { return !f.device.has_serial(); });
    if (unnumbered && free.size() > fresh.size()) {
      return draft_.ask(free, fresh,
                        "it has no serial number, and LSS cannot distinguish it from identical devices: leave only the "
                        "next one switched on (when_ambiguous = \"one-at-a-time\" binds them in that order)");
    }
    if (mode != WhenAmbiguous::ascending || free.size() == fresh.size()) return draft_.ask(free, fresh, nullptr);
    draft_.ask(free, fresh,
               free.size() > fresh.size() ? "plug in the others too" : "unplug those that do not belong here");
  }

  /// A device that has the node-ID of a slot of its type was given it on purpose; rule 2 applies only to the others. So
  /// a machine that was commissioned before keeps its order, whatever the serial numbers: its left drive stays the left
  /// one.
  void leave_where_they_are(Group& group) {
    const Group all = group;
    for (const auto& f : all.fresh) {
      const auto own = draft_.own_place(all.free, f);
      if (own) take(group, *own, f);
    }
  }

  /// Binds each device to the lowest free slot that it fits; a device that comes too late gets none.
  void seat_in_turn(Group& group) {
    const std::vector<Found> fresh = group.fresh;
    for (const auto& f : fresh) {
      const auto slot = std::ranges::find_if(group.free, [&](std::size_t i) { return takes(i, f); });
      if (slot != group.free.end()) {
        take(group, *slot, f);
      } else {
        draft_.leave(f, OddityKind::surplus,
                     "came when every slot of its type was taken; take it off the bus, or `berth replace` one");
      }
    }
  }

  const std::vector<Slot>& slots_;
  const std::vector<Found>& found_;
  const std::vector<Identity>& blanks_;
  NodeId master_;
  const std::vector<Reading>& readings_;
  Draft draft_;
};

}  // namespace

namespace {

bool type_fits(const TypeCode& type, std::uint8_t unasked, const Identity& device) noexcept {
  const auto same = [&](unsigned part, std::uint32_t wanted) {
    return (unasked >> part & 1U) != 0 || !device.knows(part) || device.address.part(part) == wanted;
  };
  return same(0, type.vendor) && same(1, type.product);
}

bool revision_fits(RevisionRule rule, const std::optional<std::uint32_t>& wanted, std::uint32_t has) noexcept {
  if (!wanted) return true;
  switch (rule) {
    case RevisionRule::any: return true;
    case RevisionRule::major: return *wanted >> 16 == has >> 16;
    case RevisionRule::exact: return *wanted == has;
  }
  return false;
}

}  // namespace

bool drop_shorter_names(std::vector<Found>& list, const Found& found) {
  bool fuller = false;
  std::erase_if(list, [&](const Found& other) {
    const bool same = found.active.configured() && other.active == found.active && !other.clone && !found.clone &&
                      other.device.unknown != found.device.unknown && other.device.agrees(found.device);
    const bool more = (other.device.unknown & ~found.device.unknown) == 0;
    fuller = fuller || (same && more);
    return same && !more;
  });
  return fuller;
}

bool fits(const SlotSpec& slot, const Identity& device) noexcept {
  if (slot.asks.serial && device.knows(3) && *slot.asks.serial != device.address.serial) return false;
  const auto revision = [&](const std::optional<std::uint32_t>& wanted) {
    return !device.knows(2) || revision_fits(slot.rule, wanted, device.address.revision);
  };
  if (type_fits(slot.type, slot.asks.unasked, device) && revision(slot.revision)) return true;
  return std::ranges::any_of(
      slot.also, [&](const AlsoType& other) { return type_fits(other.type, 0, device) && revision(other.revision); });
}

bool listed_spare(const SlotSpec& slot, const Identity& device) noexcept {
  return device.has_serial() && std::ranges::find(slot.spares, device.address.serial) != slot.spares.end() &&
         fits(slot, device);
}

std::vector<Probe> probes_for(const std::vector<Slot>& slots, const Identity& device) {
  std::vector<Probe> probes;
  for (const auto& slot : slots) {
    const auto& probe = slot.spec.probe;
    if (!probe || !fits(slot.spec, device)) continue;
    const bool known =
        std::ranges::any_of(probes, [&](const Probe& p) { return p.index == probe->index && p.sub == probe->sub; });
    if (!known) probes.push_back(*probe);
  }
  return probes;
}

Plan plan(const std::vector<Slot>& slots, const std::vector<Found>& found,
          const std::vector<Identity>& unfinished_blanks, NodeId master, const std::vector<Reading>& readings) {
  return PlanMaker(slots, found, unfinished_blanks, master, readings).make();
}

}  // namespace berth::places
