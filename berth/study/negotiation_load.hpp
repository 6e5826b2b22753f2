/// What paper 2's negotiation costs the rest of the bus: its identifiers outrank everything but NMT (S2.28).
///
/// Each row is a simulated world: blank devices that all get power at once and negotiate until each has a node-ID,
/// beside one node that sends a process data object every 10 ms. The devices' stack is Berth's, mode `on`.
#pragma once

#include <cstdint>
#include <vector>

#include "berth/rt/executor.hpp"

namespace berth::study {

struct LoadRow {
  unsigned devices = 0;
  std::uint32_t bit_rate = 0;       ///< bit/s
  unsigned with_id = 0;             ///< devices that have a node-ID of their own at the end
  rt::Duration settled{0};          ///< first frame of the negotiation to the last announcement
  std::uint64_t frames = 0;         ///< of the negotiation in that time, merged ones counted once
  std::uint64_t bits = 0;           ///< theirs, three of intermission included
  double mean_load = 0;             ///< bits / (settled * bit_rate), 0..1
  double peak_load = 0;             ///< the most in any 100 ms, 0..1
  rt::Duration longest_run{0};      ///< longest time in which negotiation frames followed each other without a gap: how
                                    ///< long any PDO can be blocked by it
  rt::Duration pdo_waited{0};       ///< longest that the node's PDO waited for the bus, other frames included
  rt::Duration pdo_undisturbed{0};  ///< the same before the negotiation began (no other node sends: 0 at best)
  bool complete = false;            ///< every device had its own node-ID within the bound
};

/// 2, 10, 30 and 127 devices at 50, 125 and 500 kbit/s, in this order. Takes some seconds.
[[nodiscard]] std::vector<LoadRow> negotiation_load(std::uint64_t seed);
/// One row.
[[nodiscard]] LoadRow negotiation_load(unsigned devices, std::uint32_t bit_rate, std::uint64_t seed);

}  // namespace berth::study
