/// The descent from one place of a part to one whole number. Internal to `discovery`.
#pragma once

#include <vector>

#include "berth/discovery/walk_questions.hpp"

namespace berth::discovery::walk {

class Descent {
 public:
  explicit Descent(Questions& questions) noexcept : q_(questions) {}

  /// Starts here: `at` has answered, or is the whole part.
  void begin(Prefix at);
  /// Descends to one whole number, `leaf`. A device is below `at`. False: none was found there.
  rt::Task<bool> down(Prefix at, unsigned answers);
  [[nodiscard]] Prefix leaf() const noexcept { return leaf_; }
  /// Every device with that number moves on.
  rt::Task<bool> enter_leaf();
  /// No device is on this path any more, or none ever was: goes up to the deepest place that still answers, and
  /// continues patiently from there. False: none answers, or this was done too often.
  rt::Task<bool> back();
  [[nodiscard]] Prefix deepest() const { return anchors_.back(); }

 private:
  rt::Task<bool> down_feedback(Prefix& at);
  void step_aside(Prefix& at);

  Questions& q_;
  std::vector<Prefix> anchors_;  // answered places on the path
  Prefix leaf_{};
  unsigned careful_ = 0;  // remaining steps with the longest window
  unsigned backs_ = 0;
};

}  // namespace berth::discovery::walk
