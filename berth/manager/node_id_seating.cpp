#include "berth/manager/node_id_seating.hpp"

#include <algorithm>

#include "berth/places/inquiry.hpp"

namespace berth::manager {

using places::Action;
using places::Binding;

namespace {

// The identities as which the device was found: one without a serial number has another node-ID now.
std::vector<Identity> names_of(const Binding& binding) {
  const Identity& device = binding.assignment().device;
  if (device.has_serial()) return {device};
  return {device, device.with(NodeId()), device.with(binding.old_id())};
}

// A device without a serial number counts, wherever it was found, as the one of its kind that a slot waits for.
bool is_waited_for(const std::vector<ListSlot>& slots, const Identity& device) {
  return !device.has_serial() && std::ranges::any_of(slots, [&](const ListSlot& slot) {
    const auto& intended = slot.slot.record.intended;
    return intended && intended->device.address == device.address;
  });
}

}  // namespace

void NodeIdSeating::begin() {
  seen_at_ = {};
  resting_.clear();
  without_place_.clear();
}

rt::Task<void> NodeIdSeating::carry_out() {
  constexpr int most_passes = 4;
  tried_.clear();
  bool changed = true;
  for (int pass = 0; pass < most_passes && changed; ++pass) {
    co_await free_lost();
    const auto planned = bus_.plan();
    take_stock(planned);
    changed = co_await act_on(planned);
  }
}

// The replaced device got its node-ID elsewhere: it need not give it back.
void NodeIdSeating::take_where_it_is(ListSlot& slot, bool doubled) {
  const auto sits = slot.slot.record.device();
  const bool takes =
      slot.typed && slot.device && !doubled && slot.device != sits && places::fits(slot.slot.spec, *slot.device);
  if (!takes) return;
  const Identity device = *slot.device;
  if (sits) {
    const auto freed = bus_.store().clear(slot.slot.record.slot, "another device has its node-ID");
    if (!freed) return;
    bus_.refresh(slot);
  }
  static_cast<void>(adopt(slot, device));
}

// ---- slots of lost devices ------------------------------------------------------------------------------------------

// Its node-ID is stored in the device, which returns under it: the store remembers this.
rt::Task<void> NodeIdSeating::free_lost() {
  places::Inquiry inquiry(bus_.binder_services());
  std::vector<NodeId> reserved;
  const std::vector<Identity> devices = new_devices();
  for (const Identity& each : devices) {
    const Identity device = each;
    const auto open = std::ranges::find_if(bus_.slots, [&](const ListSlot& slot) {
      const bool reserves = std::ranges::find(reserved, slot.id()) != reserved.end();
      return slot.free() && !slot.there && !reserves && places::fits(slot.slot.spec, device);
    });
    if (open != bus_.slots.end()) {
      reserved.push_back(open->id());
      continue;
    }
    ListSlot* const slot = lost_slot_for(device);
    if (slot == nullptr) continue;
    const Identity away = slot->slot.record.confirmed->device;
    if (bus_.found.can_be_selected(away)) {
      const auto id = co_await inquiry.active_id(away.address, false, ListBus::pause);
      const bool clone = !id && id.error().code == Errc::duplicate;
      if (id || clone) bus_.found.note({away, id ? *id : NodeId(), clone});
      const bool silent = !id && id.error().code == Errc::timeout;
      if (!silent) continue;
    }
    const auto freed = bus_.store().give_away(slot->slot.record.slot, "it is silent, and a new device is there");
    bus_.refresh(*slot);
    if (freed) reserved.push_back(slot->id());
  }
}

// Found, neither seated nor about to lose an earlier node-ID; the lowest serial number first.
std::vector<Identity> NodeIdSeating::new_devices() const {
  std::vector<Identity> devices;
  for (const auto& f : bus_.found) {
    const bool comes =
        !f.clone && !bus_.refuses(f.device) && bus_.of(f.device) == nullptr && !is_waited_for(bus_.slots, f.device);
    if (comes) devices.push_back(f.device);
  }
  std::ranges::sort(devices);
  return devices;
}

// The slot of the node-ID under which the new device was found comes first.
ListSlot* NodeIdSeating::lost_slot_for(const Identity& device) {
  const auto* const f = bus_.found.find(device);
  ListSlot* lowest = nullptr;
  for (auto& slot : bus_.slots) {
    if (!is_lost(slot) || !places::fits(slot.slot.spec, device)) continue;
    if (f != nullptr && f->active == slot.id()) return &slot;
    if (lowest == nullptr) lowest = &slot;
  }
  return lowest;
}

bool NodeIdSeating::is_lost(const ListSlot& slot) const {
  const auto& record = slot.slot.record;
  const bool its_own = slot.there && (!slot.device || *slot.device == record.device());
  const bool elsewhere = record.confirmed && bus_.found.find(record.confirmed->device) != nullptr;
  if (!slot.typed || slot.fixed() || !record.confirmed || record.intended || its_own || elsewhere) return false;
  const rt::Time now = bus_.executor().now();
  const rt::Time seen = seen_at_[slot.id().value()];
  if (slot.there) return true;  // another device answers in its place
  return seen != rt::Time{} ? now - seen >= lost_after : now - bus_.began() >= never_seen_after;
}

// ---- acting on the plan ---------------------------------------------------------------------------------------------

// False: nothing was changed, and the next plan would be the same.
rt::Task<bool> NodeIdSeating::act_on(const ListBus::Planned& planned) {
  bool changed = false;
  for (const auto& action : planned.plan.actions) {
    const bool blanks = action.kind == Action::Kind::blank && !was_tried(action.device);
    if (!blanks) continue;
    const Identity device = action.device;
    const std::string reason = action.reason;
    const bool good = co_await blank(device, reason);
    changed = changed || good;
  }
  if (changed) co_return true;  // freed node-IDs are available to the next plan
  co_await ask_vacancy(planned);
  constexpr std::size_t most_bindings = 16;
  rt::Scope bindings(bus_.executor(), most_bindings);
  for (const auto& action : planned.plan.actions) {
    if (action.kind != Action::Kind::bind || was_tried(action.device)) continue;
    ListSlot& slot = bus_.slots[planned.slots[action.slot]];
    const auto* const f = bus_.found.one_for(action.device);
    if (f == nullptr) continue;  // it is away, and its node-ID is kept for it
    if (rests(action.device)) {
      slot.trouble = NodeIdTrouble::power_cycle;
      continue;
    }
    const bool home = f->active == slot.id() && !f->shared && !slot.slot.record.intended;
    if (home && adopt(slot, action.device)) continue;
    bindings.spawn(bind(slot, action.device, changed));
  }
  co_await bindings.join();
  co_return changed;
}

// Asks node-IDs to be assigned that were not asked in this run, side by side.
rt::Task<void> NodeIdSeating::ask_vacancy(const ListBus::Planned& planned) {
  std::vector<NodeId> ids;
  for (const auto& action : planned.plan.actions) {
    if (action.kind != Action::Kind::bind) continue;
    const NodeId id = bus_.slots[planned.slots[action.slot]].id();
    if (!bus_.vacant(id)) ids.push_back(id);
  }
  if (ids.empty()) co_return;
  // A single receive buffer would lose its question after the `04 00` of the last LSS service.
  co_await rt::sleep_for(ListBus::pause);
  rt::Scope asked(bus_.executor());
  for (const NodeId id : ids) asked.spawn(ask_one(id));
  co_await asked.join();
}

rt::Task<void> NodeIdSeating::ask_one(NodeId id) {
  places::Inquiry inquiry(bus_.binder_services());
  const co::SdoOptions how = bus_.patience();
  const auto answers = co_await inquiry.answers_at(id, how, ListBus::timeout);
  static_cast<void>(answers);
}

// The device is in its place: it needs no command.
bool NodeIdSeating::adopt(ListSlot& slot, const Identity& device) {
  const places::Assignment seat{device, slot.id()};
  const auto number = slot.slot.record.slot;
  const auto asked = bus_.store().ask(number, seat, "it came with the slot's node-ID");
  const auto confirmed = asked ? bus_.store().confirm(number, seat, "it came with the slot's node-ID") : asked;
  bus_.refresh(slot);
  if (!confirmed) return false;
  slot.there = true;
  slot.device = device;
  bus_.found.forget(device);
  return true;
}

rt::Task<void> NodeIdSeating::bind(ListSlot& slot, Identity device, bool& changed) {
  const bool resumed = slot.slot.record.intended.has_value();
  const bool fresh = !slot.slot.record.device();
  const places::Binder::Options defaults = bus_.binder_options();
  Binding binding(Binding::Kind::bind, {device.with(slot.id()), slot.id()}, defaults.tries, resumed);
  places::Binder::Options options = defaults;
  options.parts = bus_.parts_to_ask(device);
  const auto* const found = bus_.found.one_for(device);
  if (found != nullptr) {
    options.uses = found->active;
    options.among_equals = bus_.found.has_equals(found->device, slot.id());
  }
  places::Binder binder(bus_.binder_services(), options);
  const places::SlotId number = slot.slot.record.slot;
  const std::string reason = "the network list has a place for it";
  co_await binder.run(binding, number, reason);
  ended(slot, binding, fresh);
  changed = changed || binding.step() == places::Step::done;
}

void NodeIdSeating::ended(ListSlot& slot, const Binding& binding, bool fresh) {
  using places::Why;
  const Identity device = binding.assignment().device;
  bus_.refresh(slot);
  if (binding.step() == places::Step::done) {
    slot.there = true;
    slot.device = device;
    slot.trouble = NodeIdTrouble::none;
    seen(slot.id());
    for (const Identity& name : names_of(binding)) bus_.found.forget(name);
    std::erase_if(resting_, [&](const Resting& r) { return r.device == device; });
    return;
  }
  std::ranges::copy(names_of(binding), std::back_inserter(tried_));
  if (!binding.untouched()) bus_.nobody_listens = false;
  slot.trouble = NodeIdTrouble::failed;
  if (binding.step() == places::Step::power_cycle) {
    std::erase_if(resting_, [&](const Resting& r) { return r.device == device; });
    resting_.push_back({device, binding.old_id(), bus_.executor().now()});
    slot.trouble = NodeIdTrouble::power_cycle;
    return;
  }
  // It reported the node-ID that it uses, and takes no other.
  const bool refuses = binding.why() == Why::refused && binding.old_id() != slot.id();
  if (refuses) {
    std::ranges::copy(names_of(binding), std::back_inserter(bus_.refusing));
    slot.trouble = NodeIdTrouble::refuses;
  }
  const Identity was = device.with(binding.old_id());
  if (binding.why() == Why::clone) bus_.found.note({was, binding.old_id(), true});
  if (binding.why() == Why::clone || binding.why() == Why::other_device) slot.trouble = NodeIdTrouble::doubled;
  const bool blank_equals = binding.why() == Why::clone && !device.has_serial() && !binding.old_id().configured();
  if (blank_equals) slot.trouble = NodeIdTrouble::equals;
  if (binding.why() == Why::not_there) {
    bus_.found.forget(was);
    // The device left before it could be told: the node-ID is kept for it, as for a device that was not found.
    if (slot.slot.record.intended && !(fresh && binding.untouched())) slot.trouble = NodeIdTrouble::kept;
  }
  auto* const f = bus_.found.one_for(device);
  if (binding.why() == Why::occupied && f != nullptr && f->active == slot.id()) f->shared = true;
  // Nothing in the device can have changed: the slot is free again. Otherwise the slot keeps it until it is seen.
  const bool untold = (fresh && binding.untouched()) || refuses;
  if (!untold || !slot.slot.record.intended) return;
  const auto cleared = bus_.store().clear(slot.slot.record.slot, places::name(binding.why()));
  static_cast<void>(cleared);
  bus_.refresh(slot);
}

rt::Task<bool> NodeIdSeating::blank(Identity device, std::string reason) {
  const auto known = bus_.formers();
  const bool resumed = std::ranges::find(known, device, &places::UnfinishedBlank::device) != known.end();
  if (rests(device)) co_return false;
  const places::Binder::Options defaults = bus_.binder_options();
  Binding binding(Binding::Kind::blank, {device, NodeId()}, defaults.tries, resumed);
  const auto* const had = bus_.found.find(device);
  if (had != nullptr) binding.inquired(had->active);
  places::Binder::Options options = defaults;
  options.parts = bus_.parts_to_ask(device);
  places::Binder binder(bus_.binder_services(), options);
  const places::SlotId none;
  co_await binder.run(binding, none, reason);
  const bool good = binding.step() == places::Step::done;
  auto* const now = bus_.found.find(device);
  if (good) {
    places::gave_up(bus_.boots(), bus_.vacancy(), binding.old_id());
    if (now != nullptr && device.has_serial()) now->active = NodeId();
    if (now != nullptr && !device.has_serial()) {
      bus_.found.forget(device);
      bus_.found.note({device, NodeId()});
    }
    ListSlot* const left = bus_.at(binding.old_id());
    const bool empty = left != nullptr && left->device == device;
    if (empty) left->leave();
    if (left != nullptr) bus_.given_up.set(left->id().value());
    co_return true;
  }
  tried_.push_back(device);
  if (!binding.untouched()) bus_.nobody_listens = false;
  if (binding.step() == places::Step::power_cycle)
    resting_.push_back({device, binding.old_id(), bus_.executor().now()});
  if (binding.why() == places::Why::refused) bus_.refusing.push_back(device);
  if (binding.untouched()) {
    const auto dropped = bus_.store().drop_blank({device, {}}, places::name(binding.why()));
    static_cast<void>(dropped);
  }
  co_return false;
}

// It stored its node-ID and still uses another: telling it again would wear out its memory.
bool NodeIdSeating::rests(const Identity& device) {
  const auto it = std::ranges::find(resting_, device, &Resting::device);
  if (it == resting_.end()) return false;
  const auto* const f = bus_.found.one_for(device);
  const auto booted = it->old.configured() ? bus_.boots().boot_up(it->old) : std::nullopt;
  const bool over = (f != nullptr && f->active != it->old) || (booted && *booted > it->since);
  if (over) resting_.erase(it);
  return !over;
}

bool NodeIdSeating::was_tried(const Identity& device) const {
  return std::ranges::find(tried_, device) != tried_.end();
}

void NodeIdSeating::take_stock(const ListBus::Planned& planned) {
  without_place_.clear();
  for (const auto& f : bus_.found) {
    const bool seated = std::ranges::any_of(planned.plan.actions, [&](const Action& action) {
      return action.kind == Action::Kind::bind && bus_.found.one_for(action.device) == &f;
    });
    // The next run identifies it, and takes it with its present node-ID.
    const ListSlot* const own = f.active.configured() ? bus_.at(f.active) : nullptr;
    const bool home = own != nullptr && own->fixed() && places::fits(own->slot.spec, f.device);
    // Several answered to one address, and several with that address have their node-IDs.
    const bool known = f.clone && !f.device.has_serial() && bus_.found.has_equals(f.device);
    if (!seated && !home && !known && bus_.of(f.device) == nullptr) without_place_.push_back(f);
  }
}

}  // namespace berth::manager
