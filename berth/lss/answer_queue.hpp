/// Sends what an LSS slave answers, in its order (paper 4; S4.10). No heap.
///
/// A controller that sends by identifier would send the base frame 7E4h before the 29-bit feedback that begins with the
/// same eleven bits, and arbitration prefers it too. So the answer is queued when the feedback before it is on the
/// wire. What the master asked since then makes an answer that still waits worthless, or worse, an answer to the wrong
/// question: it is dropped with its feedback.
#pragma once

#include "berth/can/dispatcher.hpp"
#include "berth/lss/slave.hpp"

namespace berth::lss {

class AnswerQueue final : private can::Confirmation, private rt::Job {
 public:
  explicit AnswerQueue(can::Dispatcher& dispatcher) noexcept : dispatcher_(&dispatcher) {}
  ~AnswerQueue() { drop(); }
  AnswerQueue(const AnswerQueue&) = delete;
  AnswerQueue& operator=(const AnswerQueue&) = delete;
  /// No master waits for an answer whose feedback found no place on the bus for so long.
  static constexpr rt::Duration longest = std::chrono::milliseconds(100);

  /// Answers the newest request; what is still to be sent for an older one is dropped. Call it with no answer too.
  void send(const Answers& answers) noexcept;
  /// The device is off, or silent.
  void drop() noexcept;

 private:
  void sent(rt::Time at) noexcept override;
  void run() noexcept override { drop(); }

  can::Dispatcher* dispatcher_;
  can::Frame answer_{};
};

}  // namespace berth::lss
