#include "berth/discovery/walk_descent.hpp"

namespace berth::discovery::walk {

namespace {
constexpr unsigned check_after = 6;  // halves inferred from silence, in a row
constexpr unsigned most_backs = 6;   // returns to an earlier place, for one device
}  // namespace

void Descent::begin(Prefix at) {
  anchors_.assign(1, at);
  careful_ = 0;
  backs_ = 0;
}

rt::Task<bool> Descent::down(Prefix at, unsigned answers) {
  unsigned concluded = 0;
  while (at.bit > 0 && !q_.is_broken()) {
    if (!q_.children().empty()) {
      const bool there = co_await down_feedback(at);
      if (!there) co_return false;
      concluded = 0;
      continue;
    }
    const Prefix zero = at.zero();
    const Wait wait = careful_ > 0 ? Wait::bound : Wait::quick;
    const Heard heard = co_await q_.ask_once(zero, q_.way().sub, wait);
    if (heard.late && concluded > 0) {
      step_aside(at);
      concluded = 0;
      continue;
    }
    if (!heard.sent) continue;
    if (careful_ > 0) --careful_;
    if (heard.yes()) {
      if (answers > 1) q_.frontier().open(at.one(), Open::Why::maybe);
      answers = heard.answers;
      at = zero;
      anchors_.push_back(at);
      concluded = 0;
      continue;
    }
    at = at.one();
    ++concluded;
    if (concluded < check_after || at.bit == 0) continue;
    const Heard check = co_await q_.ask_once(at, q_.way().sub, Wait::bound);
    concluded = 0;
    if (check.late) {
      step_aside(at);
      continue;
    }
    if (check.yes()) {
      anchors_.push_back(at);
      continue;
    }
    const bool again = co_await back();
    if (!again) co_return false;
    at = anchors_.back();
  }
  leaf_ = at;
  co_return !q_.is_broken();
}

// When the walk turned to the upper half, a device in the lower half had answered too late.
void Descent::step_aside(Prefix& at) {
  if (!q_.one_only()) q_.frontier().open(at, Open::Why::maybe);
  at = at.brother();
  anchors_.push_back(at);
  q_.children().clear();
}

// One step by feedback, to the lowest value that was heard. The others are kept for later.
rt::Task<bool> Descent::down_feedback(Prefix& at) {
  const auto children = q_.children();
  for (auto it = children.rbegin(); it != children.rend(); ++it) q_.frontier().open(*it, Open::Why::heard);
  q_.children().clear();
  const bool open = q_.frontier().remove(children.front());
  if (!open) co_return false;  // it was handled when it was heard before
  at = children.front();
  if (at.bit == 0) co_return true;
  Heard heard = co_await q_.ask(at, q_.way().sub, Wait::learnt);
  if (!heard.yes()) heard = co_await q_.ask(at, q_.way().sub, Wait::bound);
  if (heard.yes()) anchors_.push_back(at);
  co_return heard.yes();
}

rt::Task<bool> Descent::back() {
  q_.elsewhere();
  if (++backs_ > most_backs) co_return false;
  careful_ = backs_ > 1 ? 32 : check_after + 2;
  const bool anchored = anchors_.size() > 1;
  while (!anchors_.empty() && !q_.is_broken()) {
    const Prefix at = anchors_.back();
    // Nothing below was ever answered: no device moved on to this part. A late answer was taken for the answer of a
    // device that did.
    if (at.bit == 32) co_return anchored;
    const Heard heard = co_await q_.ask(at, q_.way().sub, Wait::bound);
    if (heard.yes()) co_return true;
    anchors_.pop_back();
  }
  co_return false;
}

// If the question for the lowest bit was answered too late, that bit is 0, and no device has moved on yet.
rt::Task<bool> Descent::enter_leaf() {
  const std::uint32_t value = leaf_.value;
  bool entered = co_await q_.enter(value);
  const bool other = q_.overtaken() && !q_.is_broken();
  if (other) entered = co_await q_.enter(value ^ 1U);
  co_return entered;
}

}  // namespace berth::discovery::walk
