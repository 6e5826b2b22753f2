#include "berth/operate/recipe_seating.hpp"

#include <fmt/format.h>

#include <algorithm>

#include "berth/base/shell_word.hpp"
#include "berth/places/recipe_binder.hpp"

namespace berth::operate {

using places::Assign;
using places::RecipeStep;
using places::WhenAmbiguous;

// The slot of a device whose node-ID is set by recipe: its own, else the free one. Null: none, or a user must decide.
Seat* RecipeSeating::seat_for(const places::Found& found) {
  std::vector<Seat*> free;
  for (auto& seat : slots_.seats()) {
    const bool by_recipe = seat->slot.spec.assign == Assign::recipe && seat->slot.spec.recipe != nullptr;
    if (!by_recipe || seat->there()) continue;
    if (seat->slot.record.device() == found.device) return seat.get();
    if (!seat->slot.record.device() && places::fits(seat->slot.spec, found.device)) free.push_back(seat.get());
  }
  if (free.empty() || slots_.of(found.device) != nullptr) return nullptr;
  std::ranges::sort(free, {}, [](const Seat* s) { return s->id(); });
  const auto listed =
      std::ranges::find_if(free, [&](const Seat* s) { return places::listed_spare(s->slot.spec, found.device); });
  if (listed != free.end()) return *listed;
  if (free.size() == 1 || free.front()->slot.spec.when_ambiguous != WhenAmbiguous::ask) return free.front();
  const std::string text = fmt::format(
      "device {} has node-ID {} and {} slots of its type are free: which is its place? `berth replace SLOT --device "
      "{}`",
      to_string(found.device), found.active.value(), free.size(), to_string(found.device));
  slots_.events().tell_once(EventKind::question, text);
  for (Seat* const seat : free) slots_.happened(*seat, SlotEvent::asks_person, text);
  return nullptr;
}

rt::Task<void> RecipeSeating::bind_all() {
  const std::vector<places::Found> found = found_.all();
  for (const auto& f : found) {
    if (f.clone || !f.active.configured()) continue;
    Seat* const seat = seat_for(f);
    if (seat == nullptr) continue;
    const Identity device = f.device;
    const NodeId now = f.active;
    co_await bind(*seat, device, now);
  }
}

rt::Task<void> RecipeSeating::bind(Seat& seat, Identity device, NodeId now) {
  const places::Recipe& recipe = *seat.slot.spec.recipe;
  const bool leaves_factory = std::ranges::find(recipe.from, now) != recipe.from.end();
  const bool own = seat.slot.record.device() == device || now == seat.id();
  if (!leaves_factory && !own) {
    slots_.events().tell_once(EventKind::recipe,
                              fmt::format("device {} has node-ID {}, with which such devices do not leave the factory; "
                                          "`berth replace {} --device {}` takes it anyway",
                                          to_string(device), now.value(), shell_word(seat.name()), to_string(device)));
    co_return;
  }
  const bool resumed = seat.slot.record.intended.has_value();
  places::RecipeBinding binding(recipe.after, {device.with(seat.id()), seat.id()}, now, s_.bus.timing.tries, resumed);
  const std::string reason = fmt::format("by the recipe of {}, from node-ID {}", recipe.name, now.value());
  slots_.happened(seat, SlotEvent::binds, reason);
  places::Binder::Options options = asking_.binder_options();
  options.uses = now;
  places::RecipeBinder binder(asking_.binder_services(), options, recipe);
  const places::SlotId slot = seat.slot.record.slot;
  co_await binder.run(binding, slot, reason);
  slots_.refresh(seat);
  found_.forget(device);
  seat.checked = s_.executor.now();
  if (binding.step() == RecipeStep::done) {
    seat.fresh = true;
    if (now != seat.id()) places::gave_up(s_.boots, s_.vacancy, now);
    slots_.events().tell(EventKind::bound, seat.name(),
                         fmt::format("bound to {} as node-ID {} {}", to_string(device), seat.id().value(), reason));
    slots_.happened(seat, SlotEvent::bound);
  } else if (binding.step() == RecipeStep::power_cycle) {
    slots_.happened(seat, SlotEvent::waits_for_power, "node-ID written; switch the device off and on");
  } else {
    not_bound(seat, binding, binder.store_said());
  }
}

void RecipeSeating::not_bound(Seat& seat, const places::RecipeBinding& binding,
                              const std::optional<Error>& store_said) {
  // Nothing in the device can have changed: the slot is free again. Otherwise the slot keeps it until it is seen.
  const bool fresh = !seat.slot.record.confirmed && binding.untouched() && seat.slot.record.intended;
  if (fresh) {
    const auto cleared = slots_.store().clear(seat.slot.record.slot, places::name(binding.why()));
    if (!cleared)
      slots_.events().tell(EventKind::error, seat.name(),
                           "the slot table cannot be written: " + describe(cleared.error()));
    slots_.refresh(seat);
  }
  const bool clone = binding.why() == places::Why::clone;
  const std::string reason =
      clone ? fmt::format(
                  "two devices answer under node-ID {}: they are taken in one at a time; leave one of them on the "
                  "bus",
                  binding.old_id().value())
            : fmt::format("{}: {} (recipe)", to_string(binding.assignment().device),
                          places::words_of(binding.why(), store_said));
  slots_.happened(seat, clone ? SlotEvent::two_answer : SlotEvent::binding_failed, reason);
}

}  // namespace berth::operate
