/// Worst-case response times of the messages of one bus: from the event that causes a message to the end of its frame
/// on the wire, whatever the others do within what is said of them. Pure.
///
///     analysis::Line line{.bit_rate = 125'000, .messages = ...};
///     const auto result = analysis::analyze(line);
///     for (const auto& r : result.responses) ... r.worst, r.meets_deadline
///
/// Priority queues: Davis, Burns, Bril, Lukkien, *Controller Area Network (CAN) schedulability analysis: Refuted,
/// revisited and revised* (2007), with all instances in the busy period. FIFO queues: the busy period of the lowest
/// identifier in the queue, over all instants at which the message can be queued in it; what such a message waits in
/// its queue is jitter to the messages of other senders (Davis, Kollmann, Pollex, Slomka, *CAN schedulability analysis
/// with FIFO queues*, 2011, make the same step for messages that are never queued twice). The derivation stands in
/// docs/analysis.md.
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "berth/rt/executor.hpp"

namespace berth::analysis {

/// What a message can do at most. Times in bus time, not negative.
struct Message {
  std::string name;          ///< "TPDO 1 of left drive"
  std::size_t sender = 0;    ///< index in `Line::senders`
  std::uint32_t key = 0;     ///< `can::Frame::key`
  unsigned data_bytes = 8;   ///< 0 to 8
  rt::Duration period{};     ///< least time from event to event; greater than 0
  rt::Duration jitter{};     ///< latest minus earliest time from the event to the frame in the queue
  rt::Duration deadline{0};  ///< from the event; 0: none
};

/// A node, or a part of it that has a transmit queue of its own.
struct Sender {
  std::string name;
  bool fifo = false;  ///< its frames leave in the order in which they came; else by identifier
};

/// Disturbances of the bus: each destroys a frame, which is sent again.
struct Errors {
  rt::Duration interval{0};  ///< least time from one to the next; 0: there are none
  unsigned burst = 1;        ///< so many at once, at worst
};

enum class FrameLengths : std::uint8_t {
  reachable,  ///< the longest that some frame of its kind really is (`can::reachable_most_bits`)
  usual,      ///< the bound that the literature and other tools use (`can::worst_case_bits`), one to three bits longer
};

struct Line {
  std::uint32_t bit_rate = 125'000;
  FrameLengths lengths = FrameLengths::reachable;
  std::vector<Sender> senders{};
  std::vector<Message> messages{};
  Errors errors{};
  /// The longest frame of a lower priority than all messages, in data bytes: one may be on the wire when a message
  /// comes. SDO, LSS and what else is not analysed. Extended when `background_extended`.
  std::optional<unsigned> background_bytes{};
  bool background_extended = false;
};

/// Of one message, in the order of `Line::messages`.
struct Response {
  std::size_t message = 0;
  rt::Duration frame{};                 ///< longest time of one frame on the wire, intermission included
  std::optional<rt::Duration> worst{};  ///< empty: there is no bound, the bus is too slow for it and those before it
  double load = 0;                      ///< its share of the bus, frames at their longest
  /// The deadline is kept; true too where there is none.
  bool meets_deadline = false;
};

struct Result {
  std::vector<Response> responses;
  double load = 0;  ///< share of the bus that all messages take; 1 and more: they do not fit
  [[nodiscard]] bool good() const noexcept;
};

/// Errors of the input (no bit rate, a period of 0, more than 8 bytes, a sender that is not there) are refused by
/// `wrong`, empty when all is well; `analyze` wants such input.
[[nodiscard]] std::string wrong(const Line& line);
[[nodiscard]] Result analyze(const Line& line);

/// "181h", "18FF0105h": a message's identifier as people write it.
[[nodiscard]] std::string key_text(std::uint32_t key);

/// Longest time of a frame on the wire, at the line's bit rate.
[[nodiscard]] rt::Duration frame_time(const Line& line, bool extended, unsigned data_bytes) noexcept;
/// True when a frame with key `a` wins arbitration against one with key `b` (base identifier first; of equal ones the
/// base frame; Bosch CAN 2.0 part B §3.1.1).
[[nodiscard]] bool precedes(std::uint32_t a, std::uint32_t b) noexcept;

}  // namespace berth::analysis
