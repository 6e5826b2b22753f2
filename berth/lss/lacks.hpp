/// What the devices of a bus lack of LSS, as a master has learnt it: a service that is missing costs its time-outs
/// once.
#pragma once

#include <vector>

#include "berth/lss/frames.hpp"

namespace berth::lss {

class LackMemory {
 public:
  /// It was seen to lack this service.
  [[nodiscard]] bool has(const LssAddress& device, Lackable what) const noexcept;
  /// It, or another of its type and revision.
  [[nodiscard]] bool likely(const LssAddress& device, Lackable what) const noexcept;
  void note(const LssAddress& device, Lackable what);
  /// Fastscan has brought it into configuration once: where 40h to 43h do not, that may again.
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
