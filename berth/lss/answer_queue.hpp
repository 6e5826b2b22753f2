/// Sends the answers of an LSS slave, in their order (paper 4; S4.10). No heap.
///
/// A controller that sends by identifier would send the base frame 7E4h before the 29-bit feedback, which begins with
/// the same eleven bits; arbitration prefers it too. So the answer is queued when its feedback is on the wire. A newer
/// request makes a waiting answer worthless, or an answer to the wrong question: it is dropped with its feedback.
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
  /// After so long no master waits for an answer whose feedback could not be sent.
  static constexpr rt::Duration longest = std::chrono::milliseconds(100);

  /// Answers the newest request and drops unsent frames for an older one. Call it also when there is no answer.
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
