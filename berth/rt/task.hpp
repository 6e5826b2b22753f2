/// Coroutines that compose operations into procedures. Read docs/coroutines.md before writing one: g++ 12 miscompiles
/// several legal forms without a warning, so `co_await` stands only as `co_await x;`, `[auto v =] co_await x;` or
/// `co_return co_await x;`, with `x` a name or one call without temporaries of class type.
///
///     rt::Task<Result<int>> read_twice(Client& client) {
///       auto first = co_await client.read(1);
///       if (!first) co_return fail(first.error());
///       ...
///     }
///
/// A task is lazy: it starts when it is awaited or spawned in a `Scope`. Destroying a task cancels it and all that it
/// awaits. That is safe at any time outside its own body, because nothing resumes inside another call: a completed
/// operation posts its waiter to the executor.
#pragma once

#include <coroutine>
#include <cstddef>
#include <exception>
#include <optional>
#include <utility>

#include "berth/rt/executor.hpp"

namespace berth::rt {

namespace detail {
/// Recycles coroutine frames by size; plain heap in sanitizer builds, where a pool would hide a use after free.
void* allocate_frame(std::size_t size);
void free_frame(void* frame, std::size_t size) noexcept;

/// Common to all promises. As a Job it resumes its coroutine.
class Promise : public Job {
 public:
  void run() noexcept final { handle_.resume(); }
  [[nodiscard]] Executor& executor() const noexcept { return *executor_; }

  static void* operator new(std::size_t size) { return allocate_frame(size); }
  static void operator delete(void* frame, std::size_t size) noexcept { free_frame(frame, size); }

  std::suspend_always initial_suspend() noexcept { return {}; }
  /// An exception is a mistake in the program: procedures report by `Result`.
  [[noreturn]] void unhandled_exception() noexcept { std::terminate(); }

  struct Final {
    bool await_ready() noexcept { return false; }
    template <class P>
    bool await_suspend(std::coroutine_handle<P> self) noexcept {
      Promise& promise = self.promise();
      promise.done_ = true;
      // While the parent is still in its own await_suspend, it sees done_ and continues without a post.
      if (promise.waiter_ != nullptr) promise.executor_->post(*promise.waiter_);
      return true;
    }
    void await_resume() noexcept {}
  };
  Final final_suspend() noexcept { return {}; }

 protected:
  Promise() = default;
  ~Promise() = default;

 private:
  friend struct TaskAccess;
  std::coroutine_handle<> handle_;
  Executor* executor_ = nullptr;
  Job* waiter_ = nullptr;
  bool done_ = false;
};

struct TaskAccess {
  static void prepare(Promise& p, std::coroutine_handle<> h) noexcept { p.handle_ = h; }
  static void start(Promise& p, Executor& executor) noexcept {
    p.executor_ = &executor;
    p.handle_.resume();
  }
  static void wait(Promise& p, Job& waiter) noexcept { p.waiter_ = &waiter; }
  static bool done(const Promise& p) noexcept { return p.done_; }
};

template <class T>
class ValuePromise : public Promise {
 public:
  template <class U>
  void return_value(U&& value) {
    value_.emplace(std::forward<U>(value));
  }
  T take() { return std::move(*value_); }

 private:
  std::optional<T> value_;
};

template <>
class ValuePromise<void> : public Promise {
 public:
  void return_void() noexcept {}
  void take() noexcept {}
};

}  // namespace detail

/// A procedure that gives a `T` when it is done. Move-only, lazy.
template <class T>
class [[nodiscard]] Task {
 public:
  class promise_type final : public detail::ValuePromise<T> {
   public:
    Task get_return_object() noexcept { return Task(std::coroutine_handle<promise_type>::from_promise(*this)); }
  };

  Task() = default;
  Task(Task&& other) noexcept : handle_(std::exchange(other.handle_, {})) {}
  Task& operator=(Task&& other) noexcept {
    if (this != &other) {
      reset();
      handle_ = std::exchange(other.handle_, {});
    }
    return *this;
  }
  ~Task() { reset(); }

  /// Cancels: destroys the frame and everything it awaits. Never from inside the task itself.
  void reset() noexcept {
    if (handle_) std::exchange(handle_, {}).destroy();
  }
  [[nodiscard]] bool valid() const noexcept { return static_cast<bool>(handle_); }
  [[nodiscard]] bool done() const noexcept { return handle_ && detail::TaskAccess::done(handle_.promise()); }

  /// Runs it up to its first wait; `waiter` is posted when it ends later. True when it is done already.
  bool start(Executor& executor, Job& waiter) noexcept {
    detail::TaskAccess::start(handle_.promise(), executor);
    if (detail::TaskAccess::done(handle_.promise())) return true;
    detail::TaskAccess::wait(handle_.promise(), waiter);
    return false;
  }
  /// The value of a task that is done; once.
  T take() { return handle_.promise().take(); }

  // Awaiting: the child runs inside, and the parent suspends only when the child has to wait.
  [[nodiscard]] bool await_ready() const noexcept { return false; }
  template <class P>
  bool await_suspend(std::coroutine_handle<P> parent) noexcept {
    return !start(parent.promise().executor(), parent.promise());
  }
  T await_resume() { return take(); }

 private:
  explicit Task(std::coroutine_handle<promise_type> handle) noexcept : handle_(handle) {
    detail::TaskAccess::prepare(handle.promise(), handle);
  }
  std::coroutine_handle<promise_type> handle_;
};

/// Base of an awaitable operation: an object with a state machine and a deadline instead of a coroutine frame. The
/// derived class implements `bool start()` (false: done at once), calls `finish()` when done (inside `start()` that
/// equals returning false), and returns its result from `await_resume()`. Use as a `Job`, without a coroutine:
/// `begin(executor, job)`.
template <class Derived>
class Operation {
 public:
  Operation(const Operation&) = delete;
  Operation& operator=(const Operation&) = delete;

  [[nodiscard]] bool await_ready() const noexcept { return false; }
  template <class P>
  bool await_suspend(std::coroutine_handle<P> parent) noexcept {
    return !begin(parent.promise().executor(), parent.promise());
  }
  /// Starts it; `waiter` is posted when it ends later. True when it is done already.
  bool begin(Executor& executor, Job& waiter) noexcept {
    executor_ = &executor;
    finished_ = false;
    if (!static_cast<Derived*>(this)->start() || finished_) return true;
    waiter_ = &waiter;
    return false;
  }

 protected:
  Operation() = default;
  ~Operation() = default;
  [[nodiscard]] Executor& executor() const noexcept { return *executor_; }
  /// Wakes the waiter through the executor's queue. Calls after the first do nothing.
  void finish() noexcept {
    finished_ = true;
    if (waiter_ != nullptr) executor_->post(*std::exchange(waiter_, nullptr));
  }

 private:
  Executor* executor_ = nullptr;
  Job* waiter_ = nullptr;
  bool finished_ = false;
};

/// Waits until a time: `co_await rt::sleep_until(when);`, `co_await rt::sleep_for(10ms);`
class Sleep final : public Operation<Sleep>, private Job {
 public:
  explicit Sleep(Time until) noexcept : until_(until) {}
  explicit Sleep(Duration delay) noexcept : delay_(delay), relative_(true) {}
  bool start() noexcept {
    executor().at(relative_ ? executor().now() + delay_ : until_, *this);
    return true;
  }
  void await_resume() const noexcept {}

 private:
  void run() noexcept override { finish(); }
  Time until_{};
  Duration delay_{};
  bool relative_ = false;
};
[[nodiscard]] inline Sleep sleep_until(Time when) noexcept { return Sleep(when); }
[[nodiscard]] inline Sleep sleep_for(Duration delay) noexcept { return Sleep(delay); }

}  // namespace berth::rt
