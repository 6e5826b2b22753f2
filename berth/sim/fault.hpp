/// Planned faults of wires and nodes. A fault waits for a frame; power, cable, deafness and similar are methods of
/// `Controller` and can be called at any time, or as the `act` of a fault.
#pragma once

#include <cstdint>
#include <functional>
#include <limits>
#include <optional>
#include <vector>

#include "berth/can/frame.hpp"
#include "berth/rt/executor.hpp"

namespace berth::sim {

class Controller;

/// The start of a frame, for a fault's predicate. With several merged senders `sender` is the lowest number.
struct FrameStart {
  const can::Frame& frame;
  std::uint64_t number;  ///< frames started on this bus before this one, repetitions counted
  rt::Time at;           ///< start of the start-of-frame bit
  int sender;            ///< `Controller::number()`
};

/// The frame that a fault affects: the first that fulfils every given condition.
struct Trigger {
  std::optional<std::uint64_t> frame{};           ///< exactly this `FrameStart::number`
  std::optional<rt::Time> not_before{};           ///< a frame that starts at this time or later
  std::function<bool(const FrameStart&)> when{};  ///< empty: any frame
  std::uint32_t skip = 0;                         ///< matching frames to skip first
  std::uint32_t times = 1;                        ///< matching frames to affect then; 0 = all from then on
};

/// A place in a frame, in bits on the wire, with stuff bits. From the start, 0 is the start-of-frame bit; places after
/// the frame (intermission, error flags) are allowed. From the end, 0 is the last bit of end-of-frame, 1 the last but
/// one, 7 the ACK delimiter, 8 the ACK slot; -1 to -3 are the intermission bits 1 to 3.
struct BitPosition {
  int bit = 0;
  bool from_end = false;
};
[[nodiscard]] constexpr BitPosition from_start(int bit) noexcept { return {bit, false}; }
[[nodiscard]] constexpr BitPosition from_end(int bit) noexcept { return {bit, true}; }

/// One planned fault.
struct Fault {
  enum class Kind : std::uint8_t {
    flip,       ///< the victims see the opposite of what is on the wire, from `where` for `bits` bits
    dominant,   ///< the victims see dominant there
    recessive,  ///< the victims see recessive there
    overrun,    ///< the victims' receive buffer loses the frame (it is still acknowledged); `where` is ignored
    act,        ///< `act` is called when the frame reaches `where`
  };
  Kind kind = Kind::flip;
  Trigger trigger{};
  BitPosition where{};
  unsigned bits = 1;
  std::vector<const Controller*> victims{};  ///< empty: every node of the bus
  bool spare_senders = false;                ///< with empty `victims`: every node except the senders
  std::function<void()> act{};
};

/// Faults drawn at random, with the world's seed.
struct RandomFaults {
  std::uint32_t disturbed_per_million =
      0;  ///< frames of which one random bit is flipped for a random non-empty set of nodes
  std::uint32_t overrun_per_million = 0;  ///< frames that a random receiver loses
};

}  // namespace berth::sim
