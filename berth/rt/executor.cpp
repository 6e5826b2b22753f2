#include "berth/rt/executor.hpp"

#include <cassert>

namespace berth::rt {

namespace {

// With thousands of devices no job is in the processor's caches: the next one is fetched while one runs.
inline void fetch(const Job& job) noexcept {
  const char* const at = reinterpret_cast<const char*>(&job);
  for (int line = -1; line < 4; ++line) __builtin_prefetch(at + 64 * line);
}

}  // namespace

void Job::leave() noexcept {
  if (ready()) Executor::unlink_ready(*this);
  cancel_timer();
}

void Job::cancel_timer() noexcept {
  if (!timed_) return;
  executor_->timers_.remove(timer_);
  timed_ = false;
}

Executor::Executor() {
  for (Job* anchor : {static_cast<Job*>(&node_), static_cast<Job*>(&medium_)}) {
    anchor->ready_prev_ = anchor->ready_next_ = anchor;
  }
}

Executor::~Executor() {
  // Jobs may outlive the executor; they must not reach back into it.
  while (!timers_.empty()) timers_.job().cancel_timer();
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

// One of the last few places: enough to turn any two neighbours round.
Job& Executor::drawn_place(Job& anchor) noexcept {
  shuffle_ = shuffle_ * 6364136223846793005ULL + 1442695040888963407ULL;
  Job* after = anchor.ready_prev_;
  for (auto skip = (shuffle_ >> 60) & 7U; skip > 0 && after != &anchor; --skip) after = after->ready_prev_;
  return *after;
}

void Executor::at(Time when, Job& job, Rank rank) noexcept {
  assert(!job.timed_ || job.executor_ == this);
  if (when < now_) when = now_;
  job.order_ = ++order_;
  job.due_ = when;
  job.rank_ = rank;
  if (job.timed_) {
    if (when >= timers_.time(job.timer_)) return;  // it comes to the front too early, and is put back then
    timers_.remove(job.timer_);
  }
  job.timed_ = true;
  job.executor_ = this;
  job.timer_ = timers_.add(when, job.order_, job);
}

// Puts timers that were set anew where they belong now, until the earliest one is true.
void Executor::drop_lazy() noexcept {
  while (!timers_.empty() && !first_is_true()) {
    const Job& job = timers_.job();
    timers_.move_first(job.due_, job.order_);
  }
}

// The earliest timer, which must be true, is one no longer.
inline Job& Executor::take_first() noexcept {
  Job& job = timers_.job();
  timers_.remove(job.timer_);
  job.timed_ = false;
  return job;
}

std::optional<Time> Executor::next() const noexcept {
  if (has_ready()) return now_;
  const_cast<Executor*>(this)->drop_lazy();  // changes the shape of the heap, not what it says
  if (timers_.empty()) return std::nullopt;
  return timers_.earliest();
}

void Executor::make_due_ready() noexcept {
  while (may_be_due()) {
    if (!first_is_true()) {  // was set anew: it may be due later
      drop_lazy();
      continue;
    }
    Job& job = take_first();
    post(job, job.rank_);
  }
}

void Executor::settle() noexcept {
  if (may_be_due()) make_due_ready();
  for (;;) {
    Job* job = node_.ready_next_;
    if (job != &node_) {
      // A node's job comes before whatever else there is.
    } else if (may_be_due()) {
      make_due_ready();  // timers set for this very instant by the jobs just run
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

// With nothing ready: the work of the earliest timer's instant, if it is not after `until`.
inline bool Executor::step_to_timer(Time until) noexcept {
  if (timers_.earliest() > until || timers_.empty()) return false;
  if (!first_is_true()) drop_lazy();
  if (timers_.earliest() > until) return false;
  if (timers_.earliest() > now_) now_ = timers_.earliest();
  // Most are alone at their instant. Such a one need not go through the ready queue.
  Job& job = take_first();
  if (!timers_.empty()) fetch(timers_.job());
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
