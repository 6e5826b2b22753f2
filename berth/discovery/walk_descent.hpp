/// The way down from one place of a part to one whole number. Internal to `discovery`.
#pragma once

#include <vector>

#include "berth/discovery/walk_questions.hpp"

namespace berth::discovery::walk {

class Descent {
 public:
  explicit Descent(Questions& questions) noexcept : q_(questions) {}

  /// From here on: `at` has answered, or is the whole part.
  void begin(Prefix at);
  /// Down to one whole number, `leaf`. A device is below `at`. False: none was found there.
  rt::Task<bool> down(Prefix at, unsigned answers);
  [[nodiscard]] Prefix leaf() const noexcept { return leaf_; }
  /// Every device with that number moves on.
  rt::Task<bool> enter_leaf();
  /// No device is on this path any more, or none ever was: up to the deepest place that still answers, and patiently
  /// from there. False: none does, or this was done often enough.
  rt::Task<bool> back();
  [[nodiscard]] Prefix deepest() const { return anchors_.back(); }

 private:
  rt::Task<bool> down_feedback(Prefix& at);
  void step_aside(Prefix& at);

  Questions& q_;
  std::vector<Prefix> anchors_;  // on the path, each was answered
  Prefix leaf_{};
  unsigned careful_ = 0;  // so many steps down with the longest window
  unsigned backs_ = 0;
};

}  // namespace berth::discovery::walk
