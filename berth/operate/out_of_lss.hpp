/// Devices whose node-IDs are not LSS's to change: they answer SDO, and LSS does not reach them.
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

  /// LSS was to change its node-ID, and it did not answer, or not alone.
  void in_vain(const Identity& device, rt::Time now);
  /// A search by LSS found it.
  void found(const Identity& device) { devices_.erase(device); }
  /// `tries` times in vain. Until it boots, is `found`, or `asked_anew` is over. `booted`: under its node-ID, last.
  [[nodiscard]] bool contains(const Identity& device, std::optional<rt::Time> booted, rt::Time now) const;

 private:
  struct InVain {
    unsigned times = 0;
    rt::Time last{};
  };
  std::map<Identity, InVain> devices_;
};

}  // namespace berth::operate
