#include "berth/places/binding.hpp"

namespace berth::places {

const char* name(Step step) noexcept {
  switch (step) {
    case Step::check_vacant: return "check vacant";
    case Step::write_ask: return "write asked";
    case Step::select: return "switch state selective";
    case Step::inquire: return "inquire node-ID";
    case Step::configure: return "configure node-ID";
    case Step::store: return "store configuration";
    case Step::revert: return "revert node-ID";
    case Step::release: return "switch state global";
    case Step::reset: return "reset communication";
    case Step::await_boot_up: return "await boot-up";
    case Step::identify: return "identify";
    case Step::write_confirm: return "write confirmed";
    case Step::done: return "done";
    case Step::power_cycle: return "power cycle needed";
    case Step::failed: return "failed";
  }
  return "unknown";
}

const char* name(Why why) noexcept {
  switch (why) {
    case Why::none: return "";
    case Why::occupied: return "another device answers at this node-ID";
    case Why::not_there: return "no device answers to this LSS address";
    case Why::not_alone: return "another device is in LSS configuration beside this one";
    case Why::clone: return "two devices answer to this LSS address";
    case Why::refused: return "the device does not take this node-ID";
    case Why::not_stored: return "the device could not store its node-ID";
    case Why::silent: return "the device took the node-ID and was not heard under it";
    case Why::other_device: return "another device answers under this node-ID";
    case Why::store_failed: return "the slot table could not be written";
    case Why::seated_twice: return "the slot table has this device in another slot";
    case Why::bus_down: return "nothing can be sent on the bus";
  }
  return "";
}

void Binding::fail(Why why) noexcept {
  why_ = why;
  step_ = Step::failed;
}

// Leaves the device unchanged, if it still listens, and in LSS waiting state.
void Binding::give_up(Why why) noexcept {
  why_ = why;
  failing_ = true;
  step_ = touched_ ? Step::revert : Step::release;
}

void Binding::again(Why why) noexcept {
  if (tries_ <= 1) return give_up(why);
  --tries_;
  staying_ = {};
  step_ = touched_ ? Step::revert : Step::select;
}

void Binding::advance_identify(Outcome outcome) noexcept {
  // LSS reported the node-ID because it is pending: the device does not use it.
  const bool told = outcome == Outcome::silent && kind_ == Kind::bind && old_id_ == assignment_.id && stored_;
  if (told && !staying_.once) {
    staying_.once = true;  // asked once more: the device may have been storing
    return;
  }
  const bool stays = outcome == Outcome::silent && kind_ == Kind::bind && staying_.once && !staying_.boots;
  if (outcome == Outcome::ok) {
    step_ = Step::write_confirm;
  } else if (outcome == Outcome::several) {
    fail(Why::clone);
  } else if (outcome == Outcome::taken_back) {
    again(Why::not_alone);
  } else if (outcome == Outcome::mismatch && kind_ == Kind::bind) {
    // This device may have missed `04 00`, and would activate the node-ID at the next one.
    touched_ = true;
    give_up(Why::other_device);
  } else if (outcome == Outcome::mismatch && stored_ && !staying_.once && old_id_.configured()) {
    staying_.once = true;
    step_ = Step::reset;
  } else if ((tries_ <= 1 || outcome == Outcome::mismatch || stays) && stored_ && !volatile_only_) {
    step_ = Step::power_cycle;
  } else {
    again(Why::silent);
  }
}

// Whether the device was heard or not, `identify` shows who is there now. A device that has stored its node-ID is not
// told it again only because it was not heard.
void Binding::advance_await(Outcome outcome) noexcept {
  const bool stays = outcome == Outcome::mismatch && stored_ && !volatile_only_;
  const bool resets = stays && old_id_.configured() && !staying_.once;
  staying_.asked = stays && !resets;
  staying_.once = staying_.once || resets;
  step_ = resets ? Step::reset : stays ? Step::select : Step::identify;
}

void Binding::advance_selection(Outcome outcome) noexcept {
  if (staying_.asked && outcome != Outcome::ok) {
    // The device boots, or another device with the same old node-ID has booted instead of it.
    staying_ = {.asked = false, .once = staying_.once, .boots = true};
    step_ = old_id_.configured() ? Step::identify : Step::await_boot_up;
  } else if (outcome == Outcome::ok && step_ == Step::inquire && staying_.asked) {
    step_ = Step::release;
  } else if (outcome == Outcome::ok) {
    step_ = step_ == Step::select ? Step::inquire : asked_ ? Step::configure : Step::write_ask;
  } else if (outcome == Outcome::several) {
    give_up(Why::clone);  // both are in configuration now and must leave it unchanged
  } else {
    again(outcome == Outcome::mismatch ? Why::not_alone : Why::not_there);
  }
}

void Binding::advance_configure(Outcome outcome) noexcept {
  if (outcome == Outcome::mismatch) return give_up(Why::occupied);  // it was told nothing by this `configure`
  untouched_ = untouched_ && outcome == Outcome::refused;
  shared_ = outcome == Outcome::several;
  // Without a pending node-ID, there is nothing to take back.
  touched_ = outcome != Outcome::refused && kind_ == Kind::bind;
  if (outcome == Outcome::ok)
    step_ = Step::store;
  else if (outcome == Outcome::refused)
    give_up(Why::refused);
  else
    again(Why::not_there);
}

void Binding::advance_store(Outcome outcome) noexcept {
  if (outcome == Outcome::mismatch) return give_up(Why::occupied);
  stored_ = outcome == Outcome::ok;
  shared_ = shared_ || outcome == Outcome::several;
  volatile_only_ = outcome == Outcome::unsupported;
  if (stored_ || volatile_only_)
    step_ = Step::release;
  else
    again(Why::not_stored);
}

void Binding::advance_release(Outcome outcome) noexcept {
  if (failing_) return fail(why_);
  if (outcome != Outcome::ok) return give_up(Why::occupied);
  touched_ = false;
  const bool uses = old_id_ == assignment_.id;
  if (!staying_.asked) {
    const Step moves = !old_id_.configured() ? Step::await_boot_up : uses ? Step::identify : Step::reset;
    const bool has_none = kind_ == Kind::blank && !old_id_.configured();
    step_ = has_none ? Step::identify : kind_ == Kind::blank ? Step::reset : moves;
    return;
  }
  // The device may have answered in another device's binding, whose `revert` then took the node-ID back from both.
  const bool tells_anew = staying_.once && !old_id_.configured() && tries_ > 1 && !told_anew_;
  if (tells_anew) {
    told_anew_ = true;
    return again(Why::silent);
  }
  step_ = uses ? Step::identify : staying_.once ? Step::power_cycle : Step::await_boot_up;
  staying_ = {.asked = false, .once = true, .boots = staying_.boots};
}

void Binding::advance(Outcome outcome) noexcept {
  const bool ok = outcome == Outcome::ok;
  const bool writes = step_ == Step::write_ask || step_ == Step::write_confirm;
  if (outcome == Outcome::error && !writes && !ended()) return fail(Why::bus_down);
  switch (step_) {
    case Step::check_vacant:
      if (ok)
        step_ = Step::select;
      else
        fail(Why::occupied);
      break;
    case Step::write_ask:
      asked_ = ok;
      if (!ok)
        give_up(outcome == Outcome::refused ? Why::seated_twice : Why::store_failed);
      else
        step_ = kind_ == Kind::bind ? Step::configure : Step::select;
      break;
    case Step::select:
    case Step::inquire: advance_selection(outcome); break;
    case Step::configure: advance_configure(outcome); break;
    case Step::store: advance_store(outcome); break;
    case Step::revert:
      touched_ = false;
      step_ = failing_ ? Step::release : Step::select;
      break;
    case Step::release: advance_release(outcome); break;
    case Step::reset:
      if (!ok)
        fail(Why::occupied);
      else
        step_ = kind_ == Kind::bind ? Step::await_boot_up : Step::identify;
      break;
    case Step::await_boot_up: advance_await(outcome); break;
    case Step::identify: advance_identify(outcome); break;
    case Step::write_confirm:
      if (ok)
        step_ = Step::done;
      else
        fail(Why::store_failed);
      break;
    case Step::done:
    case Step::power_cycle:
    case Step::failed: break;
  }
}

}  // namespace berth::places
