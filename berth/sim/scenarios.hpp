/// Textbook scenes of fault confinement, step by step, as `berth sim` prints them (docs/protocols/can-frames.md
/// §Arbitration, §Fault confinement; paper 4's two roads to bus-off, S4.1).
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "berth/sim/controller.hpp"

namespace berth::sim {

struct NodeStep {
  std::string name;
  std::uint16_t tec = 0;
  std::uint16_t rec = 0;
  ErrorState state = ErrorState::active;
};

/// One event and the counters after it.
struct Step {
  std::uint64_t bit = 0;  ///< bit times since the beginning
  std::string event;
  std::vector<NodeStep> nodes;
};

[[nodiscard]] const char* name(ErrorState state) noexcept;  ///< "active", "passive", "bus-off"

/// Two nodes send different data with one identifier at the same instant; a third listens. 16 collisions raise both
/// transmitters to TEC 128; in the 17th the node that detects first signals passively and the other succeeds. One such
/// coincidence ends error-passive. With more `coincidences` the same node loses each: TEC + 8 for its passive flag, - 1
/// for its success after it, until it is bus-off: from 135, + 7 each, in the nineteenth (254 + 8).
[[nodiscard]] std::vector<Step> two_with_one_id(unsigned coincidences = 1);

/// A node at `stranger_rate` (bit/s, less than 1 Mbit/s) only listens. It cannot decode the frames that the others send
/// at 1 Mbit/s, and destroys them repeatedly. Its flag of six bits is 6 x 1 Mbit/s / `stranger_rate` bits long for the
/// others: besides the 8 of its error, the transmitter gets 8 more for the 8th dominant bit after its own flag and for
/// each further 8 (rule 6). It is bus-off after 32 attempts at most, while the stranger, the cause, is still
/// error-active: its REC rises by 1 an attempt. At a quarter or half of the rate, its flag meets each new start of
/// frame in arbitration, which is lost at no cost: there all become error-passive, and the frame is delivered.
[[nodiscard]] std::vector<Step> wrong_bit_rate(std::uint32_t stranger_rate = 125'000);

/// One node sends on a bus without others: no node acknowledges; TEC rises to 128 in 16 attempts and stays there, never
/// bus-off. Shows `attempts` of them.
[[nodiscard]] std::vector<Step> lone_node(unsigned attempts = 20);

}  // namespace berth::sim
