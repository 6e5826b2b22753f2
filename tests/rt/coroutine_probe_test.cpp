// The patterns of docs/coroutines.md on this compiler: every value arrives, and every object with a destructor is
// constructed and destroyed exactly once. g++ 12 breaks such things silently in the forms that the rules forbid.
#include <gtest/gtest.h>
#include <chrono>
#include <string>
#include <vector>

#include "probe.hpp"

using namespace probe;

namespace {

// Runs a procedure to its end in one scope, with and without real waits, and looks at the count afterwards.
class Probe : public ::testing::TestWithParam<rt::Duration> {
 protected:
  void SetUp() override { Counted::alive = Counted::made = Counted::errors = 0; }
  void run(Task<void> task) {
    {
      rt::Scope scope(executor);
      scope.spawn(std::move(task));
      executor.advance(executor.now() + 10s);
      EXPECT_EQ(scope.running(), 0U) << "the procedure hangs";
    }
    EXPECT_EQ(Counted::alive, 0) << "constructed and not destroyed, or destroyed twice";
    EXPECT_EQ(Counted::errors, 0) << "an object that was never constructed was used";
    EXPECT_GT(Counted::made, 0) << "the probe probed nothing";
  }
  rt::Executor executor;
  Client client{GetParam()};
};

Task<void> plain_statement(Client& c, int& done) {
  co_await c.give(1);
  co_await c.task(2);
  co_await c.result(3);
  ++done;
}
TEST_P(Probe, AwaitAsAStatementDropsTheValue) {
  int done = 0;
  run(plain_statement(client, done));
  EXPECT_EQ(done, 1);
}

Task<void> declarations(Client& c, std::vector<int>& seen) {
  auto a = co_await c.give(1);
  const auto b = co_await c.task(2);
  Counted d = co_await c.give(3);
  auto r = co_await c.result(4);
  auto bad = co_await c.result(-5);
  seen = {a.value, b.value, d.value, r->value, bad ? 0 : static_cast<int>(bad.error().code)};
}
TEST_P(Probe, DeclarationFromAnAwait) {
  std::vector<int> seen;
  run(declarations(client, seen));
  EXPECT_EQ(seen, (std::vector<int>{1, 2, 3, 4, static_cast<int>(Errc::invalid)}));
}

Task<void> assignments(Client& c, std::vector<int>& seen) {
  Counted v(0);
  v = co_await c.task(1);
  Result<Counted> r = fail(Errc::invalid, "");
  r = co_await c.result(2);
  seen = {v.value, r->value};
  r = co_await c.result(-2);
  seen.push_back(r ? 1 : 0);
}
TEST_P(Probe, AssignmentToAName) {
  std::vector<int> seen;
  run(assignments(client, seen));
  EXPECT_EQ(seen, (std::vector<int>{1, 2, 0}));
}

Task<Counted> pass_on(Client& c, int v) { co_return co_await c.task(v); }
Task<Result<Counted>> pass_on_result(Client& c, int v) { co_return co_await c.result(v); }
Task<void> returned(Client& c, std::vector<int>& seen) {
  auto a = co_await pass_on(c, 1);
  auto b = co_await pass_on_result(c, 2);
  auto d = co_await pass_on_result(c, -3);
  seen = {a.value, b->value, d ? 1 : 0};
}
TEST_P(Probe, ReturnOfAnAwait) {
  std::vector<int> seen;
  run(returned(client, seen));
  EXPECT_EQ(seen, (std::vector<int>{1, 2, 0}));
}

Task<void> named_task(Client& c, std::vector<int>& seen) {
  auto first = c.task(1);
  auto second = c.task(2);
  auto b = co_await second;
  auto a = co_await first;
  auto moved = c.task(3);
  auto d = co_await std::move(moved);
  seen = {a.value, b.value, d.value};
}
TEST_P(Probe, TaskThatHasAName) {
  std::vector<int> seen;
  run(named_task(client, seen));
  EXPECT_EQ(seen, (std::vector<int>{1, 2, 3}));
}

Task<void> named_operation(Client& c, std::vector<int>& seen) {
  Give give(7, c.delay);
  auto a = co_await give;
  seen = {a.value};
}
TEST_P(Probe, OperationThatHasAName) {
  std::vector<int> seen;
  run(named_operation(client, seen));
  EXPECT_EQ(seen, (std::vector<int>{7}));
}

Task<void> behind_heads(Client& c, std::vector<int>& seen) {
  for (int i = 0; i < 5; ++i) {
    if (i == 1) continue;
    const int ask = i == 3 ? -1 : i;
    auto got = co_await c.result(ask);
    if (!got) {
      seen.push_back(-1);
      continue;
    }
    if (got->value == 2) co_await c.give(100);
    switch (got->value) {
      case 4: {
        auto more = co_await c.task(40);
        seen.push_back(more.value);
        break;
      }
      default: seen.push_back(got->value);
    }
  }
  while (seen.size() < 6) {
    auto got = co_await c.task(9);
    seen.push_back(got.value);
  }
}
TEST_P(Probe, InLoopsAndBranchesButNotInTheirHeads) {
  std::vector<int> seen;
  run(behind_heads(client, seen));
  EXPECT_EQ(seen, (std::vector<int>{0, 2, -1, 40, 9, 9}));
}

Task<Result<int>> leaves_early(Client& c, int at, Counted held) {
  Counted local(50);
  for (int i = 0; i < 10; ++i) {
    Counted inner(i);
    const int ask = i == at ? -1 : i;
    auto got = co_await c.result(ask);
    if (!got) co_return fail(got.error());
    if (got->value != inner.value) co_return -1;
  }
  co_return held.value + local.value;
}
Task<void> early(Client& c, std::vector<int>& seen) {
  for (const int at : {0, 4, 9, 99}) {
    Counted held(at);
    auto task = leaves_early(c, at, held);  // a parameter with a destructor: from a name, and the call has a name
    auto got = co_await task;
    seen.push_back(got ? *got : -static_cast<int>(got.error().code));
  }
}
TEST_P(Probe, EarlyReturnDestroysEachLocalOnce) {
  std::vector<int> seen;
  run(early(client, seen));
  const int invalid = -static_cast<int>(Errc::invalid);
  EXPECT_EQ(seen, (std::vector<int>{invalid, invalid, invalid, 149}));
}

Task<int> by_value(Client& c, Counted a, std::string text, std::unique_ptr<Counted> owned) {
  co_await c.give(0);
  co_return a.value + static_cast<int>(text.size()) + owned->value;
}
Task<void> parameters(Client& c, int& sum) {
  Counted a(1);
  std::string text(1000, 'x');
  auto owned = std::make_unique<Counted>(10'000);
  auto task = by_value(c, a, text, std::move(owned));
  sum = 0;
  auto got = co_await task;
  sum = got + a.value + static_cast<int>(text.size());
}
TEST_P(Probe, ParametersByValueFromNames) {
  int sum = 0;
  run(parameters(client, sum));
  EXPECT_EQ(sum, 12'002);
}

Task<void> never_started(Client& c, int& done) {
  {
    Counted a(1);
    auto task = leaves_early(c, 0, a);
    static_cast<void>(task);
  }
  ++done;
  co_return;
}
TEST_P(Probe, TaskThatIsNeverStartedDropsItsParameters) {
  int done = 0;
  run(never_started(client, done));
  EXPECT_EQ(done, 1);
}

Task<void> strings_and_lists(Client& c, std::vector<std::string>& seen) {
  const std::string prefix(100, 'p');
  auto a = co_await c.text(prefix, 7);
  auto b = co_await c.text(prefix, -7);
  auto l = co_await c.list(20);
  int sum = 0;
  for (const auto& item : *l) sum += item.value;
  seen = {*a, b ? "?" : b.error().text, std::to_string(sum)};
}
TEST_P(Probe, ResultsOfStringsAndVectors) {
  std::vector<std::string> seen;
  run(strings_and_lists(client, seen));
  EXPECT_EQ(seen, (std::vector<std::string>{std::string(100, 'p') + "7", "negative", "190"}));
}

Task<void> void_results(Client& c, std::vector<bool>& seen) {
  auto a = co_await c.check(1);
  auto b = co_await c.check(-1);
  seen = {a.has_value(), b.has_value()};
}
TEST_P(Probe, ResultOfVoid) {
  std::vector<bool> seen;
  run(void_results(client, seen));
  EXPECT_EQ(seen, (std::vector<bool>{true, false}));
}

Task<void> sleeps(rt::Executor& e, Client& c, std::vector<rt::Time>& seen) {
  co_await c.give(1);
  const auto start = e.now();
  co_await rt::sleep_for(10ms);
  seen.push_back(rt::Time(e.now() - start));
  co_await rt::sleep_for(std::chrono::milliseconds(5));
  seen.push_back(rt::Time(e.now() - start));
  co_await rt::sleep_until(start + 40ms);
  seen.push_back(rt::Time(e.now() - start));
  if (seen.size() == 3) co_await rt::sleep_for(1us);
  seen.push_back(rt::Time(e.now() - start));
}
TEST_P(Probe, SleepsWithTrivialTemporaries) {
  std::vector<rt::Time> seen;
  run(sleeps(executor, client, seen));
  EXPECT_EQ(seen, (std::vector<rt::Time>{rt::Time(10ms), rt::Time(15ms), rt::Time(40ms), rt::Time(40ms + 1us)}));
}

Task<void> reads(rt::Executor& e, rt::Mailbox<std::shared_ptr<Counted>, 4>& box, std::vector<int>& seen) {
  for (;;) {
    auto message = co_await box.next(e.now() + 1s);
    if (!message) co_return;
    const auto& counted = **message;
    seen.push_back(counted.value);
  }
}
TEST_P(Probe, MessagesWithDestructors) {
  rt::Mailbox<std::shared_ptr<Counted>, 4> box(executor);
  std::vector<int> seen;
  for (int i = 0; i < 3; ++i) ASSERT_TRUE(box.push(std::make_shared<Counted>(i)));
  run(reads(executor, box, seen));
  EXPECT_EQ(seen, (std::vector<int>{0, 1, 2}));
}

Task<void> joins(rt::Executor& e, Client& c, std::vector<int>& seen) {
  rt::Scope scope(e);
  for (int i = 0; i < 3; ++i) {
    Counted held(i);
    // A lambda coroutine without captures: all it uses comes by parameter, because the lambda itself dies at once.
    constexpr auto child = [](Client& client, std::vector<int>& out, Counted h) -> Task<void> {
      auto got = co_await client.task(h.value);
      out.push_back(got.value);
    };
    scope.spawn(child(c, seen, held));
  }
  co_await scope.join();
  seen.push_back(99);
}
TEST_P(Probe, ChildrenOfAScope) {
  std::vector<int> seen;
  run(joins(executor, client, seen));
  EXPECT_EQ(seen, (std::vector<int>{0, 1, 2, 99}));
}

INSTANTIATE_TEST_SUITE_P(Waits, Probe, ::testing::Values(rt::Duration(0ns), rt::Duration(1ms)));

}  // namespace
