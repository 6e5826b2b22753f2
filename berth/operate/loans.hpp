/// Node-IDs lent to devices, not stored in them, while they are searched for or read, until they are seated or give
/// them back. A lent node-ID is given to no other device: a device that did not confirm giving its node-ID back may use
/// it, or have it pending, as long as it has power (`docs/limits.md`).
///
/// A loan is in the store before the device is told, so that a run after a crash knows every loan.
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
    unsigned tries = 0;   ///< vain tries to take it back since the device was last found
    bool clones = false;  ///< two devices answered to the address: which of them has it cannot be determined
  };

  /// `store` must outlive this. `bus` is the bus of the devices.
  Loans(places::SlotStore& store, places::BusName bus);

  /// Loads the loans that an earlier run made here and did not end.
  Result<void> load();
  /// Call it before the `11h` of the loan. An earlier loan of the device ends.
  Result<void> lend(const Identity& device, NodeId id);
  /// The device has another node-ID or none, active and pending. No error when nothing was lent to it.
  Result<void> end(const Identity& device);
  /// The device was asked to give its node-ID back and did not confirm it.
  void kept(const Identity& device) noexcept;
  /// Two devices answered to this address; false: both confirmed that they have none.
  void doubled(const Identity& device, bool so) noexcept;
  /// The device was found, on this bus: it can be asked again.
  void seen(const Identity& device) noexcept;

  [[nodiscard]] const std::vector<Loan>& all() const noexcept { return all_; }
  [[nodiscard]] bool empty() const noexcept { return all_.empty(); }
  /// Null: nothing is lent to this device.
  [[nodiscard]] const Loan* of(const Identity& device) const noexcept;
  /// The loan of this node-ID to another device, or to one of its kind without a serial number.
  [[nodiscard]] const Loan* to_another(NodeId id, const Identity& device) const noexcept;
  [[nodiscard]] bool lent(NodeId id) const noexcept;
  /// The device failed too often to confirm that it gives its node-ID back: it is no longer asked at every round.
  [[nodiscard]] static bool given_up(const Loan& loan) noexcept { return loan.tries >= most_tries; }

  /// The device had a loan in this run, or one of an earlier run that was not ended, and was not bound since. Even if
  /// it confirmed otherwise it may still use the lent node-ID (the reset after it can have been lost).
  [[nodiscard]] bool borrowed(const Identity& device) const noexcept;
  [[nodiscard]] const std::vector<Identity>& borrowers() const noexcept { return borrowers_; }
  /// It was bound: the node-ID that it uses is stored.
  void bound(const Identity& device) noexcept;

  /// From now on, or until the given time, Berth itself causes boot-up messages under this node-ID.
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
