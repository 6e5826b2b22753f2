#include "berth/rt/executor.hpp"

#include <cassert>

namespace berth::rt {

void Job::leave() noexcept {
  if (ready()) Executor::unlink_ready(*this);
  cancel_timer();
}

void Job::cancel_timer() noexcept {
  if (!timed_) return;
  executor_->remove(*this);
  timed_ = false;
}

Executor::Executor() noexcept {
  for (Job* anchor : {static_cast<Job*>(&node_), static_cast<Job*>(&medium_)}) {
    anchor->ready_prev_ = anchor->ready_next_ = anchor;
  }
}

Executor::~Executor() {
  // Jobs may outlive the executor; they must not reach back into it.
  while (root_ != nullptr) root_->cancel_timer();
  for (Job* anchor : {static_cast<Job*>(&node_), static_cast<Job*>(&medium_)}) {
    while (anchor->ready_next_ != anchor) unlink_ready(*anchor->ready_next_);
    anchor->ready_prev_ = anchor->ready_next_ = nullptr;
  }
}

void Executor::unlink_ready(Job& job) noexcept {
  // NOLINTNEXTLINE(clang-analyzer-core.NullDereference): a job in the ring has neighbours; the analyzer cannot know
  job.ready_prev_->ready_next_ = job.ready_next_;
  job.ready_next_->ready_prev_ = job.ready_prev_;
  job.ready_prev_ = job.ready_next_ = nullptr;
}

// One of the last few places, which is enough to swap any two neighbours.
Job& Executor::drawn_place(Job& anchor) noexcept {
  shuffle_ = shuffle_ * 6364136223846793005ULL + 1442695040888963407ULL;
  Job* after = anchor.ready_prev_;
  for (auto skip = (shuffle_ >> 60) & 7U; skip > 0 && after != &anchor; --skip) after = after->ready_prev_;
  return *after;
}

inline Job* Executor::meld(Job* a, Job* b) noexcept {
  if (a == nullptr) return b;
  if (b == nullptr) return a;
  if (before(*b, *a)) {
    Job* swap = a;
    a = b;
    b = swap;
  }
  b->before_ = a;
  b->sibling_ = a->child_;
  if (a->child_ != nullptr) a->child_->before_ = b;
  a->child_ = b;
  return a;
}

// Two-pass pairing of a list of siblings. `before_` and `sibling_` of a root have no meaning.
inline Job* Executor::combine(Job* first) noexcept {
  return first == nullptr || first->sibling_ == nullptr ? first : combine_pairs(first);
}

Job* Executor::combine_pairs(Job* first) noexcept {
  Job* pairs = nullptr;
  while (first != nullptr) {
    Job* const a = first;
    Job* const b = a->sibling_;
    first = b != nullptr ? b->sibling_ : nullptr;
    Job* const melded = meld(a, b);
    melded->sibling_ = pairs;
    pairs = melded;
  }
  if (pairs == nullptr) return nullptr;
  Job* root = pairs;
  pairs = root->sibling_;
  while (pairs != nullptr) {
    Job* const rest = pairs->sibling_;
    root = meld(root, pairs);
    pairs = rest;
  }
  return root;
}

inline void Executor::insert(Job& job) noexcept {
  job.child_ = job.sibling_ = job.before_ = nullptr;
  job.key_ = job.due_;
  job.key_order_ = job.order_;
  root_ = meld(root_, &job);
}

void Executor::remove(Job& job) noexcept {
  Job* rest = combine(job.child_);
  job.child_ = nullptr;
  if (root_ == &job) {
    root_ = rest;
    return;
  }
  if (job.before_->child_ == &job) {
    job.before_->child_ = job.sibling_;
  } else {
    job.before_->sibling_ = job.sibling_;
  }
  if (job.sibling_ != nullptr) job.sibling_->before_ = job.before_;
  job.sibling_ = job.before_ = nullptr;
  root_ = meld(root_, rest);
}

void Executor::at(Time when, Job& job, Rank rank) noexcept {
  assert(!job.timed_ || job.executor_ == this);
  if (when < now_) when = now_;
  job.order_ = ++order_;
  job.due_ = when;
  job.rank_ = rank;
  if (job.timed_) {
    if (when >= job.key_) return;  // the heap finds it too early and puts it back then
    remove(job);
  }
  job.timed_ = true;
  job.executor_ = this;
  insert(job);
}

// Moves timers that were set anew to their present places, until the earliest one is in its place.
void Executor::drop_lazy() noexcept {
  while (root_ != nullptr && root_->order_ != root_->key_order_) {
    Job& job = *root_;
    root_ = combine(job.child_);
    insert(job);
  }
}

// Takes out the earliest timer, which must be in its place.
inline Job& Executor::take_root() noexcept {
  Job& job = *root_;
  root_ = combine(job.child_);
  job.child_ = nullptr;
  job.timed_ = false;
  return job;
}

std::optional<Time> Executor::next() const noexcept {
  if (has_ready()) return now_;
  const_cast<Executor*>(this)->drop_lazy();  // changes the shape of the heap, not its content
  if (root_ == nullptr) return std::nullopt;
  return root_->due_;
}

void Executor::make_due_ready() noexcept {
  while (may_be_due()) {
    Job& job = *root_;
    if (job.order_ != job.key_order_) {  // was set anew: it may be due later
      drop_lazy();
      continue;
    }
    post(take_root(), job.rank_);
  }
}

void Executor::settle() noexcept {
  if (may_be_due()) make_due_ready();
  for (;;) {
    Job* job = node_.ready_next_;
    if (job != &node_) {
      // A node's job comes before all others.
    } else if (may_be_due()) {
      make_due_ready();  // timers that the jobs just run have set for this very instant
      continue;
    } else if (medium_.ready_next_ != &medium_) {
      job = medium_.ready_next_;
    } else {
      return;
    }
    unlink_ready(*job);
    ++jobs_run_;
    job->run();
  }
}

// Nothing is ready: runs the work at the earliest timer's instant, unless that is after `until`.
inline bool Executor::step_to_timer(Time until) noexcept {
  if (root_ == nullptr) return false;
  if (root_->order_ != root_->key_order_) drop_lazy();
  if (root_->due_ > until) return false;
  if (root_->due_ > now_) now_ = root_->due_;
  // Most timers are alone at their instant. Such a job need not go through the ready queue.
  Job& job = take_root();
  if (may_be_due() || shuffle_ != 0) {
    post(job, job.rank_);
  } else {
    ++jobs_run_;
    job.run();
  }
  settle();
  return true;
}

bool Executor::step(Time until) noexcept {
  if (!has_ready()) return step_to_timer(until);
  if (now_ > until) return false;
  settle();
  return true;
}

void Executor::advance(Time until) noexcept {
  if (until < now_) until = now_;
  if (has_ready()) settle();
  while (step_to_timer(until)) {
  }
  now_ = until;
}

void Executor::perturb(std::uint64_t seed) noexcept { shuffle_ = seed | 1U; }

}  // namespace berth::rt
