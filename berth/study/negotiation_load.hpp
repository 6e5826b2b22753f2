/// The bus load of paper 2's negotiation, whose identifiers have priority over everything but NMT (S2.28).
///
/// Each row is a simulated world: blank devices are powered together and negotiate until each has a node-ID, while
/// another node sends a process data object every 10 ms. The devices' stack is Berth's, mode `on`.
#pragma once

#include <cstdint>
#include <vector>

#include "berth/rt/executor.hpp"

namespace berth::study {

struct LoadRow {
  unsigned devices = 0;
  std::uint32_t bit_rate = 0;       ///< bit/s
  unsigned with_id = 0;             ///< devices with their own node-ID at the end
  rt::Duration settled{0};          ///< first frame of the negotiation to the last announcement
  std::uint64_t frames = 0;         ///< of the negotiation in that time, merged ones counted once
  std::uint64_t bits = 0;           ///< of these frames, including three of intermission
  double mean_load = 0;             ///< bits / (settled * bit_rate), 0..1
  double peak_load = 0;             ///< the maximum in any 100 ms, 0..1
  rt::Duration longest_run{0};      ///< longest sequence of negotiation frames without a gap: how long they can block a
                                    ///< PDO
  rt::Duration pdo_waited{0};       ///< longest time that the node's PDO waited for the bus, including other frames
  rt::Duration pdo_undisturbed{0};  ///< the same before the negotiation began (no other node sends: 0 at best)
  bool complete = false;            ///< every device had its own node-ID in time
};

/// 2, 10, 30 and 127 devices at 50, 125 and 500 kbit/s, in this order. Takes some seconds.
[[nodiscard]] std::vector<LoadRow> negotiation_load(std::uint64_t seed);
/// One row.
[[nodiscard]] LoadRow negotiation_load(unsigned devices, std::uint32_t bit_rate, std::uint64_t seed);

}  // namespace berth::study
