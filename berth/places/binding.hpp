/// The steps of a binding, as a table without I/O: what to do next, given how the last step ended. `Binder` does the
/// steps on a bus; the tests explore every interleaving of them with crashes, losses and power failures.
///
///     step           does                                     ends well  next
///     check_vacant   asks whether the node-ID is in use       it is not  select
///     select         04h 00h, 40h..43h of the address, and    44h, it    inquire
///                    the proof that no other is selected too  alone
///     inquire        5Eh: the node-ID it has now              a node-ID  write_ask
///     write_ask      intention into the store, durable        written    configure
///     configure      11h: the new one, unless another device  code 0     store
///                    came under it meanwhile; so `store`
///     store          17h: into its own memory                 code 0     release
///     release        04h 00h                                  sent       await_boot_up, reset or identify
///     reset          NMT reset communication to the old id    sent       await_boot_up
///     await_boot_up  700h + id                                heard      identify; it stays as it was: see below
///     identify       1018h under the new id = the address     equal      write_confirm
///     write_confirm  what was intended has become so          written    done
///     revert         11h: the old one, when it goes wrong;    any        select again, or release and give up
///                    none, stored, when two took the new one
///
/// Silence on the LSS side leads back to `select`, a bounded number of times: every step may be done twice without
/// harm, so a restart after a crash simply begins again at `check_vacant`. A node-ID that is pending comes into use
/// with the next 04h 00h, whichever device that is meant for; so whatever leaves the table after `configure` passes
/// `revert` first, and a start with unfinished work in the store begins with `11h FFh` to the device that was left in
/// configuration. Why in this order: the intention is durable before the device can change, so that a node-ID that may
/// be in a device's memory is never given to another, and not before the device was met, as a search may put one
/// together of two and its node-ID would be kept for it; and the device has stored before it can use the id, so that
/// what was heard once is true after a power failure (S1.29, S1.53).
///
/// An intention that an earlier binding left behind may have reached the device: it is dropped by no later failure
/// (`untouched`), however often it is tried again. A device that is away may have stored the node-ID and lost its power
/// before `04h 00h`; it comes back under it.
///
/// A device may have stored its node-ID and use it only when it was switched off and on. One that boots under its old
/// node-ID has obeyed the reset; reset node is tried then. One without a node-ID that does not boot soon is asked by
/// LSS (`select`, `inquire`, `release`): one that boots does not answer, and is waited for. When LSS tells twice that
/// the device is as it was, it waits for its power cycle; one without a node-ID is told anew once before.
///
/// Taking a node-ID away (`Kind::blank`) walks the same table without `check_vacant` and `await_boot_up`, and from
/// `write_ask` on: a device that is away loses its node-ID when it comes back. `identify` asks by LSS whether it has
/// none now.
#pragma once

#include <cstdint>

#include "berth/places/slot.hpp"

namespace berth::places {

enum class Step : std::uint8_t {
  check_vacant,
  write_ask,
  select,
  inquire,
  configure,
  store,
  revert,
  release,
  reset,
  await_boot_up,
  identify,
  write_confirm,
  done,
  power_cycle,  ///< stored, but not in use before the device is switched off and on
  failed,
};
[[nodiscard]] const char* name(Step step) noexcept;

/// How a step ended.
enum class Outcome : std::uint8_t {
  ok,
  silent,       ///< no answer in time
  refused,      ///< an answer with an error code; `write_ask`: the store has the device in another slot
  unsupported,  ///< `store`: the device has no memory for it (error code 1)
  mismatch,     ///< not the expected one: the id is taken (`check_vacant`), another device is in configuration too
                ///< (`select`), one booted under the id since then (`configure`, `store`, `release`), it seems to stay
                ///< as it was (`await_boot_up`), another device answers or it still has its id (`identify`)
  several,      ///< more than one device answered
  taken_back,   ///< `identify`: it may have been told since then to have no node-ID, with another (`lss::Master`)
  error,        ///< the store, or the port, failed
};

enum class Why : std::uint8_t {
  none,
  occupied,      ///< another device answers at the node-ID
  not_there,     ///< no device answers to the LSS address
  not_alone,     ///< another device is in LSS configuration beside it, or answers in its place, again and again
  clone,         ///< two devices answer to the LSS address
  refused,       ///< the device does not take the node-ID
  not_stored,    ///< the device could not store it
  silent,        ///< it took the node-ID and was not heard under it
  other_device,  ///< another device answers under the node-ID
  store_failed,  ///< Berth's own store could not be written
  seated_twice,  ///< the store has the device in another slot of this bus, and refused the intention
  bus_down,      ///< nothing can be sent
};
[[nodiscard]] const char* name(Why why) noexcept;

class Binding {
 public:
  enum class Kind : std::uint8_t { bind, blank };

  /// `seat.id` is the node-ID to give; for `blank` it is unconfigured. `tries`: how often `select` may be walked.
  /// `resumed`: the store holds this intention already, so an earlier binding may have told the device the node-ID.
  Binding(Kind kind, const Assignment& seat, unsigned tries = 3, bool resumed = false) noexcept
      : kind_(kind),
        assignment_(seat),
        tries_(tries),
        step_(kind == Kind::bind ? Step::check_vacant : Step::write_ask),
        untouched_(!resumed) {}

  [[nodiscard]] Kind kind() const noexcept { return kind_; }
  [[nodiscard]] const Assignment& assignment() const noexcept { return assignment_; }
  [[nodiscard]] Step step() const noexcept { return step_; }
  [[nodiscard]] Why why() const noexcept { return why_; }
  /// The node-ID that the device had when it was asked last, or is known to have (`inquired` before the first step).
  [[nodiscard]] NodeId old_id() const noexcept { return old_id_; }
  /// More than one device took the last `11h` or `17h`.
  [[nodiscard]] bool shared() const noexcept { return shared_; }
  /// What `revert` writes: the node-ID that the device had. None when a second device heard the `11h` too, which must
  /// not get the node-ID of the first; none when another device answers under the node-ID that this one told to have
  /// (Lely core's slaves tell the pending one).
  [[nodiscard]] NodeId revert_to() const noexcept {
    const bool lost = why_ == Why::other_device && old_id_ == assignment_.id;
    return shared_ || lost ? NodeId() : old_id_;
  }
  [[nodiscard]] unsigned tries_left() const noexcept { return tries_; }
  [[nodiscard]] bool stored() const noexcept { return stored_; }
  /// The device has no memory for a node-ID: it must be given one at every power-on.
  [[nodiscard]] bool volatile_only() const noexcept { return volatile_only_; }
  /// Whether the device stays as it was, having stored its node-ID.
  struct Staying {
    bool asked = false;  ///< `select` and `inquire` ask it so
    bool once = false;   ///< it seemed so once: `reset` is by NMT reset node
    bool boots = false;  ///< LSS has not answered, so it boots: it is waited for, however long it takes
    friend bool operator==(const Staying&, const Staying&) = default;
  };
  [[nodiscard]] const Staying& staying() const noexcept { return staying_; }
  /// The device was never told a node-ID, neither by this binding nor by one before it: nothing in it can have changed,
  /// and the intention may be dropped.
  [[nodiscard]] bool untouched() const noexcept { return untouched_; }
  [[nodiscard]] bool ended() const noexcept {
    return step_ == Step::done || step_ == Step::failed || step_ == Step::power_cycle;
  }

  /// With `inquire`'s good outcome: what it told. Call before `advance(ok)`.
  void inquired(NodeId now) noexcept { old_id_ = now; }
  /// The step ended; `step()` is the next one.
  void advance(Outcome outcome) noexcept;
  /// A device that waited for a power cycle was heard again: its identity is looked at.
  void heard_again() noexcept { step_ = Step::identify; }

  friend bool operator==(const Binding&, const Binding&) = default;

 private:
  void fail(Why why) noexcept;
  void give_up(Why why) noexcept;
  void again(Why why) noexcept;
  void advance_selection(Outcome outcome) noexcept;
  void advance_configure(Outcome outcome) noexcept;
  void advance_store(Outcome outcome) noexcept;
  void advance_release(Outcome outcome) noexcept;
  void advance_await(Outcome outcome) noexcept;
  void advance_identify(Outcome outcome) noexcept;

  Kind kind_;
  Assignment assignment_;
  unsigned tries_;
  Step step_;
  Why why_ = Why::none;
  bool shared_ = false;  // more than one device took the last 11h or 17h
  NodeId old_id_;
  bool stored_ = false;
  bool volatile_only_ = false;
  bool untouched_;
  bool asked_ = false;      // the intention is in the store
  bool touched_ = false;    // a node-ID may be pending in the device
  bool failing_ = false;    // revert, release, then fail
  bool told_anew_ = false;  // one without a node-ID that stayed so
  Staying staying_{};
};

}  // namespace berth::places
