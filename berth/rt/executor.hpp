/// The one executor. It has the current time, the jobs that wait for a time and the jobs that are ready; its driver
/// (`sim::World`, `io::Loop`, a fuzzer, a main loop) only calls `next` and `advance`.
///
/// One thread. Jobs are intrusive: queueing one never allocates and never fails, and a destroyed job leaves every queue
/// by itself. No job runs inside another: `post` and timers only queue.
#pragma once

#include <chrono>
#include <cstdint>
#include <optional>

namespace berth::rt {

/// Nanoseconds since the world's beginning; never the wall clock.
using Time = std::chrono::time_point<struct WorldClock, std::chrono::nanoseconds>;
using Duration = std::chrono::nanoseconds;

/// No deadline.
inline constexpr Time never = Time::max();

/// All `node` jobs of an instant run before its `medium` jobs: a bus arbitrates after every node has done its work of
/// that instant. If a medium job makes node jobs ready, they run before the next medium job.
enum class Rank : std::uint8_t { node, medium };

class Executor;

/// Something to run. Belongs to at most one executor at a time; may be ready and have a timer at once.
class Job {
 public:
  /// Called by the executor, never by others. May destroy the job itself.
  virtual void run() noexcept = 0;
  Job(const Job&) = delete;
  Job& operator=(const Job&) = delete;

  /// True while it waits in the ready queue.
  [[nodiscard]] bool ready() const noexcept { return ready_prev_ != nullptr; }
  /// True while it waits for a time.
  [[nodiscard]] bool timed() const noexcept { return timed_; }
  /// When its timer is due; meaningful while `timed()`.
  [[nodiscard]] Time due() const noexcept { return due_; }
  /// Leaves the ready queue and the timers; does nothing when it is in neither.
  void cancel() noexcept {
    if (ready() || timed_) leave();
  }
  /// Leaves the timers only.
  void cancel_timer() noexcept;

 protected:
  Job() = default;
  ~Job() { cancel(); }

 private:
  friend class Executor;
  void leave() noexcept;

  // Ready queue: doubly linked ring.
  Job* ready_prev_ = nullptr;
  Job* ready_next_ = nullptr;
  // Timers: pairing heap, ordered by `key_` and `key_order_`. A timer that was set anew keeps its old place (then
  // `order_` is not `key_order_`) and moves to its correct one when it reaches the root.
  Job* child_ = nullptr;
  Job* sibling_ = nullptr;
  Job* before_ = nullptr;  // previous sibling, or the parent for a first child
  Executor* executor_ = nullptr;
  Time key_{};
  Time due_{};
  std::uint64_t key_order_ = 0;
  std::uint64_t order_ = 0;
  Rank rank_ = Rank::node;  // of the timer
  bool timed_ = false;
};

class Executor {
 public:
  Executor() noexcept;
  ~Executor();
  Executor(const Executor&) = delete;
  Executor& operator=(const Executor&) = delete;

  /// The instant whose jobs are running.
  [[nodiscard]] Time now() const noexcept { return now_; }

  /// Makes `job` ready: it runs after the current job has returned, in the order of posting. Does nothing if it is
  /// ready.
  void post(Job& job, Rank rank = Rank::node) noexcept {
    if (job.ready()) return;
    Job& anchor = rank == Rank::node ? static_cast<Job&>(node_) : medium_;
    link_ready(job, shuffle_ == 0 ? *anchor.ready_prev_ : drawn_place(anchor));
  }

  /// Gives `job` a timer, or moves the existing one. Moving it later is O(1). A time not after `now()` is due at once,
  /// but only after the current job has returned. Equal times fire in the order in which they were set; moving a timer
  /// counts as setting it anew. Due jobs become ready in `rank`.
  void at(Time when, Job& job, Rank rank = Rank::node) noexcept;
  void after(Duration delay, Job& job) noexcept { at(now_ + delay, job); }

  /// Driver: the earliest instant with work, `now()` when jobs are ready, empty when there is nothing to wait for.
  [[nodiscard]] std::optional<Time> next() const noexcept;

  /// Driver: runs all work that is due up to and including `until`, each at its own instant, and leaves `now()` at
  /// `until`. For a time in the past, runs the ready jobs. Must not be called from a job.
  void advance(Time until) noexcept;

  /// Driver: runs the work of one instant, the earliest, if it is not after `until`; false when there is none.
  bool step(Time until) noexcept;

  /// Tests: from the call on the jobs of one instant and phase run in an order drawn from `seed`. This finds code that
  /// wrongly depends on the order of posting.
  void perturb(std::uint64_t seed) noexcept;

  /// Jobs run so far.
  [[nodiscard]] std::uint64_t jobs_run() const noexcept { return jobs_run_; }

 private:
  friend class Job;
  class Anchor final : public Job {
    void run() noexcept override {}
  };
  static bool before(const Job& a, const Job& b) noexcept {
    return a.key_ < b.key_ || (a.key_ == b.key_ && a.key_order_ < b.key_order_);
  }
  static Job* meld(Job* a, Job* b) noexcept;
  static Job* combine(Job* first) noexcept;
  static Job* combine_pairs(Job* first) noexcept;
  void insert(Job& job) noexcept;
  void remove(Job& job) noexcept;
  void settle() noexcept;
  void drop_lazy() noexcept;
  [[nodiscard]] Job& take_root() noexcept;
  void make_due_ready() noexcept;
  bool step_to_timer(Time until) noexcept;
  [[nodiscard]] Job& drawn_place(Job& anchor) noexcept;
  static void link_ready(Job& job, Job& after) noexcept {
    job.ready_prev_ = &after;
    job.ready_next_ = after.ready_next_;
    after.ready_next_->ready_prev_ = &job;
    after.ready_next_ = &job;
  }
  static void unlink_ready(Job& job) noexcept;
  [[nodiscard]] bool has_ready() const noexcept {
    return node_.ready_next_ != &node_ || medium_.ready_next_ != &medium_;
  }
  /// False only if no timer is due: a key is never after its timer's time.
  [[nodiscard]] bool may_be_due() const noexcept { return root_ != nullptr && root_->key_ <= now_; }

  Time now_{};
  std::uint64_t order_ = 0;
  std::uint64_t jobs_run_ = 0;
  std::uint64_t shuffle_ = 0;  // state of the perturbation, 0 = none
  Job* root_ = nullptr;
  Anchor node_;
  Anchor medium_;
};

}  // namespace berth::rt
