/// The questions of a walk, each about some bits of the current part of the address, and what their answers say about
/// that place. Internal to `discovery`.
#pragma once

#include <vector>

#include "berth/discovery/asker.hpp"
#include "berth/discovery/walk_way.hpp"

namespace berth::discovery::walk {

class Questions {
 public:
  /// All must outlive it. The options' observer (may be null) decides whether the walk goes on. `heard_feedback`
  /// becomes true with the first feedback.
  Questions(Asker& asker, const Options& options, bool& heard_feedback) noexcept
      : asker_(asker), observer_(options.observer), slice_(options.slice), heard_feedback_(heard_feedback) {}

  /// 80h: every device is at the first part again.
  rt::Task<Heard> start();
  /// One question; not sent (`Heard::sent`) if the one before is answered late.
  rt::Task<Heard> ask_once(Prefix at, unsigned next, Wait wait);
  rt::Task<Heard> ask(Prefix at, unsigned next, Wait wait);
  /// Every device whose part is `value` moves on; the part after it becomes the current one.
  rt::Task<bool> enter(std::uint32_t value);

  /// The next question is not below the last one.
  void elsewhere() noexcept;
  /// So many consecutive questions, each below the one before, got one answer that only one device is left there.
  [[nodiscard]] bool one_only() const noexcept { return alone_ >= 4; }
  /// No device entered, but the question before it was answered.
  [[nodiscard]] bool overtaken() const noexcept { return overtaken_; }
  /// Answers to the message that moved devices on to this part.
  [[nodiscard]] unsigned entered_answers() const noexcept { return entered_answers_; }
  /// Children heard below the place asked last.
  [[nodiscard]] std::vector<Prefix>& children() noexcept { return children_; }
  [[nodiscard]] Frontier& frontier() noexcept { return frontier_; }
  [[nodiscard]] Way& way() noexcept { return way_; }
  [[nodiscard]] Asker& asker() noexcept { return asker_; }

  /// Ignores feedback: it has led nowhere or says nothing, and hides devices that send none.
  void go_by_bits(bool on) noexcept { by_bits_ = on; }
  /// As `Asker::be_patient`. `doubtful` false: not for the following questions, until it is called again.
  void be_patient(bool patient, bool wholly) noexcept;
  void be_patient_where(bool doubtful) noexcept { asker_.be_patient(patient_ && doubtful, wholly_ && doubtful); }

  /// The bus failed, or the observer ended the walk: no more questions are sent.
  [[nodiscard]] bool is_broken() const noexcept { return broken_; }
  void broken(Error error) noexcept;
  /// The observer ended it: no error.
  [[nodiscard]] bool stopped() const noexcept { return stopped_; }
  [[nodiscard]] const Error& error() const noexcept { return error_; }

  /// The walk pauses after `Options::slice` questions.
  [[nodiscard]] bool is_in_slices() const noexcept { return slice_ > 0; }
  [[nodiscard]] bool is_last_of_slice() const noexcept { return slice_ > 0 && asker_.requests() + 1 >= slice_; }
  /// Call it where a walk can continue later: ends the walk, as the observer does, after enough questions.
  void end_slice() noexcept;

 private:
  bool stops() noexcept;
  void count(const Heard& heard) noexcept;
  void take_feedback(const std::vector<lss::FeedbackValue>& heard, unsigned sub, Prefix at, std::vector<Prefix>& to);

  Asker& asker_;
  Observer* observer_;
  unsigned slice_;
  bool& heard_feedback_;
  Way way_;
  Frontier frontier_;
  std::vector<Prefix> children_;
  Prefix asked_{};  // the last question's place; its feedback is about places below
  unsigned asked_sub_ = 0;
  unsigned alone_ = 0;
  bool below_ = false;  // the last question was below the one before
  bool overtaken_ = false;
  unsigned entered_answers_ = 0;
  bool by_bits_ = false;
  bool patient_ = false;
  bool wholly_ = false;
  bool broken_ = false;
  bool stopped_ = false;
  Error error_{};
};

}  // namespace berth::discovery::walk
