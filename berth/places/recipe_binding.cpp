#include "berth/places/recipe_binding.hpp"

namespace berth::places {

const char* name(RecipeStep step) noexcept {
  switch (step) {
    case RecipeStep::check_vacant: return "check vacant";
    case RecipeStep::identify_old: return "identify under the old node-ID";
    case RecipeStep::write_ask: return "write asked";
    case RecipeStep::write: return "write objects";
    case RecipeStep::revert: return "revert objects";
    case RecipeStep::reset: return "reset";
    case RecipeStep::await_boot_up: return "await boot-up";
    case RecipeStep::identify: return "identify";
    case RecipeStep::write_confirm: return "write confirmed";
    case RecipeStep::done: return "done";
    case RecipeStep::power_cycle: return "power cycle needed";
    case RecipeStep::failed: return "failed";
  }
  return "unknown";
}

void RecipeBinding::fail(Why why) noexcept {
  why_ = why;
  step_ = RecipeStep::failed;
}

void RecipeBinding::give_up(Why why) noexcept {
  why_ = why;
  step_ = untouched_ ? RecipeStep::failed : RecipeStep::revert;
}

// A device that is silent under the new node-ID may not have accepted it, and then still uses its old one.
void RecipeBinding::advance_identify(Outcome outcome) noexcept {
  if (outcome == Outcome::ok) {
    step_ = RecipeStep::write_confirm;
  } else if (outcome == Outcome::several) {
    fail(Why::clone);
  } else if (outcome == Outcome::mismatch) {
    fail(Why::other_device);
  } else if (old_id_ == assignment_.id || tries_ <= 1) {
    fail(Why::silent);
  } else {
    --tries_;
    step_ = RecipeStep::identify_old;
  }
}

void RecipeBinding::advance(Outcome outcome) noexcept {
  const bool ok = outcome == Outcome::ok;
  const bool writes = step_ == RecipeStep::write_ask || step_ == RecipeStep::write_confirm;
  if (outcome == Outcome::error && !writes && !ended()) return fail(Why::bus_down);
  switch (step_) {
    case RecipeStep::check_vacant:
      if (ok)
        step_ = RecipeStep::identify_old;
      else
        fail(Why::occupied);
      break;
    case RecipeStep::identify_old:
      if (ok)
        step_ = RecipeStep::write_ask;
      else if (outcome == Outcome::several)
        fail(Why::clone);
      else
        fail(outcome == Outcome::mismatch ? Why::other_device : (untouched_ ? Why::not_there : Why::silent));
      break;
    case RecipeStep::write_ask:
      if (!ok)
        fail(outcome == Outcome::refused ? Why::seated_twice : Why::store_failed);
      else
        step_ = old_id_ == assignment_.id ? RecipeStep::identify : RecipeStep::write;
      break;
    case RecipeStep::write:
      untouched_ = untouched_ && outcome == Outcome::unsupported;
      if (ok) {
        step_ = after_ == Recipe::After::power_cycle ? RecipeStep::power_cycle : RecipeStep::reset;
      } else if (outcome == Outcome::silent && tries_ > 1) {
        --tries_;
        step_ = RecipeStep::identify_old;
      } else {
        give_up(outcome == Outcome::silent ? Why::not_there : Why::refused);
      }
      break;
    case RecipeStep::revert: fail(why_); break;
    case RecipeStep::reset:
      if (ok)
        step_ = RecipeStep::await_boot_up;
      else
        give_up(outcome == Outcome::several ? Why::clone : Why::occupied);
      break;
    case RecipeStep::await_boot_up: step_ = RecipeStep::identify; break;  // heard or not: `identify` shows
    case RecipeStep::identify: advance_identify(outcome); break;
    case RecipeStep::write_confirm:
      if (ok)
        step_ = RecipeStep::done;
      else
        fail(Why::store_failed);
      break;
    case RecipeStep::done:
    case RecipeStep::power_cycle:
    case RecipeStep::failed: break;
  }
}

}  // namespace berth::places
