/// Owns tasks that run side by side. Children never outlive their scope.
#pragma once

#include "berth/rt/task.hpp"

namespace berth::rt {

class Scope {
 public:
  /// `most`: at most so many children run at once; the others wait, in the order of `spawn`.
  explicit Scope(Executor& executor, std::size_t most = static_cast<std::size_t>(-1)) noexcept
      : executor_(&executor), most_(most) {}
  ~Scope() { cancel(); }
  Scope(const Scope&) = delete;
  Scope& operator=(const Scope&) = delete;

  /// Starts `task` through the executor's queue. It is destroyed when it ends, or with the scope. An empty task is
  /// ignored.
  void spawn(Task<void> task);
  /// Destroys every child. Not from inside a child.
  void cancel() noexcept;
  /// Children that have not ended, including waiting ones.
  [[nodiscard]] std::size_t running() const noexcept { return running_; }
  [[nodiscard]] Executor& executor() const noexcept { return *executor_; }

  /// `co_await scope.join();` waits until no child runs.
  class Join final : public Operation<Join> {
   public:
    explicit Join(Scope& scope) noexcept : scope_(&scope) {}
    ~Join() {
      if (scope_ != nullptr && scope_->join_ == this) scope_->join_ = nullptr;
    }
    bool start() noexcept {
      if (scope_->running_ == 0) return false;
      scope_->join_ = this;
      return true;
    }
    void await_resume() const noexcept {}

   private:
    friend class Scope;
    Scope* scope_;  // null after the scope's call: the scope may be destroyed by then
  };
  /// One joiner at a time.
  [[nodiscard]] Join join() noexcept { return Join(*this); }

 private:
  class Child final : public Job {
   public:
    Child(Scope& scope, Task<void> task) noexcept : scope_(scope), task_(std::move(task)) {}
    void run() noexcept override;
    Scope& scope_;
    Task<void> task_;
    bool started_ = false;
    Child* previous_ = nullptr;
    Child* next_ = nullptr;
    Child* behind_ = nullptr;  // waits behind this one
  };
  void remove(Child& child) noexcept;

  Executor* executor_;
  std::size_t most_;
  std::size_t at_once_ = 0;
  Child* first_ = nullptr;
  Child* next_turn_ = nullptr;
  Child* last_turn_ = nullptr;
  std::size_t running_ = 0;
  Join* join_ = nullptr;
};

/// For `Scope::spawn`: runs `task`, then sets `done` and posts `then`. All must stay.
[[nodiscard]] Task<void> told(Task<void> task, bool& done, Executor& executor, Job& then);

}  // namespace berth::rt
