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

 private:
  struct Entry {
    LssAddress device;
    LackSet lacks;
  };
  std::vector<Entry> entries_;
};

}  // namespace berth::lss
