// Tasks, scopes, mailboxes and turns: laziness, completion through the queue, and cancelling at every wait.
#include "berth/rt/task.hpp"

#include <gtest/gtest.h>
#include <algorithm>
#include <chrono>
#include <functional>
#include <memory>
#include <optional>
#include <vector>

#include "berth/base/result.hpp"
#include "berth/rt/mailbox.hpp"
#include "berth/rt/scope.hpp"
#include "berth/rt/turn.hpp"

using namespace berth;
using rt::Task;
using rt::Time;
using namespace std::chrono_literals;

namespace task_tests {
namespace {

struct Call final : rt::Job {
  explicit Call(std::function<void()> f) : what(std::move(f)) {}
  void run() noexcept override { what(); }
  std::function<void()> what;
};

// Something that lives in a frame; `alive` says how many frames still stand.
struct Guest {
  explicit Guest(int& count) : alive(&count) { ++*alive; }
  Guest(const Guest&) = delete;
  Guest& operator=(const Guest&) = delete;
  ~Guest() { --*alive; }
  int* alive;
};

struct TaskTest : ::testing::Test {
  rt::Executor executor;
  int alive = 0;
  int woken = 0;
  Call waiter{[this] { ++woken; }};
};

Task<int> answer(int& started) {
  ++started;
  co_return 42;
}

TEST_F(TaskTest, StartsOnlyWhenAwaited) {
  int started = 0;
  auto task = answer(started);
  EXPECT_TRUE(task.valid());
  EXPECT_FALSE(task.done());
  executor.advance(Time(1s));
  EXPECT_EQ(started, 0);
  EXPECT_TRUE(task.start(executor, waiter));
  EXPECT_EQ(started, 1);
  EXPECT_TRUE(task.done());
  EXPECT_EQ(task.take(), 42);
  executor.advance(Time(2s));
  EXPECT_EQ(woken, 0) << "a task that was done at once must not post its waiter as well";
}

Task<int> naps(int& alive, rt::Duration nap) {
  Guest guest(alive);
  co_await rt::sleep_for(nap);
  co_return alive;
}

TEST_F(TaskTest, WaiterIsPostedThroughTheQueue) {
  auto task = naps(alive, 5ms);
  EXPECT_FALSE(task.start(executor, waiter));
  EXPECT_EQ(executor.next(), Time(5ms));
  executor.advance(Time(4ms));
  EXPECT_FALSE(task.done());
  executor.advance(Time(5ms));
  EXPECT_TRUE(task.done());
  EXPECT_EQ(woken, 1);
  EXPECT_EQ(task.take(), 1);
  EXPECT_EQ(alive, 0);
}

TEST_F(TaskTest, MoveLeavesNothingBehindAndAssignmentCancels) {
  auto task = naps(alive, 5ms);
  EXPECT_FALSE(task.start(executor, waiter));
  EXPECT_EQ(alive, 1);
  auto other = std::move(task);
  EXPECT_FALSE(task.valid());  // NOLINT(bugprone-use-after-move): that is what is tested
  other = naps(alive, 1ms);
  EXPECT_EQ(alive, 0);
  executor.advance(Time(1s));
  EXPECT_EQ(woken, 0);
}

Task<int> nested(int& alive, int depth) {
  Guest guest(alive);
  if (depth == 0) {
    co_await rt::sleep_for(1ms);
    co_return 1;
  }
  co_await rt::sleep_for(1ms);
  auto below = co_await nested(alive, depth - 1);
  co_await rt::sleep_for(1ms);
  co_return below + 1;
}

TEST_F(TaskTest, TenLevels) {
  auto task = nested(alive, 9);
  EXPECT_FALSE(task.start(executor, waiter));
  executor.advance(Time(18ms));
  EXPECT_FALSE(task.done());
  executor.advance(Time(19ms));
  ASSERT_TRUE(task.done());
  EXPECT_EQ(task.take(), 10);
  EXPECT_EQ(alive, 0);
}

// Each wait of the ten levels is one instant: destroying the task behind any of them must leave nothing.
TEST_F(TaskTest, DestroyedAtEverySuspensionPoint) {
  for (int steps = 0; steps <= 20; ++steps) {
    rt::Executor fresh;
    {
      auto task = nested(alive, 9);
      static_cast<void>(task.start(fresh, waiter));
      for (int i = 0; i < steps; ++i) static_cast<void>(fresh.step(rt::never));
      EXPECT_EQ(task.done(), steps >= 19) << steps;
      if (!task.done()) {
        EXPECT_GT(alive, 0) << steps;
      }
    }
    EXPECT_EQ(alive, 0) << steps;
    waiter.cancel();
    EXPECT_EQ(fresh.next(), std::nullopt) << "something of the task still waits after " << steps;
  }
}

// Also between completion and resumption: the child is done, its parent waits in the ready queue.
TEST_F(TaskTest, DestroyedWhileItsResumptionIsQueued) {
  auto task = std::make_unique<Task<int>>(nested(alive, 3));
  EXPECT_FALSE(task->start(executor, waiter));
  Call killer([&] { task.reset(); });
  executor.at(Time(1ms), killer);  // set behind the task's own timer of this instant: runs before its resumption
  executor.advance(Time(1s));
  EXPECT_EQ(alive, 0);
  EXPECT_EQ(woken, 0);
}

Task<int> nothing() { co_return 1; }
Task<long> counts(int n, std::uintptr_t& low, std::uintptr_t& high) {
  long sum = 0;
  for (int i = 0; i < n; ++i) {
    auto one = co_await nothing();
    sum += one;
    const auto stack = reinterpret_cast<std::uintptr_t>(__builtin_frame_address(0));
    low = std::min(low, stack);
    high = std::max(high, stack);
  }
  co_return sum;
}

TEST_F(TaskTest, AHundredThousandAwaitsDoNotGrowTheStack) {
  std::uintptr_t low = UINTPTR_MAX, high = 0;
  auto task = counts(100'000, low, high);
  EXPECT_TRUE(task.start(executor, waiter));
  EXPECT_EQ(task.take(), 100'000);
  EXPECT_LT(high - low, 4096U);
}

Task<long> counts_sleeping(int n) {
  long sum = 0;
  for (int i = 0; i < n; ++i) {
    co_await rt::sleep_for(1ns);
    auto one = co_await nothing();
    sum += one;
  }
  co_return sum;
}
TEST_F(TaskTest, AHundredThousandWaits) {
  auto task = counts_sleeping(100'000);
  EXPECT_FALSE(task.start(executor, waiter));
  executor.advance(Time(1ms));
  ASSERT_TRUE(task.done());
  EXPECT_EQ(task.take(), 100'000);
}

// Calls finish() inside start(), a second time later, or never.
class Odd final : public rt::Operation<Odd>, private rt::Job {
 public:
  enum Kind { in_start, twice, never_ends };
  explicit Odd(Kind kind) : kind_(kind) {}
  bool start() noexcept {
    if (kind_ == in_start) finish();
    if (kind_ == twice) executor().after(1ms, *this);
    return true;
  }
  int await_resume() noexcept { return ++resumed_; }

 private:
  void run() noexcept override {
    finish();
    finish();
  }
  Kind kind_;
  int resumed_ = 0;
};

Task<int> odd(Odd::Kind kind) {
  Odd operation(kind);
  co_return co_await operation;
}

TEST_F(TaskTest, OperationThatFinishesInItsStart) {
  auto task = odd(Odd::in_start);
  EXPECT_TRUE(task.start(executor, waiter));
  EXPECT_EQ(task.take(), 1);
}
TEST_F(TaskTest, OperationThatFinishesTwiceResumesOnce) {
  auto task = odd(Odd::twice);
  EXPECT_FALSE(task.start(executor, waiter));
  executor.advance(Time(1s));
  EXPECT_EQ(woken, 1);
  EXPECT_EQ(task.take(), 1);
}
TEST_F(TaskTest, OperationWithoutACoroutine) {
  rt::Sleep sleep(rt::Duration(3ms));
  EXPECT_FALSE(sleep.begin(executor, waiter));
  executor.advance(Time(2ms));
  EXPECT_EQ(woken, 0);
  executor.advance(Time(3ms));
  EXPECT_EQ(woken, 1);
}

struct ScopeTest : TaskTest {
  std::vector<int> log;
};

Task<void> writes(int& alive, std::vector<int>& log, int name, rt::Duration nap) {
  Guest guest(alive);
  log.push_back(name);
  co_await rt::sleep_for(nap);
  log.push_back(name + 100);
}

TEST_F(ScopeTest, SpawnStartsThroughTheQueueInOrder) {
  rt::Scope scope(executor);
  scope.spawn(writes(alive, log, 1, 5ms));
  scope.spawn(writes(alive, log, 2, 3ms));
  scope.spawn(Task<void>());
  EXPECT_TRUE(log.empty());
  EXPECT_EQ(scope.running(), 2U);
  executor.advance(Time(1s));
  EXPECT_EQ(log, (std::vector{1, 2, 102, 101}));
  EXPECT_EQ(scope.running(), 0U);
  EXPECT_EQ(alive, 0);
}

TEST_F(ScopeTest, ChildrenNeverOutliveTheirScope) {
  for (int steps = 0; steps < 4; ++steps) {
    rt::Executor fresh;
    {
      rt::Scope scope(fresh);
      for (int i = 0; i < 5; ++i) scope.spawn(writes(alive, log, i, i % 2 == 0 ? 1ms : 2ms));
      for (int i = 0; i < steps; ++i) static_cast<void>(fresh.step(rt::never));
    }
    EXPECT_EQ(alive, 0);
    EXPECT_EQ(fresh.next(), std::nullopt);
  }
}

TEST_F(ScopeTest, NoMoreThanSoManyAtOnceInTheirOrder) {
  rt::Scope scope(executor, 2);
  for (int name = 1; name <= 4; ++name) scope.spawn(writes(alive, log, name, name == 1 ? 5ms : 3ms));
  EXPECT_EQ(scope.running(), 4U);
  executor.advance(Time(4ms));
  EXPECT_EQ(log, (std::vector{1, 2, 102, 3}));
  scope.cancel();  // one that waits, two that run
  EXPECT_EQ(alive, 0);
  EXPECT_EQ(scope.running(), 0U);
  log.clear();
  for (int name = 5; name <= 7; ++name) scope.spawn(writes(alive, log, name, 2ms));
  executor.advance(Time(1s));
  EXPECT_EQ(log, (std::vector{5, 6, 105, 106, 7, 107}));
  EXPECT_EQ(alive, 0);
}

TEST_F(ScopeTest, CancelDestroysAllAndTheScopeIsUsableAgain) {
  rt::Scope scope(executor);
  scope.spawn(writes(alive, log, 1, 5ms));
  executor.advance(Time(1ms));
  scope.spawn(writes(alive, log, 2, 5ms));
  scope.cancel();
  EXPECT_EQ(scope.running(), 0U);
  EXPECT_EQ(alive, 0);
  scope.spawn(writes(alive, log, 3, 5ms));
  executor.advance(Time(1s));
  EXPECT_EQ(log, (std::vector{1, 3, 103}));
}

Task<void> waits_for_all(rt::Scope& scope, std::vector<int>& log) {
  co_await scope.join();
  log.push_back(1000);
}

TEST_F(ScopeTest, JoinWaitsForTheLastChild) {
  rt::Scope outer(executor);
  rt::Scope scope(executor);
  scope.spawn(writes(alive, log, 1, 5ms));
  scope.spawn(writes(alive, log, 2, 9ms));
  outer.spawn(waits_for_all(scope, log));
  executor.advance(Time(8ms));
  EXPECT_EQ(log, (std::vector{1, 2, 101}));
  executor.advance(Time(9ms));
  EXPECT_EQ(log, (std::vector{1, 2, 101, 102, 1000}));
}

TEST_F(ScopeTest, JoinOfAnEmptyScopeAndOfACancelledOne) {
  rt::Scope outer(executor);
  rt::Scope scope(executor);
  outer.spawn(waits_for_all(scope, log));
  executor.advance(Time(1ms));
  EXPECT_EQ(log, std::vector{1000});
  scope.spawn(writes(alive, log, 1, 1s));
  outer.spawn(waits_for_all(scope, log));
  executor.advance(Time(2ms));
  scope.cancel();
  executor.advance(Time(3ms));
  EXPECT_EQ(log, (std::vector{1000, 1, 1000}));
}

TEST_F(ScopeTest, JoinerOutlivesTheScope) {
  rt::Scope outer(executor);
  auto scope = std::make_unique<rt::Scope>(executor);
  scope->spawn(writes(alive, log, 1, 1s));
  outer.spawn(waits_for_all(*scope, log));
  executor.advance(Time(1ms));
  scope.reset();
  executor.advance(Time(2ms));
  EXPECT_EQ(log, (std::vector{1, 1000}));
}

TEST_F(ScopeTest, JoinerIsDestroyedBeforeTheScope) {
  rt::Scope scope(executor);
  {
    rt::Scope outer(executor);
    scope.spawn(writes(alive, log, 1, 1ms));
    outer.spawn(waits_for_all(scope, log));
    executor.advance(Time(10us));
  }
  executor.advance(Time(1s));
  EXPECT_EQ(log, (std::vector{1, 101}));
}

Task<void> spawns(rt::Scope& scope, int& alive, std::vector<int>& log, int left) {
  Guest guest(alive);
  log.push_back(left);
  if (left > 0) scope.spawn(spawns(scope, alive, log, left - 1));
  co_return;
}
TEST_F(ScopeTest, AChildSpawnsItsSuccessor) {
  rt::Scope scope(executor);
  scope.spawn(spawns(scope, alive, log, 1000));
  executor.advance(Time{});
  EXPECT_EQ(log.size(), 1001U);
  EXPECT_EQ(alive, 0);
}

struct MailboxTest : TaskTest {
  rt::Mailbox<int, 3> box{executor};
  std::vector<std::pair<int, Time>> log;  // -1: the deadline came
};

Task<void> reads(rt::Executor& e, rt::Mailbox<int, 3>& box, std::vector<std::pair<int, Time>>& log,
                 rt::Duration limit) {
  for (;;) {
    auto message = co_await box.next(e.now() + limit);
    log.emplace_back(message.value_or(-1), e.now());
    if (!message) co_return;
  }
}

TEST_F(MailboxTest, FullDropsTheNewestAndCounts) {
  EXPECT_TRUE(box.push(1));
  EXPECT_TRUE(box.push(2));
  EXPECT_TRUE(box.push(3));
  EXPECT_FALSE(box.push(4));
  EXPECT_FALSE(box.push(5));
  EXPECT_EQ(box.dropped(), 2U);
  EXPECT_EQ(box.pop(), 1);
  EXPECT_TRUE(box.push(6));
  EXPECT_EQ(box.size(), 3U);
  EXPECT_EQ(box.pop(), 2);
  EXPECT_EQ(box.pop(), 3);
  EXPECT_EQ(box.pop(), 6);
  EXPECT_EQ(box.pop(), std::nullopt);
  box.push(7);
  box.clear();
  EXPECT_EQ(box.pop(), std::nullopt);
}

TEST_F(MailboxTest, ReaderGetsWhatWasThereWhatComesAndThenTheDeadline) {
  box.push(1);
  rt::Scope scope(executor);
  scope.spawn(reads(executor, box, log, 10ms));
  Call sender([&] {
    EXPECT_TRUE(box.push(2));
    EXPECT_TRUE(box.push(3));
  });
  executor.at(Time(4ms), sender);
  executor.advance(Time(1s));
  EXPECT_EQ(log, (std::vector<std::pair<int, Time>>{{1, Time{}}, {2, Time(4ms)}, {3, Time(4ms)}, {-1, Time(14ms)}}));
  EXPECT_EQ(scope.running(), 0U);
}

TEST_F(MailboxTest, AMessageOfTheDeadlinesInstantIsNotLost) {
  rt::Scope scope(executor);
  Call sender([&] { EXPECT_TRUE(box.push(2)); });
  executor.at(Time(10ms), sender);
  scope.spawn(reads(executor, box, log, 10ms));
  executor.advance(Time(15ms));
  ASSERT_GE(log.size(), 1U);
  EXPECT_EQ(log[0], std::pair(2, Time(10ms)));
}

TEST_F(MailboxTest, NoDeadlineWaitsForEver) {
  auto box_reader = [](rt::Mailbox<int, 3>& b, int& got) -> Task<void> {
    auto message = co_await b.next(rt::never);
    got = *message;
  };
  int got = 0;
  rt::Scope scope(executor);
  scope.spawn(box_reader(box, got));
  executor.advance(Time(std::chrono::hours(24 * 365)));
  EXPECT_EQ(executor.next(), std::nullopt);
  box.push(5);
  executor.advance(executor.now());
  EXPECT_EQ(got, 5);
}

TEST_F(MailboxTest, ReaderDestroyedWhileItWaitsAndWhileItIsWoken) {
  {
    rt::Scope scope(executor);
    scope.spawn(reads(executor, box, log, 10ms));
    executor.advance(Time(1ms));
  }
  EXPECT_EQ(executor.next(), std::nullopt);
  EXPECT_TRUE(box.push(1));
  {
    rt::Scope scope(executor);
    scope.spawn(reads(executor, box, log, 10ms));
    executor.advance(Time(2ms));
    EXPECT_TRUE(box.push(2));  // its resumption is queued now
  }
  executor.advance(Time(1s));
  EXPECT_EQ(log, (std::vector<std::pair<int, Time>>{{1, Time(1ms)}}));
  EXPECT_EQ(box.pop(), 2) << "nobody read it";
}

struct TurnTest : TaskTest {
  rt::Turn turn;
  std::vector<int> log;
};

Task<void> takes(rt::Turn& turn, std::vector<int>& log, int name) {
  co_await turn.take();
  rt::Held held(turn);
  log.push_back(name);
  co_await rt::sleep_for(1ms);
  log.push_back(-name);
}

TEST_F(TurnTest, FirstComeFirstServedWithoutInterleaving) {
  rt::Scope scope(executor);
  for (int i = 1; i <= 3; ++i) scope.spawn(takes(turn, log, i));
  executor.advance(Time(1s));
  EXPECT_EQ(log, (std::vector{1, -1, 2, -2, 3, -3}));
  EXPECT_FALSE(turn.taken());
}

// Whoever is cancelled, at whatever instant, the others get their turn.
TEST_F(TurnTest, ACancelledWaiterOrHolderPassesItOn) {
  for (int victim = 0; victim < 4; ++victim) {
    for (int when = 0; when < 5; ++when) {
      log.clear();
      rt::Executor fresh;
      std::vector<std::unique_ptr<rt::Scope>> scopes;
      for (int i = 1; i <= 4; ++i) {
        scopes.push_back(std::make_unique<rt::Scope>(fresh));
        scopes.back()->spawn(takes(turn, log, i));
      }
      for (int i = 0; i < when; ++i) static_cast<void>(fresh.step(rt::never));
      scopes[static_cast<std::size_t>(victim)].reset();
      fresh.advance(Time(1s));
      EXPECT_FALSE(turn.taken()) << victim << " at " << when;
      for (int i = 1; i <= 4; ++i) {
        if (i != victim + 1) {
          EXPECT_EQ(std::ranges::count(log, -i), 1) << i << " of " << victim << " at " << when;
        }
      }
    }
  }
}

TEST_F(TurnTest, DestroyedBetweenGrantAndResumption) {
  rt::Scope first(executor);
  auto second = std::make_unique<rt::Scope>(executor);
  rt::Scope third(executor);
  first.spawn(takes(turn, log, 1));
  second->spawn(takes(turn, log, 2));
  third.spawn(takes(turn, log, 3));
  executor.advance(Time(500us));
  first.cancel();  // grants it to the second, whose resumption is queued
  second.reset();  // which must hand it on
  executor.advance(Time(1s));
  EXPECT_EQ(log, (std::vector{1, 3, -3}));
  EXPECT_FALSE(turn.taken());
}

}  // namespace
}  // namespace task_tests
