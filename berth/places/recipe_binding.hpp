/// The steps of a binding by recipe, as a table without I/O: for a device without LSS, whose node-ID is an object. The
/// counterpart of `Binding` for LSS. `RecipeBinder` carries the steps out on a bus; the tests explore them with losses
/// and crashes.
///
///     step           does                                       ends well  next
///     check_vacant   asks whether the new node-ID is in use     it is not  identify_old
///     identify_old   1018h under the old id = the address, and  equal      write_ask
///                    no other answers there
///     write_ask      intention into the store, durable          written    write (identify when it is there already)
///     write          all objects of the recipe, in their order  accepted   reset or power_cycle
///     reset          NMT reset to the old id                    sent       await_boot_up
///     await_boot_up  700h + new id                              heard      identify
///     identify       1018h under the new id = the address       equal      write_confirm
///     write_confirm  what was intended has become so            written    done
///     revert         all objects again, with the old node-ID    any        failed
///
/// Every step may be repeated without harm, so a restart after a crash begins again at the node-ID where the device is
/// heard. After the first write, any failure before the reset goes through `revert`, and the store keeps the intention:
/// the node-ID may be in the device's memory and is given to no other device.
#pragma once

#include "berth/places/binding.hpp"
#include "berth/places/recipe.hpp"

namespace berth::places {

enum class RecipeStep : std::uint8_t {
  check_vacant,
  identify_old,
  write_ask,
  write,
  revert,
  reset,
  await_boot_up,
  identify,
  write_confirm,
  done,
  power_cycle,  ///< written, in use after the device is switched off and on
  failed,
};
[[nodiscard]] const char* name(RecipeStep step) noexcept;

class RecipeBinding {
 public:
  /// `now`: the node-ID under which the device answers. `tries`: how often it may be written. `resumed`: an earlier run
  /// had this intention and may have written it.
  RecipeBinding(Recipe::After after, const Assignment& seat, NodeId now, unsigned tries = 3,
                bool resumed = false) noexcept
      : after_(after),
        assignment_(seat),
        old_id_(now),
        tries_(tries),
        step_(now == seat.id ? RecipeStep::write_ask : RecipeStep::check_vacant),
        untouched_(!resumed) {}

  [[nodiscard]] const Assignment& assignment() const noexcept { return assignment_; }
  [[nodiscard]] NodeId old_id() const noexcept { return old_id_; }
  [[nodiscard]] RecipeStep step() const noexcept { return step_; }
  [[nodiscard]] Why why() const noexcept { return why_; }
  [[nodiscard]] unsigned tries_left() const noexcept { return tries_; }
  /// Nothing was ever written: the device is unchanged.
  [[nodiscard]] bool untouched() const noexcept { return untouched_; }
  [[nodiscard]] bool ended() const noexcept {
    return step_ == RecipeStep::done || step_ == RecipeStep::failed || step_ == RecipeStep::power_cycle;
  }
  /// The step ended; `step()` is the next one.
  void advance(Outcome outcome) noexcept;
  /// A device that waited for a power cycle was heard again: check its identity.
  void heard_again() noexcept { step_ = RecipeStep::identify; }

 private:
  void fail(Why why) noexcept;
  void give_up(Why why) noexcept;
  void advance_identify(Outcome outcome) noexcept;

  Recipe::After after_;
  Assignment assignment_;
  NodeId old_id_;
  unsigned tries_;
  RecipeStep step_;
  Why why_ = Why::none;
  bool untouched_;
};

}  // namespace berth::places
