#include "berth/lss/answer_queue.hpp"

namespace berth::lss {

void AnswerQueue::send(const Answers& answers) noexcept {
  drop();
  if (!answers) return;
  if (!answers.feedback()) {
    dispatcher_->send(*answers);
    return;
  }
  answer_ = *answers;
  if (dispatcher_->send(*answers.feedback(), *this) == can::Queued::yes) dispatcher_->executor().after(longest, *this);
}

void AnswerQueue::sent(rt::Time) noexcept {
  cancel();
  dispatcher_->send(answer_);
}

void AnswerQueue::drop() noexcept {
  cancel();
  dispatcher_->withdraw(*this);
}

}  // namespace berth::lss
