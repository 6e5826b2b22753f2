/// Worst-case response times of the messages of one bus: from the event that causes a message to the end of its frame
/// on the wire, for any behaviour of the others within their limits. Pure.
///
///     analysis::Line line{.bit_rate = 125'000, .messages = ...};
///     const auto result = analysis::analyze(line);
///     for (const auto& r : result.responses) ... r.worst, r.meets_deadline
///
/// Priority queues: Davis, Burns, Bril, Lukkien, *Controller Area Network (CAN) schedulability analysis: Refuted,
/// revisited and revised* (2007), with all instances in the busy period. FIFO queues: the busy period of the lowest
/// identifier in the queue, over all instants at which the message can be queued in it; the waiting time of such a
/// message in its queue is jitter for the messages of other senders (Davis, Kollmann, Pollex, Slomka, *CAN
/// schedulability analysis with FIFO queues*, 2011, make the same step for messages that are never queued twice). The
/// derivation is in docs/analysis.md.
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "berth/rt/executor.hpp"

namespace berth::analysis {

/// The limits of a message. Times in bus time, not negative.
struct Message {
  std::string name;          ///< "TPDO 1 of left drive"
  std::size_t sender = 0;    ///< index in `Line::senders`
  std::uint32_t key = 0;     ///< `can::Frame::key`
  unsigned data_bytes = 8;   ///< 0 to 8
  rt::Duration period{};     ///< least time between events; 0: none, and so no bound
  rt::Duration jitter{};     ///< latest minus earliest time from the event to the frame in the queue
  rt::Duration deadline{0};  ///< from the cause to its effect; 0: none
  rt::Duration before{0};    ///< longest time from the cause to the event: a change waits for an inhibit time
  /// So many of its frames are sent before it, and an equal part of `before` passes after the end of each: an inhibit
  /// time counted from there. 0: `before` passes whatever its frames do.
  unsigned frames_before = 0;
  /// `key` of the message whose reception triggers this one: SYNC. Its event is then that message's, whose response
  /// time is jitter of this one.
  std::optional<std::uint32_t> after{};
  /// Its content takes effect at the next of these periods, which is as late as `after` is: SYNC, where it is received.
  /// 0: at its arrival.
  rt::Duration counts_every{0};
};

/// The order in which the frames of one queue are sent.
enum class Queue : std::uint8_t {
  priority,  ///< by identifier
  in_order,  ///< as they came (FIFO)
  unknown,   ///< either of these: the worse one is used for each message
};

/// A node, or a part of it with its own transmit queue.
struct Sender {
  std::string name;
  Queue queue = Queue::priority;
};

/// Disturbances of the bus: each destroys a frame, which is repeated.
struct Errors {
  rt::Duration interval{0};  ///< least time between them; 0: none
  unsigned burst = 1;        ///< so many together, at worst
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
  /// The longest frame with lower priority than all messages, in data bytes: one may be on the wire when a message
  /// comes. SDO, LSS and everything else that is not analysed. Extended with `background_extended`.
  std::optional<unsigned> background_bytes{};
  bool background_extended = false;
};

/// The result for one message, in the order of `Line::messages`.
struct Response {
  std::size_t message = 0;
  rt::Duration frame{};  ///< longest time of one frame on the wire, intermission included
  /// Empty: no bound. The bus is too slow for it and those before it, or one of them has no least interval.
  std::optional<rt::Duration> worst{};
  std::optional<rt::Duration> arrival{};  ///< the same from the cause to its effect, as for the deadline
  double load = 0;                        ///< its share of the bus, with the longest frames; 0 without a least interval
  /// The deadline is kept, or there is none.
  bool meets_deadline = false;
};

struct Result {
  std::vector<Response> responses;
  double load = 0;  ///< share of the bus for all messages with a least interval; above 1: they do not fit
  /// Each message has a bound and keeps its deadline, and all fit on the bus.
  [[nodiscard]] bool good() const noexcept;
};

/// `wrong` returns errors of the input (no bit rate, a negative time, more than 8 bytes, an unknown sender), empty if
/// there is none; `analyze` requires input without errors.
[[nodiscard]] std::string wrong(const Line& line);
[[nodiscard]] Result analyze(const Line& line);

/// "181h", "18FF0105h": a message's identifier in the usual form.
[[nodiscard]] std::string key_text(std::uint32_t key);

/// Longest time of a frame on the wire, at the line's bit rate.
[[nodiscard]] rt::Duration frame_time(const Line& line, bool extended, unsigned data_bytes) noexcept;
/// True when a frame with key `a` wins arbitration against one with key `b` (base identifier first; of equal ones the
/// base frame; Bosch CAN 2.0 part B §3.1.1).
[[nodiscard]] bool precedes(std::uint32_t a, std::uint32_t b) noexcept;

}  // namespace berth::analysis
