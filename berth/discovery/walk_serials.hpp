/// The walk among the serial numbers of one type and revision. Internal to `discovery`.
#pragma once

#include <optional>

#include "berth/discovery/walk_descent.hpp"
#include "berth/discovery/walk_devices.hpp"

namespace berth::discovery::walk {

class Serials {
 public:
  Serials(Questions& questions, Descent& descent, Devices& devices, const Known& known, const Options& options,
          const Report& report) noexcept
      : q_(questions), descent_(descent), devices_(devices), known_(known), options_(options), report_(report) {}

  /// Until no more devices are found here, or too many places in a row answered without leading to a device.
  rt::Task<void> all();
  /// Descends from one place and takes the device that it leads to.
  rt::Task<bool> place(Open place);
  /// Asks for the next number of the row that ends with the last one found. True: it is there.
  rt::Task<bool> next_of_last();
  /// The same parts led here as in the round before, and each round found one device. Equal answers merge into one
  /// here, so their number says nothing; if called again, the slaves forget their part at `04 00`.
  void note_one_each_round() noexcept { (hints_fail_ ? forgets_ : hints_fail_) = true; }
  /// A device that answers although it has a node-ID is found fastest by name; afterwards the walk goes round it.
  rt::Task<void> registered_by_name();

 private:
  rt::Task<void> by_name();
  rt::Task<void> around();
  rt::Task<Outcome> guess(std::uint64_t serial, Worth& worth);
  [[nodiscard]] std::optional<std::uint32_t> next_of_row(std::uint32_t serial, bool up) const;
  rt::Task<bool> anybody_left();
  rt::Task<std::optional<Prefix>> others_left();
  rt::Task<bool> again_at_serials();
  rt::Task<bool> lead_to_serials();
  rt::Task<void> lead_who_forgot();

  Questions& q_;
  Descent& descent_;
  Devices& devices_;
  const Known& known_;
  const Options& options_;
  const Report& report_;
  unsigned failed_ = 0;  // places in a row that answered without a device being found
  Worth row_;
  Worth next_;
  Worth near_;
  bool hints_fail_ = false;
  bool forgets_ = false;
  bool remembering_tested_ = false;
};

}  // namespace berth::discovery::walk
