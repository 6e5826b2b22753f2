/// Devices whose node-IDs LSS cannot change: they answer SDO, and LSS does not reach them.
#pragma once

#include <chrono>
#include <map>
#include <optional>

#include "berth/base/ids.hpp"
#include "berth/rt/executor.hpp"

namespace berth::operate {

class OutOfLss {
 public:
  static constexpr unsigned tries = 2;
  static constexpr rt::Duration asked_anew = std::chrono::minutes(10);

  /// LSS was to change its node-ID, but the device did not answer, or was not alone.
  void in_vain(const Identity& device, rt::Time now);
  /// A search by LSS found it.
  void found(const Identity& device) { devices_.erase(device); }
  /// True after `tries` vain attempts, until the device boots, is `found`, or `asked_anew` has passed. `booted`: its
  /// last boot-up under its node-ID.
  [[nodiscard]] bool contains(const Identity& device, std::optional<rt::Time> booted, rt::Time now) const;

 private:
  struct InVain {
    unsigned times = 0;
    rt::Time last{};
  };
  std::map<Identity, InVain> devices_;
};

}  // namespace berth::operate
