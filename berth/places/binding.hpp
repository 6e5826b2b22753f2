/// The steps of a binding, as a table without I/O: what to do next, given how the last step ended. `Binder` carries
/// them out on a bus; the tests explore every interleaving of them with crashes, losses and power failures.
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
/// Silence on the LSS side leads back to `select`, a bounded number of times. Every step may be repeated without harm,
/// so a restart after a crash begins again at `check_vacant`. The next 04h 00h activates a pending node-ID, whichever
/// device it is meant for. So every exit from the table after `configure` passes `revert` first, and a start with
/// unfinished work in the store begins with `11h FFh` to the device left in configuration.
///
/// The order has these reasons (S1.29, S1.53):
/// - The intention is durable before the device can change, so a node-ID that may be in a device's memory is never
///   given to another.
/// - It is written only after the device was met: a search may make up an address from those of two devices, and would
///   keep a node-ID for it.
/// - The device has stored the node-ID before it can use it, so what was heard once is true after a power failure.
///
/// An intention left by an earlier binding may have reached the device: no later failure drops it (`untouched`),
/// however often it is tried again. An absent device may have stored the node-ID and lost its power before `04h 00h`;
/// it then returns with it.
///
/// Some devices use a stored node-ID only after they were switched off and on. If the device boots under its old
/// node-ID, it has obeyed the reset, and reset node is tried. A device without a node-ID that does not boot soon is
/// asked by LSS (`select`, `inquire`, `release`); one that is booting does not answer, and is waited for. If LSS shows
/// twice that the device is unchanged, the binding waits for its power cycle; a device without a node-ID is told its
/// node-ID once more before that.
///
/// Taking a node-ID away (`Kind::blank`) uses the same table without `check_vacant` and `await_boot_up`, from
/// `write_ask` on: an absent device loses its node-ID when it returns. `identify` asks by LSS whether it now has none.
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
  refused,      ///< an answer with an error code; `write_ask`: the store has the device in another slot of the bus
  unsupported,  ///< `store`: the device has no memory for it (error code 1)
  mismatch,     ///< not the expected one: the id is taken (`check_vacant`), another device is in configuration too
                ///< (`select`), one booted under the id meanwhile (`configure`, `store`, `release`), it seems unchanged
                ///< (`await_boot_up`), another device answers or it still has its id (`identify`)
  several,      ///< more than one device answered
  taken_back,   ///< `identify`: since then it may have been told, with another device, to have no node-ID
                ///< (`lss::Master`)
  error,        ///< the store, or the port, failed
};

enum class Why : std::uint8_t {
  none,
  occupied,      ///< another device answers at the node-ID
  not_there,     ///< no device answers to the LSS address
  not_alone,     ///< another device is in LSS configuration too, or answers in its place, repeatedly
  clone,         ///< two devices answer to the LSS address
  refused,       ///< the device does not take the node-ID
  not_stored,    ///< the device could not store it
  silent,        ///< it took the node-ID, but was not heard under it
  other_device,  ///< another device answers under the node-ID
  store_failed,  ///< Berth's own store could not be written
  seated_twice,  ///< the store has the device in another slot of this bus, and refused the intention
  bus_down,      ///< nothing can be sent
};
[[nodiscard]] const char* name(Why why) noexcept;

class Binding {
 public:
  enum class Kind : std::uint8_t { bind, blank };

  /// `seat.id` is the node-ID to give; unconfigured for `blank`. `tries`: how often `select` may run. `resumed`: the
  /// store already has this intention, so an earlier binding may have told the device the node-ID.
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
  /// The device's node-ID at the last inquiry, or its known one (`inquired` before the first step).
  [[nodiscard]] NodeId old_id() const noexcept { return old_id_; }
  /// More than one device took the last `11h` or `17h`.
  [[nodiscard]] bool shared() const noexcept { return shared_; }
  /// The node-ID that `revert` writes: the device's old one. None when a second device heard the `11h` too, because
  /// that must not get the first one's node-ID; none when another device answers under the node-ID that this one
  /// reported (Lely core's slaves report the pending one).
  [[nodiscard]] NodeId revert_to() const noexcept {
    const bool lost = why_ == Why::other_device && old_id_ == assignment_.id;
    return shared_ || lost ? NodeId() : old_id_;
  }
  [[nodiscard]] unsigned tries_left() const noexcept { return tries_; }
  [[nodiscard]] bool stored() const noexcept { return stored_; }
  /// The device has no memory for a node-ID: it must get one at every power-on.
  [[nodiscard]] bool volatile_only() const noexcept { return volatile_only_; }
  /// For a device that has stored its node-ID: whether it stays unchanged.
  struct Staying {
    bool asked = false;  ///< `select` and `inquire` ask for this
    bool once = false;   ///< it seemed so once: now `reset` is NMT reset node
    bool boots = false;  ///< LSS has not answered, so it boots: wait for it, however long
    friend bool operator==(const Staying&, const Staying&) = default;
  };
  [[nodiscard]] const Staying& staying() const noexcept { return staying_; }
  /// The device was never told a node-ID, by this or an earlier binding: it is unchanged, and the intention may be
  /// dropped.
  [[nodiscard]] bool untouched() const noexcept { return untouched_; }
  [[nodiscard]] bool ended() const noexcept {
    return step_ == Step::done || step_ == Step::failed || step_ == Step::power_cycle;
  }

  /// After a successful `inquire`: its answer. Call before `advance(ok)`.
  void inquired(NodeId now) noexcept { old_id_ = now; }
  /// The step ended; `step()` is the next one.
  void advance(Outcome outcome) noexcept;
  /// A device that waited for a power cycle was heard again: check its identity.
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
  bool told_anew_ = false;  // a device without a node-ID stayed without
  Staying staying_{};
};

}  // namespace berth::places
