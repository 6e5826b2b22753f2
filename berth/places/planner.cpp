#include "berth/places/planner.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <map>

namespace berth::places {
namespace {

/// The slots and the new devices of one type.
struct Group {
  std::vector<std::size_t> free;
  std::vector<Found> fresh;
};

class Planner {
 public:
  Planner(const std::vector<Slot>& slots, const std::vector<Found>& found, const std::vector<LssAddress>& blanks,
          NodeId master)
      : slots_(slots), found_(found), blanks_(blanks), master_(master) {}

  Plan make() {
    finish_blanks();
    finish_and_repair();
    seat_new_devices();
    // Whoever holds a node-ID that belongs to someone else gives it up before anyone is seated.
    std::ranges::stable_partition(plan_.actions, [](const Action& a) { return a.kind == Action::Kind::blank; });
    return std::move(plan_);
  }

 private:
  [[nodiscard]] const Slot* seat_of(const LssAddress& device) const {
    const auto it = std::ranges::find_if(slots_, [&](const Slot& s) { return s.record.device() == device; });
    return it == slots_.end() ? nullptr : &*it;
  }
  [[nodiscard]] bool id_is_taken(NodeId id) const {
    return id == master_ || std::ranges::any_of(slots_, [&](const Slot& s) { return s.spec.id == id; });
  }
  void blank(const LssAddress& device, std::string reason) {
    const bool planned = std::ranges::any_of(
        plan_.actions, [&](const Action& a) { return a.kind == Action::Kind::blank && a.device == device; });
    if (!planned) plan_.actions.push_back({Action::Kind::blank, 0, device, std::move(reason)});
  }
  void bind(std::size_t slot, const LssAddress& device, std::string reason) {
    plan_.actions.push_back({Action::Kind::bind, slot, device, std::move(reason)});
  }

  void finish_blanks() {
    for (const auto& device : blanks_) {
      if (seat_of(device) == nullptr) blank(device, "finishing what an earlier run began");
    }
  }

  void finish_and_repair() {
    for (std::size_t i = 0; i < slots_.size(); ++i) {
      const auto& [spec, record] = slots_[i];
      if (record.asked) {
        make_way(record.asked->device, spec.id);
        bind(i, record.asked->device, "finishing what an earlier run began");
      } else if (record.confirmed && record.confirmed->id != spec.id) {
        make_way(record.confirmed->device, spec.id);
        bind(i, record.confirmed->device, fmt::format("the slot's node-ID is {} now", spec.id.value()));
      } else if (record.confirmed) {
        const auto heard = std::ranges::find(found_, record.confirmed->device, &Found::device);
        if (heard == found_.end() || heard->active == spec.id) continue;
        if (heard->clone) {
          report_clone(*heard);
          continue;
        }
        make_way(heard->device, spec.id);
        bind(i, heard->device,
             heard->active.configured() ? fmt::format("it came with node-ID {}", heard->active.value())
                                        : "it came without its node-ID");
      }
    }
  }

  /// A device found at `id` that is not `device` must leave it first.
  void make_way(const LssAddress& device, NodeId id) {
    for (const auto& other : found_) {
      if (other.device != device && other.active == id && !other.clone) {
        blank(other.device, fmt::format("it holds node-ID {} of another slot", id.value()));
      }
    }
  }

  void report_clone(const Found& f) {
    plan_.oddities.push_back({"clone", f.device, f.active,
                              fmt::format("more than one device answers to LSS address {}; take one away, or give it a "
                                          "serial number of its own",
                                          to_string(f.device))});
  }

  void seat_new_devices() {
    std::map<TypeCode, Group> groups;
    for (std::size_t i = 0; i < slots_.size(); ++i) {
      if (!slots_[i].record.device() && slots_[i].spec.assign == Assign::lss)
        groups[slots_[i].spec.type].free.push_back(i);
    }
    for (const auto& f : found_) {
      if (seat_of(f.device) != nullptr) continue;
      if (f.clone) {
        report_clone(f);
        keep_off_our_ids(f);
        continue;
      }
      groups[f.device.type()].fresh.push_back(f);
    }
    const auto first = plan_.actions.size();
    for (auto& [type, group] : groups) seat_group(group);
    // In the order of the slots, as paper 1's Figure 10 shows it.
    std::stable_sort(plan_.actions.begin() + static_cast<std::ptrdiff_t>(first), plan_.actions.end(),
                     [&](const Action& a, const Action& b) { return rank(a) < rank(b); });
  }

  [[nodiscard]] bool fixed_slot_waits(const TypeCode& type) const {
    return std::ranges::any_of(slots_, [&](const Slot& s) {
      return s.spec.type == type && s.spec.assign != Assign::lss && !s.record.device();
    });
  }

  [[nodiscard]] unsigned rank(const Action& a) const {
    return a.kind == Action::Kind::blank ? 0U : slots_[a.slot].spec.id.value();
  }

  /// A device without a seat may keep a node-ID only when nobody here needs it.
  void keep_off_our_ids(const Found& f) {
    if (f.active.configured() && id_is_taken(f.active) && !f.clone) {
      blank(f.device, fmt::format("it holds node-ID {}, which belongs to {}", f.active.value(),
                                  f.active == master_ ? "the master" : "a slot"));
    }
  }

  void leave(const Found& f, const char* kind, const char* what) {
    plan_.oddities.push_back({kind, f.device, f.active, fmt::format("device {} {}", to_string(f.device), what)});
    keep_off_our_ids(f);
  }

  void seat_group(Group& group) {
    auto& [free, fresh] = group;
    // Rule 2: the larger R_SN belongs in the slot of the larger number, among the devices of this run (S1.35).
    std::ranges::sort(free, {}, [&](std::size_t i) { return slots_[i].spec.id; });
    std::ranges::sort(fresh, {}, [](const Found& f) { return f.device.r_sn(); });

    std::erase_if(fresh, [&](const Found& f) {
      const bool wanted = std::ranges::any_of(free, [&](std::size_t i) { return fits(slots_[i].spec, f.device); });
      if (wanted) return false;
      const bool known_type =
          std::ranges::any_of(slots_, [&](const Slot& s) { return s.spec.type == f.device.type(); });
      if (!known_type) {
        leave(f, "foreign", "is of a type that this machine has no slot for; take it off the bus, or add a slot");
      } else if (fixed_slot_waits(f.device.type())) {
        plan_.oddities.push_back(
            {"fixed mismatch", f.device, f.active,
             fmt::format("device {} is of a type whose slot expects a fixed node-ID, and does not have "
                         "it; set its switches, or put it into the right place",
                         to_string(f.device))});
      } else if (free.empty()) {
        leave(f, "surplus", "finds every slot of its type taken; take it off the bus, or `berth replace` a slot");
      } else {
        leave(f, "wrong revision", "has a revision that no free slot accepts; see the slots' `revision`");
      }
      return true;
    });
    if (fresh.empty()) return;
    const auto mode = slots_[free.front()].spec.when_ambiguous;
    const bool one_by_one =
        mode == WhenAmbiguous::first_seen || (mode == WhenAmbiguous::one_at_a_time && fresh.size() == 1);
    const bool in_order = fresh.size() == free.size() && all_fit(free, fresh);
    if (in_order || (one_by_one && fresh.size() <= free.size() && all_fit(free, fresh))) {
      for (std::size_t k = 0; k < fresh.size(); ++k) seat(free[k], fresh[k]);
    } else {
      ask(free, fresh);
    }
  }

  [[nodiscard]] bool all_fit(const std::vector<std::size_t>& free, const std::vector<Found>& fresh) const {
    for (std::size_t k = 0; k < fresh.size(); ++k) {
      if (!fits(slots_[free[k]].spec, fresh[k].device)) return false;
    }
    return true;
  }

  void seat(std::size_t slot, const Found& f) {
    const NodeId id = slots_[slot].spec.id;
    make_way(f.device, id);
    if (f.active != id) keep_off_our_ids(f);
    bind(slot, f.device, "discovered");
  }

  void ask(const std::vector<std::size_t>& free, const std::vector<Found>& fresh) {
    Question q;
    q.slots = free;
    for (const auto& f : fresh) q.devices.push_back(f.device);
    q.text = fmt::format(
        "{} new device{} of type {} and {} free slot{}: which belongs where? Plug in as many as there are "
        "slots, or name them with `berth replace SLOT --device ADDRESS`",
        fresh.size(), fresh.size() == 1 ? "" : "s", to_string(fresh.front().device.type()), free.size(),
        free.size() == 1 ? "" : "s");
    for (const auto& f : fresh) keep_off_our_ids(f);
    plan_.questions.push_back(std::move(q));
  }

  const std::vector<Slot>& slots_;
  const std::vector<Found>& found_;
  const std::vector<LssAddress>& blanks_;
  NodeId master_;
  Plan plan_;
};

}  // namespace

namespace {

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

bool fits(const SlotSpec& slot, const LssAddress& device) noexcept {
  if (slot.type == device.type()) return revision_fits(slot.rule, slot.revision, device.revision);
  return std::ranges::any_of(slot.also, [&](const AlsoType& other) {
    return other.type == device.type() && revision_fits(slot.rule, other.revision, device.revision);
  });
}

bool listed_spare(const SlotSpec& slot, const LssAddress& device) noexcept {
  return std::ranges::find(slot.spares, device.serial) != slot.spares.end() && fits(slot, device);
}

Plan plan(const std::vector<Slot>& slots, const std::vector<Found>& found,
          const std::vector<LssAddress>& unfinished_blanks, NodeId master) {
  return Planner(slots, found, unfinished_blanks, master).make();
}

}  // namespace berth::places
