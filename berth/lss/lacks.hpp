/// LSS services that the devices of a bus lack, as a master has learnt: a missing service costs its time-outs only
/// once.
#pragma once

#include <vector>

#include "berth/lss/frames.hpp"

namespace berth::lss {

class LackMemory {
 public:
  /// True if the device was seen to lack this service.
  [[nodiscard]] bool has(const LssAddress& device, Lackable what) const noexcept;
  /// True if it, or another of its type and revision, lacks it.
  [[nodiscard]] bool likely(const LssAddress& device, Lackable what) const noexcept;
  void note(const LssAddress& device, Lackable what);
  /// True if Fastscan has brought it into configuration once: if 40h to 43h fail, Fastscan may work again.
  [[nodiscard]] bool is_scanned(const LssAddress& device) const noexcept;
  void scanned(const LssAddress& device);

 private:
  struct Entry {
    LssAddress device;
    LackSet lacks{};
    bool scanned = false;
  };
  Entry& entry_of(const LssAddress& device);
  std::vector<Entry> entries_;
};

}  // namespace berth::lss
