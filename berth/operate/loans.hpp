/// The node-IDs that devices are lent, not stored, while they are searched for or read, until they are seated or give
/// them back. What is lent to one device is given to no other: a device that did not confirm that it gave its own back
/// may use it, or have it pending, as long as it has power (`docs/limits.md`).
///
/// A loan is in the store before the device hears of it, so that a run that begins after a crash knows every one.
#pragma once

#include <array>
#include <string>
#include <vector>

#include "berth/base/result.hpp"
#include "berth/places/slot_store.hpp"
#include "berth/rt/executor.hpp"

namespace berth::operate {

class Loans {
 public:
  struct Loan {
    Identity device;
    NodeId id;
    unsigned tries = 0;   ///< to take it back, in vain, since the device was found last
    bool clones = false;  ///< two devices answered to the address: which of them has it cannot be asked
  };

  /// `store` must stay. `bus` is the one that the devices are on.
  Loans(places::SlotStore& store, places::BusName bus);

  /// Takes over what an earlier run lent here and did not see given back.
  Result<void> load();
  /// Before the `11h` that does it. An earlier loan of the device ends.
  Result<void> lend(const Identity& device, NodeId id);
  /// The device has another node-ID or none, in use and pending. No error when nothing was lent to it.
  Result<void> end(const Identity& device);
  /// The device was asked to give its node-ID back and did not confirm it.
  void kept(const Identity& device) noexcept;
  /// Two devices answered to this address; false: both were told to have none.
  void doubled(const Identity& device, bool so) noexcept;
  /// The device was found, on this bus: it can be asked again.
  void seen(const Identity& device) noexcept;

  [[nodiscard]] const std::vector<Loan>& all() const noexcept { return all_; }
  [[nodiscard]] bool empty() const noexcept { return all_.empty(); }
  /// Null: nothing is lent to this device.
  [[nodiscard]] const Loan* of(const Identity& device) const noexcept;
  /// The node-ID is lent to another device than this one, or one of its kind without a serial number.
  [[nodiscard]] const Loan* to_another(NodeId id, const Identity& device) const noexcept;
  [[nodiscard]] bool lent(NodeId id) const noexcept;
  /// It did not confirm often enough that it gives its node-ID back: it is not asked at every round.
  [[nodiscard]] static bool given_up(const Loan& loan) noexcept { return loan.tries >= most_tries; }

  /// Had a loan in this run, or in one before it that did not end it, and was not bound since: what it uses may be what
  /// it was lent, whatever it confirmed (the reset after it can have been lost).
  [[nodiscard]] bool borrowed(const Identity& device) const noexcept;
  [[nodiscard]] const std::vector<Identity>& borrowers() const noexcept { return borrowers_; }
  /// It was bound: what it uses is stored.
  void bound(const Identity& device) noexcept;

  /// Boot-up messages under this node-ID are of Berth's making from now on, and until when they are.
  void expect_boot_up(NodeId id) noexcept { of_ours_until_[id.value()] = rt::never; }
  void expected_boot_up(NodeId id, rt::Time until) noexcept { of_ours_until_[id.value()] = until; }
  [[nodiscard]] bool of_ours(NodeId id, rt::Time at) const noexcept { return at <= of_ours_until_[id.value()]; }

 private:
  static constexpr unsigned most_tries = 3;
  places::SlotStore* store_;
  places::BusName bus_;
  std::vector<Loan> all_;
  std::vector<Identity> borrowers_;
  std::array<rt::Time, 128> of_ours_until_{};
};

}  // namespace berth::operate
