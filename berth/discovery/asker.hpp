/// Sends one Fastscan question after the other, and waits for answers no longer than necessary.
///
/// How long to wait. A slave is *ready* when its answer is in its controller's queue, at most `response` after the
/// request was confirmed (`Latency`). From then on arbitration helps: 7E4h, and feedback in either form, wins against
/// the next request on 7E5h. So a request that is queued `response` after the one before is sent after every answer to
/// that one, however loaded the bus is. Its confirmation is the fence: frames heard before it belong to the request
/// before, frames heard after it to the new one. This gives the windows:
///
/// - A device answered: the window ends `response` after the confirmation. If a slower device's answer is on the wire
///   by then, it still comes before the next request and counts for this question (`Heard::answers`).
/// - No device answered yet: the window ends `response`, one answer's frame and `Options::blocking` after the
///   confirmation. By then an answer has been heard, unless other traffic delays it; a delayed one is still heard
///   before the next request is confirmed. In that case the next request is taken back if it is not on the wire yet,
///   and its question ends at once with `Heard::late`: the request before *was* answered. Otherwise `late` comes with
///   the next question's own outcome.
/// - `Wait::quick`: `response` alone, if the port takes a queued request back in time (this is learnt too). For a
///   caller that checks `Heard::late` of the following question.
/// - `Wait::bound`: silence counts only after the longest response, `Options::window`, or, when patience has learnt it,
///   the response of the slowest device of this search.
/// - `Wait::closing`: silence here ends the search. It counts only after `Options::window`, whatever was learnt: a
///   device not met yet may need so long.
///
/// A window never ends at the first answer before `response` is over: a second device's later answer would be heard
/// after the next request and count for the wrong question. The one exception is `alone`, for a caller that goes down
/// into ever smaller parts of the tree and has got exactly one answer, counted up to the fence, to several questions in
/// a row. Two devices there would have had to answer in the same bit every time. If they always do so, because their
/// latency is fixed, neither is late. If it was chance, a late answer costs time.
///
/// A device that needs longer than `response` is taken as silent once, and its answer may count for the next request.
/// Both only cost time: the walk relies on whole confirmed parts and on what the selected device itself reports as its
/// serial number.
#pragma once

#include <vector>

#include "berth/can/dispatcher.hpp"
#include "berth/discovery/discovery.hpp"
#include "berth/discovery/haste.hpp"
#include "berth/discovery/latency.hpp"
#include "berth/lss/frames.hpp"

namespace berth::discovery {

enum class Wait : std::uint8_t {
  quick,
  learnt,
  bound,
  closing,
};

/// The outcome of one question.
struct Heard {
  bool late = false;      ///< the question before was answered after its window
  bool sent = true;       ///< false: taken back, because `late`
  unsigned answers = 0;   ///< 4Fh; equal ones may have merged into one
  unsigned before = 0;    ///< 4Fh to the question before, all of them
  rt::Time at{};          ///< the confirmation
  bool feedback = false;  ///< at least one feedback frame
  [[nodiscard]] bool yes() const noexcept { return answers > 0 || feedback; }
};

class Asker;

/// One question. `Asker` makes it; destroying it ends it.
class Question final : public rt::Operation<Question>, private rt::Job, private can::Confirmation {
 public:
  ~Question();
  bool start() noexcept;
  Result<Heard> await_resume() noexcept { return outcome_; }

 private:
  friend class Asker;
  enum class Step : std::uint8_t { idle, inhibited, sending, listening, done };
  Question(Asker& asker, const lss::FastscanRequest& request, Wait wait, bool alone) noexcept
      : asker_(&asker), request_(request), wait_(wait), alone_(alone) {}
  void sent(rt::Time at) noexcept override;
  void run() noexcept override;
  void send() noexcept;
  void try_to_send() noexcept;
  void answered(rt::Time at, bool whole) noexcept;
  void late(rt::Time at) noexcept;
  void fail_with(const char* text) noexcept;
  void over() noexcept;
  void end() noexcept;

  Asker* asker_;
  lss::FastscanRequest request_;
  Wait wait_;
  bool alone_;
  Step step_ = Step::idle;
  rt::Time give_up_{};   // sending
  rt::Time ready_by_{};  // when every answer is ready
  Heard heard_{};
  Result<Heard> outcome_{};
};

/// Belongs to one planner. One question at a time.
class Asker final : private can::Handler {
 public:
  explicit Asker(can::Dispatcher& dispatcher);
  /// Call it before a search; the options must outlive the search. `feedback`: collect feedback, with this base for the
  /// eleven-bit form (0: none).
  void begin(const Options& options, std::uint16_t feedback_base) noexcept;

  [[nodiscard]] Question ask(const lss::FastscanRequest& request, Wait wait, bool alone = false) noexcept {
    return {*this, request, wait, alone && !wholly_};
  }
  /// Forgets what was learnt from other devices: those of this search may be slower.
  void forget() noexcept;
  /// Every window is as long as an answer may need, and an answer shortens it only when one device is left; for use
  /// after haste has failed. The length is the bound, until enough patient questions have shown the slowest answer.
  /// `wholly`: not shortened even when one device seems to be left.
  void be_patient(bool on, bool wholly = false) noexcept {
    patient_ = on;
    wholly_ = on && wholly;
  }
  /// Patience failed too: learns the slowest answer anew.
  void be_more_patient() noexcept { patience_.renew(); }
  /// Feedback heard since the last question's confirmation, distinct, ascending. Valid until the next question is sent.
  [[nodiscard]] const std::vector<lss::FeedbackValue>& feedback() const noexcept { return feedback_; }
  /// Feedback heard for the question before that.
  [[nodiscard]] const std::vector<lss::FeedbackValue>& feedback_before() const noexcept { return before_; }
  /// When every answer to the last question is ready: the earliest time for a request whose answers must not be
  /// confused with those.
  [[nodiscard]] rt::Time settled() const noexcept { return asked_ + longest(); }
  /// Another service sent a request: the next question keeps the inhibit time.
  void sent_elsewhere(rt::Time at) noexcept { last_sent_ = at; }
  /// 4Fh since the last question's confirmation, up to now.
  [[nodiscard]] unsigned answers() const noexcept { return answers_; }
  /// Questions sent since `begin`.
  [[nodiscard]] unsigned requests() const noexcept { return requests_; }
  /// After `at` + this no device answers a request that was confirmed at `at`.
  [[nodiscard]] rt::Duration longest() const noexcept;
  /// The same, as far as it was learnt.
  [[nodiscard]] rt::Duration usual() const noexcept;
  [[nodiscard]] const Latency& latency() const noexcept { return latency_; }

 private:
  friend class Question;
  void received(const can::Frame& frame, rt::Time at) noexcept override;
  void learn() noexcept;
  void sign(rt::Duration own, rt::Time at, bool whole) noexcept;

  can::Dispatcher* dispatcher_;
  const Options* options_ = nullptr;
  std::uint16_t feedback_base_ = 0;
  Question* current_ = nullptr;
  Latency latency_;
  std::vector<lss::FeedbackValue> feedback_;
  std::vector<lss::FeedbackValue> before_;
  unsigned answers_ = 0;
  unsigned requests_ = 0;
  bool patient_ = false;
  bool wholly_ = false;
  bool asked_patiently_ = false;
  Patience patience_;
  bool takes_back_ = false;  // the port takes back a queued frame before it is on the wire
  rt::Duration frame_{0};    // an answer's time on the wire; 0 when the port does not know its bit rate
  rt::Time asked_{};         // confirmation of the last question
  rt::Time last_sent_{};
  rt::Duration first_{};  // from then until the first answer, or its feedback, was ready
  rt::Time last_{};       // the last answer
  unsigned signs_ = 0;    // frames of both kinds since then
};

}  // namespace berth::discovery
