/// Which devices are on a bus (`berth scan`).
#pragma once

#include <vector>

#include "berth/operate/parts.hpp"
#include "berth/operate/seen.hpp"

namespace berth::operate {

class Scan {
 public:
  explicit Scan(Parts& parts) noexcept : p_(parts) {}
  /// Node-IDs 1..127 by SDO, devices without one by RAND. Changes nothing but the devices' RAND state. Waits for its
  /// turn.
  [[nodiscard]] rt::Task<Result<std::vector<Seen>>> run();

 private:
  rt::Task<void> ask(NodeId id, Seen& seen);
  Parts& p_;
};

}  // namespace berth::operate
