/// One pass through the parts of the address, from the place of the devices to the serial numbers, and the devices
/// there. Internal to `discovery`.
#pragma once

#include "berth/discovery/walk_serials.hpp"

namespace berth::discovery::walk {

class Route {
 public:
  Route(Questions& questions, Descent& descent, Serials& serials, KnownPaths& paths, const Report& report) noexcept
      : q_(questions), descent_(descent), serials_(serials), paths_(paths), report_(report) {}
  /// Known parts first, then by bits or feedback.
  rt::Task<void> round();
  /// The round before found so many devices.
  void note_found(std::size_t count) noexcept { last_found_ = count; }

 private:
  Questions& q_;
  Descent& descent_;
  Serials& serials_;
  KnownPaths& paths_;
  const Report& report_;
  std::array<std::uint32_t, 4> last_chain_{};
  std::size_t last_found_ = 0;
};

}  // namespace berth::discovery::walk
