#pragma once

#include "berth/base/ids.hpp"

namespace berth::lss {

/// Knows whether a node-ID that was found vacant is still vacant.
class Vacancy {
 public:
  /// False: a device with this node-ID was heard since.
  [[nodiscard]] virtual bool still_vacant(NodeId) const noexcept { return true; }

 protected:
  ~Vacancy() = default;
};

}  // namespace berth::lss
