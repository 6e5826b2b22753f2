/// Devices whose node-IDs are not LSS's to change: they answer SDO, and LSS does not reach them.
#pragma once

#include <chrono>
#include <map>

#include "berth/operate/bus_services.hpp"

namespace berth::operate {

class OutOfLss {
 public:
  static constexpr unsigned tries = 2;
  static constexpr rt::Duration asked_anew = std::chrono::minutes(10);

  explicit OutOfLss(const BusServices& services) noexcept : s_(services) {}

  /// LSS was to change its node-ID, and it did not answer.
  void in_vain(const Identity& device);
  /// A search by LSS found it.
  void found(const Identity& device) { devices_.erase(device); }
  /// `tries` times in vain. Until it boots under the node-ID that it `uses`, is `found`, or `asked_anew` is over.
  [[nodiscard]] bool contains(const Identity& device, NodeId uses) const;

 private:
  struct InVain {
    unsigned times = 0;
    rt::Time last{};
  };
  const BusServices& s_;
  std::map<Identity, InVain> devices_;
};

}  // namespace berth::operate
