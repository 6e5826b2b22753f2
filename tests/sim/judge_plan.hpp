/// What the bus and the judge are both put through, drawn from a seed, and whether they agree.
#pragma once

#include <gtest/gtest.h>
#include <cstdint>

#include <string>
#include <vector>

#include "berth/base/random.hpp"
#include "bit_model.hpp"

namespace judge {

struct NodePlan {
  unsigned tec = 0;
  unsigned rec = 0;
  bool by_priority = false;
  bool listen_only = false;
  Time bit = 1000;
};

/// Something that happens to a node; `apart` takes several nodes to a segment of their own, `join` is for all.
struct Act {
  enum class Kind { send, power_off, power_on, restart, set_bit, unplug, plug, apart, join };
  Time when;
  Kind kind;
  int node = 0;
  Frame frame{};
  Time bit = 0;
  std::vector<int> others{};
};

/// Turned bits, for some nodes, of the first frame on their segment that starts at `from` or later.
struct Disturbance {
  Time from;
  int bit;
  int count;  ///< so many bits one after the other
  std::vector<int> nodes;
};

struct Plan {
  std::vector<NodePlan> nodes;
  std::vector<Act> acts;
  std::vector<Disturbance> disturbances;
  Time until = 0;
  Time fast_bit = 0;  ///< of an FD bus
};

struct Result {
  std::vector<Event> events;
  std::vector<std::tuple<unsigned, unsigned, bool>> counters;  ///< bus-off: TEC and REC mean nothing
  std::uint64_t frames = 0;
  std::uint64_t collisions = 0;
  std::uint64_t errors = 0;     ///< the judge's
  std::uint64_t recovered = 0;  ///< the judge's: nodes back from bus-off
  std::uint64_t whole_fd = 0;
  std::uint64_t destroyed_fd = 0;  ///< the bus's
};

[[nodiscard]] Frame draw_frame(berth::Random& dice);
[[nodiscard]] unsigned draw_counter(berth::Random& dice, bool receive);
/// Up to `most` nodes of 1 Mbit/s, and frames that they send.
[[nodiscard]] Plan draw_traffic(berth::Random& dice, std::size_t most);
void draw_disturbances(berth::Random& dice, Plan& plan, unsigned most);

/// `out`: what happened. `perturbation`: jobs of one instant in another order.
[[nodiscard]] testing::AssertionResult agree(const Plan& plan, Result* out = nullptr, std::uint64_t perturbation = 0);

}  // namespace judge
