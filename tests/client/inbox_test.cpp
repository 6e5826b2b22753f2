// The queue that applications wait at.
#include <gtest/gtest.h>
#include <chrono>
#include <optional>
#include <vector>

#include "../pch.hpp"
#include "berth/client/inbox.hpp"
#include "berth/rt/scope.hpp"

namespace berth::client::test {
namespace {

using namespace std::chrono_literals;

struct Taken {
  std::vector<int> values;
  std::optional<Errc> end;
};

rt::Task<void> take_all(Inbox<int>& box, rt::Time deadline, Taken& taken) {
  for (;;) {
    const auto value = co_await box.next(deadline);
    if (!value) {
      taken.end = value.error().code;
      co_return;
    }
    taken.values.push_back(*value);
  }
}

TEST(ClientInbox, ValuesInTheirOrderThenTheDeadline) {
  rt::Executor executor;
  rt::Scope scope(executor);
  Inbox<int> box(4);
  Taken taken;
  scope.spawn(take_all(box, rt::Time(10ms), taken));
  executor.advance(rt::Time(1ms));
  box.push(1);
  box.push(2);
  EXPECT_TRUE(taken.values.empty()) << "nobody resumes inside push";
  executor.advance(rt::Time(2ms));
  EXPECT_EQ(taken.values, (std::vector{1, 2}));
  executor.advance(rt::Time(10ms));
  EXPECT_EQ(taken.end, Errc::timeout);
}

TEST(ClientInbox, TheNewestStay) {
  rt::Executor executor;
  rt::Scope scope(executor);
  Inbox<int> box(3);
  for (int i = 0; i < 5; ++i) box.push(i);
  EXPECT_EQ(box.dropped(), 2U);
  Taken taken;
  scope.spawn(take_all(box, rt::Time(1ms), taken));
  executor.advance(rt::Time(2ms));
  EXPECT_EQ(taken.values, (std::vector{2, 3, 4}));
}

TEST(ClientInbox, ASecondReaderIsToldSo) {
  rt::Executor executor;
  rt::Scope scope(executor);
  Inbox<int> box(3);
  Taken first;
  Taken second;
  scope.spawn(take_all(box, rt::never, first));
  executor.advance(rt::Time(1ms));
  scope.spawn(take_all(box, rt::never, second));
  executor.advance(rt::Time(2ms));
  EXPECT_EQ(second.end, Errc::invalid);
  box.push(1);
  executor.advance(rt::Time(3ms));
  EXPECT_EQ(first.values, std::vector{1});
}

TEST(ClientInbox, ClosedOrDestroyedWhileSomebodyWaits) {
  rt::Executor executor;
  rt::Scope scope(executor);
  for (const bool close : {true, false}) {
    for (const bool pushed : {true, false}) {
      auto box = std::make_unique<Inbox<int>>(3);
      Taken taken;
      scope.spawn(take_all(*box, executor.now() + 1s, taken));
      executor.advance(executor.now() + 1ms);
      if (pushed) box->push(7);
      if (close) {
        box->close();
        executor.advance(executor.now() + 1ms);
        EXPECT_EQ(taken.values, pushed ? std::vector{7} : std::vector<int>{});
      } else {
        box.reset();
        executor.advance(executor.now() + 1ms);
      }
      EXPECT_EQ(taken.end, Errc::cancelled);
      executor.advance(executor.now() + 2s);
      EXPECT_EQ(scope.running(), 0U);
    }
  }
}

TEST(ClientInbox, AReaderDestroyedBetweenItsWakingAndItsResumption) {
  rt::Executor executor;
  Inbox<int> box(3);
  {
    rt::Scope scope(executor);
    Taken taken;
    scope.spawn(take_all(box, rt::never, taken));
    executor.advance(rt::Time(1ms));
    box.push(1);
    scope.cancel();
    executor.advance(rt::Time(2ms));
    EXPECT_TRUE(taken.values.empty());
  }
  EXPECT_EQ(box.size(), 1U) << "the message is not lost";
}

}  // namespace
}  // namespace berth::client::test
