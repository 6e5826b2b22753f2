/// The acceptance filters of the nodes of one segment. Internal to `sim`.
#pragma once

#include <cstdint>
#include <vector>

#include "berth/can/port.hpp"

namespace berth::sim {

/// Which nodes of a segment receive a key: one bit per node, so that a frame costs nothing for other nodes.
class Filters {
 public:
  /// Replaces the filter `before` of node `slot` by `accept`.
  void set(std::uint32_t slot, const std::vector<can::IdRange>& before, const std::vector<can::IdRange>& accept);
  /// The nodes that receive `key`: `words()` words.
  [[nodiscard]] const std::uint64_t* find(std::uint32_t key) noexcept;
  [[nodiscard]] std::size_t words() const noexcept { return words_; }
  void grow(std::size_t slots);

 private:
  struct Cached {
    std::uint32_t key = 0;  // extended keys are never 0
    std::vector<std::uint64_t> nodes;
  };
  struct Extended {
    std::uint32_t slot;
    std::vector<can::IdRange> ranges;
  };
  std::size_t words_ = 0;
  std::vector<std::uint64_t> base_;  // 2048 rows
  std::vector<Extended> extended_;   // nodes that receive extended keys
  std::vector<Cached> cache_ = std::vector<Cached>(64);
};

}  // namespace berth::sim
