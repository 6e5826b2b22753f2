/// One Fastscan question after the other, none waiting longer than it must.
///
/// What is waited for. A slave is *ready* when its answer stands in its controller's queue, at most `response` after
/// the request was confirmed (`Latency`). From then on the bus works for us: 7E4h, and feedback in either form, wins
/// arbitration against our next request on 7E5h. So a request that is queued `response` after the one before is sent
/// after every answer to the one before, however loaded the bus is, and its confirmation is the fence: what was heard
/// before it belongs to the request before, what is heard after it to itself. From this follow the windows:
///
/// - A device answered: the window ends `response` after the confirmation. A slower device's answer to this request is
///   then on the wire before the next request and is counted here (`Heard::answers`), not there.
/// - No device answered yet: the window ends `response`, one answer's frame and `Options::blocking` after the
///   confirmation, for then an answer has been heard unless other traffic holds it up. If it is held up, it is still
///   heard before the next request is confirmed. The next request is then taken back when it is not on the wire yet,
///   and its question ends at once with `Heard::late`: the request before *was* answered. Otherwise `late` comes with
///   its own outcome.
/// - `Wait::quick`: `response` alone, where the port takes a queued request back in time (learnt too). For a caller
///   that looks at `Heard::late` of the question after.
/// - `Wait::bound`: silence is believed only after the longest response, `Options::window`; where patience has learnt
///   how slow the slowest of this search is, after that.
/// - `Wait::closing`: by this silence a search ends. It is believed only after `Options::window`, whatever was learnt:
///   a device that was not met yet may need so long.
///
/// A window is not cut at the first answer before `response` is over: a second device that answers later would be heard
/// after the next request, and its yes would be a yes to the wrong question. The one exception is `alone`, for the
/// asker that goes down into ever smaller parts of the tree and has got exactly one answer, counted up to the fence, to
/// several questions in a row. Two devices there would have had to answer at the very same bit every time. If they
/// always do, because their latency is fixed, none of them is late. If they did by chance, a late answer costs time.
///
/// A device that needs longer than `response` is wrongly taken as silent once, and its answer perhaps as one to the
/// next request. Both cost time only: the walk that asks goes by whole confirmed parts and by what the selected device
/// itself says of its serial number.
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

/// What came of one question.
struct Heard {
  bool late = false;      ///< the question before was answered after it had been given up
  bool sent = true;       ///< false: taken back, because `late`
  unsigned answers = 0;   ///< 4Fh; equal ones may have fallen into one
  unsigned before = 0;    ///< 4Fh to the question before, all of them
  rt::Time at{};          ///< the confirmation
  bool feedback = false;  ///< at least one feedback frame
  [[nodiscard]] bool yes() const noexcept { return answers > 0 || feedback; }
};

class Asker;

/// One question. Made by `Asker`; destroying it ends it.
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
  rt::Time ready_by_{};  // every answer is ready
  Heard heard_{};
  Result<Heard> outcome_{};
};

/// Belongs to one planner. One question at a time.
class Asker final : private can::Handler {
 public:
  explicit Asker(can::Dispatcher& dispatcher);
  /// Before a search: its options must stay. `feedback`: collect feedback, with this base for the eleven-bit form (0:
  /// none).
  void begin(const Options& options, std::uint16_t feedback_base) noexcept;

  [[nodiscard]] Question ask(const lss::FastscanRequest& request, Wait wait, bool alone = false) noexcept {
    return {*this, request, wait, alone && !wholly_};
  }
  /// What was learnt is of other devices: those of this search may be slower.
  void forget() noexcept;
  /// Every window is as long as an answer may need, and no answer cuts it short unless one device is left: for when
  /// haste has led nowhere. So long is the bound, until enough patient questions have told the slowest answer.
  /// `wholly`: nor when one device seems to be left.
  void be_patient(bool on, bool wholly = false) noexcept {
    patient_ = on;
    wholly_ = on && wholly;
  }
  /// Patience has led nowhere either: the slowest answer is still to be learnt.
  void be_more_patient() noexcept { patience_.renew(); }
  /// Feedback heard since the last question's confirmation, distinct, ascending. Good until the next question is sent.
  [[nodiscard]] const std::vector<lss::FeedbackValue>& feedback() const noexcept { return feedback_; }
  /// What was heard of the question before that one.
  [[nodiscard]] const std::vector<lss::FeedbackValue>& feedback_before() const noexcept { return before_; }
  /// Every answer to the last question is ready from then on: the earliest time at which a request may follow that is
  /// to be fenced off from it.
  [[nodiscard]] rt::Time settled() const noexcept { return asked_ + longest(); }
  /// Another service's request was sent: the next question keeps the inhibit time.
  void sent_elsewhere(rt::Time at) noexcept { last_sent_ = at; }
  /// 4Fh since the last question's confirmation, up to now.
  [[nodiscard]] unsigned answers() const noexcept { return answers_; }
  /// Questions sent since `begin`.
  [[nodiscard]] unsigned requests() const noexcept { return requests_; }
  /// After `at` + this no device answers a request that was confirmed at `at`.
  [[nodiscard]] rt::Duration longest() const noexcept;
  /// The same as far as it was learnt.
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
  bool takes_back_ = false;  // what is queued, before it is on the wire
  rt::Duration frame_{0};    // an answer's time on the wire; 0 when the port does not know its bit rate
  rt::Time asked_{};         // confirmation of the last question
  rt::Time last_sent_{};
  rt::Duration first_{};  // from then to when the first answer, or its feedback, was ready
  rt::Time last_{};       // the last answer
  unsigned signs_ = 0;    // frames of both kinds since then
};

}  // namespace berth::discovery
