// What the probe of coroutine patterns (coroutine_probe_test.cpp, tools/coroutine-forms) is made of: values that count
// themselves, an operation that waits or not, and a client whose calls give such values in every house form.
#pragma once

#include <chrono>
#include <memory>
#include <string>
#include <utility>
#include <vector>

#include "berth/base/result.hpp"
#include "berth/rt/mailbox.hpp"
#include "berth/rt/scope.hpp"
#include "berth/rt/task.hpp"

namespace probe {

using namespace berth;
using rt::Task;
using namespace std::chrono_literals;

// Counts itself, and knows whether it is what it was made as.
struct Counted {
  static inline int alive = 0;
  static inline int made = 0;
  static inline int errors = 0;
  int value = 0;
  const Counted* self = this;

  explicit Counted(int v) : value(v) { born(); }
  Counted(const Counted& o) : value(o.value) { born(&o); }
  Counted(Counted&& o) noexcept : value(std::exchange(o.value, -1)) { born(&o); }
  Counted& operator=(const Counted& o) {
    check(o);
    value = o.value;
    return *this;
  }
  Counted& operator=(Counted&& o) noexcept {
    check(o);
    value = std::exchange(o.value, -1);
    return *this;
  }
  ~Counted() {
    check(*this);  // destroyed twice, or copied as bytes: `self` is wrong
    self = nullptr;
    --alive;
  }

 private:
  static void check(const Counted& o) {
    if (o.self != &o) ++errors;
  }
  void born(const Counted* from = nullptr) {
    if (from != nullptr) check(*from);
    ++alive;
    ++made;
  }
};

// An operation that ends after a delay, or at once, and gives a value with a destructor.
class Give final : public rt::Operation<Give>, private rt::Job {
 public:
  Give(int value, rt::Duration delay) : value_(value), delay_(delay), witness_(value) {}
  bool start() noexcept {
    if (delay_ == 0ns) return false;
    executor().after(delay_, *this);
    return true;
  }
  Counted await_resume() { return Counted(value_); }

 private:
  void run() noexcept override { finish(); }
  int value_;
  rt::Duration delay_;
  Counted witness_;
};

struct Client {
  rt::Duration delay{};
  Give give(int value) { return Give(value, delay); }
  Task<Counted> task(int value) {
    auto got = co_await give(value);
    co_return got;
  }
  Task<Result<Counted>> result(int value) {
    auto got = co_await give(value);
    if (got.value < 0) co_return fail(Errc::invalid, "negative");
    co_return got;
  }
  Task<Result<void>> check(int value) {
    auto got = co_await result(value);
    if (!got) co_return fail(got.error());
    co_return Result<void>{};
  }
  Task<Result<std::string>> text(const std::string& prefix, int value) {
    auto got = co_await result(value);
    if (!got) co_return fail(got.error());
    std::string out = prefix + std::to_string(got->value);
    co_return out;
  }
  Task<Result<std::vector<Counted>>> list(int n) {
    std::vector<Counted> all;
    for (int i = 0; i < n; ++i) {
      auto got = co_await result(i);
      if (!got) co_return fail(got.error());
      all.push_back(std::move(*got));
    }
    co_return std::move(all);
  }
};

}  // namespace probe
