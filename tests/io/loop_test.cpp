#include "berth/io/loop.hpp"

#include <gtest/gtest.h>
#include <sys/epoll.h>
#include <sys/time.h>
#include <unistd.h>
#include <chrono>
#include <csignal>
#include <cstdint>
#include <memory>
#include <thread>

#include "berth/io/loop_driver.hpp"
#include "berth/sim/world.hpp"

namespace berth::io {
namespace {

using namespace std::chrono_literals;

class Counter final : public rt::Job {
 public:
  void run() noexcept override { ++runs; }
  int runs = 0;
};

class Pipe final : public Watcher {
 public:
  explicit Pipe(Loop& loop) : loop_(&loop) {
    if (::pipe(ends_) != 0) std::abort();
    loop.watch(ends_[0], *this, EPOLLIN);
  }
  ~Pipe() {
    loop_->forget(ends_[0]);
    ::close(ends_[0]);
    ::close(ends_[1]);
  }
  void put() const { ASSERT_EQ(::write(ends_[1], "x", 1), 1); }
  void ready(std::uint32_t events) noexcept override {
    ++calls;
    seen = events;
    if (job != nullptr) loop_->executor().post(*job);
    if (other != nullptr) loop_->forget(other->ends_[0]);
    if (held != rt::never) loop_->hold(held);
    if (!takes) return;
    char c = 0;
    if (::read(ends_[0], &c, 1) == 1) ++bytes;
  }
  int calls = 0;
  int bytes = 0;
  bool takes = true;
  std::uint32_t seen = 0;
  rt::Job* job = nullptr;
  Pipe* other = nullptr;
  rt::Time held = rt::never;

 private:
  Loop* loop_;
  int ends_[2] = {-1, -1};
};

/// A signal comes after 10 ms, as SIGSTOP and SIGCONT may: behind the wait, the process has no time until 60 ms, and at
/// 20 ms there is something to read. What is read late here was in time.
class HeldUp {
 public:
  explicit HeldUp(const Pipe& pipe) {
    late = &pipe;
    struct sigaction action {};
    action.sa_handler = [](int) {
      ::usleep(10'000);
      late->put();
      ::usleep(40'000);
    };
    ::sigaction(SIGALRM, &action, &before_);
    const itimerval once{.it_interval = {}, .it_value = {.tv_sec = 0, .tv_usec = 10'000}};
    ::setitimer(ITIMER_REAL, &once, nullptr);
  }
  ~HeldUp() { ::sigaction(SIGALRM, &before_, nullptr); }
  HeldUp(const HeldUp&) = delete;
  HeldUp& operator=(const HeldUp&) = delete;

 private:
  inline static const Pipe* late = nullptr;
  struct sigaction before_ {};
};

// The process was held up, and not all that came meanwhile is read: no timer that was due behind it runs.
TEST(Loop, ATurnEndsWhereNotAllIsRead) {
  rt::Executor executor;
  Loop loop(executor);
  Pipe pipe(loop);
  Counter early, late;
  const auto begin = executor.now();
  executor.at(begin + 2ms, early);
  executor.at(begin + 5ms, late);
  pipe.put();
  pipe.put();
  ::usleep(10'000);
  pipe.held = begin + 3ms;
  loop.serve();
  EXPECT_EQ(pipe.bytes, 1);
  EXPECT_EQ(early.runs, 1);
  EXPECT_EQ(late.runs, 0);
  EXPECT_EQ(executor.now(), begin + 3ms);
  pipe.held = rt::never;
  loop.serve();
  EXPECT_EQ(pipe.bytes, 2);
  EXPECT_EQ(late.runs, 1);
}

TEST(Loop, NoTimerRunsBeforeWhatCameWhileASignalHeldTheWaitUpIsRead) {
  rt::Executor executor;
  Loop loop(executor);
  Pipe pipe(loop);
  Counter timer;
  const HeldUp held_up(pipe);
  executor.at(loop.clock() + 40ms, timer);  // behind it, so that the signal comes first however slow this is
  for (int i = 0; i < 100 && pipe.calls == 0; ++i) {
    EXPECT_EQ(timer.runs, 0) << "the pipe could be read 20 ms before the timer was due";
    loop.turn(1s);
  }
  EXPECT_EQ(pipe.bytes, 1);
  EXPECT_GE(executor.now(), rt::Time{} + 20ms);
}

TEST(Loop, TimersComeNotBeforeTheirTimeAndTheClockNeverGoesBack) {
  rt::Executor executor;
  executor.advance(rt::Time{} + 5s);
  Loop loop(executor);
  ASSERT_TRUE(loop.good());
  Counter counter;
  const rt::Time due = executor.now() + 3ms;
  executor.at(due, counter);
  rt::Time last = executor.now();
  for (int i = 0; i < 10'000 && counter.runs == 0; ++i) {
    loop.turn(1s);
    EXPECT_GE(executor.now(), last);
    EXPECT_TRUE(counter.runs == 0 || executor.now() >= due);
    last = executor.now();
  }
  EXPECT_EQ(counter.runs, 1);
}

TEST(Loop, ADescriptorEndsTheSleepAndItsJobRunsInTheSameTurn) {
  rt::Executor executor;
  Loop loop(executor);
  Pipe pipe(loop);
  Counter counter;
  pipe.job = &counter;
  pipe.put();
  loop.turn(1h);  // would not return
  EXPECT_EQ(pipe.calls, 1);
  EXPECT_EQ(counter.runs, 1);
}

TEST(Loop, ItIsLevelTriggered) {
  rt::Executor executor;
  Loop loop(executor);
  Pipe pipe(loop);
  pipe.takes = false;
  pipe.put();
  loop.turn(1h);
  loop.turn(1h);
  EXPECT_EQ(pipe.calls, 2);
  pipe.takes = true;
  loop.turn(1h);
  EXPECT_EQ(pipe.bytes, 1);
  loop.serve();
  EXPECT_EQ(pipe.calls, 3);
}

TEST(Loop, AForgottenDescriptorIsNotCalledEvenWhenItWasReadyInTheSameBatch) {
  rt::Executor executor;
  Loop loop(executor);
  Pipe a(loop);
  Pipe b(loop);
  a.other = &b;
  b.other = &a;
  a.put();
  b.put();
  loop.turn(1h);
  EXPECT_EQ(a.calls + b.calls, 1);
}

TEST(Loop, ALongSleepEndsAtItsTimerInOneTurn) {
  rt::Executor executor;
  Loop loop(executor);
  Counter counter;
  const rt::Time due = loop.clock() + 60ms;
  executor.at(due, counter);
  loop.turn(1h);
  EXPECT_EQ(counter.runs, 1);
  EXPECT_GE(loop.clock(), due);
}

TEST(Loop, ALongSleepEndsWhenThereIsSomethingToRead) {
  rt::Executor executor;
  Loop loop(executor);
  Pipe pipe(loop);
  Counter counter;
  executor.at(rt::Time{} + 1h, counter);
  pipe.put();
  loop.turn(1h);  // would not return
  EXPECT_EQ(pipe.calls, 1);
  EXPECT_EQ(counter.runs, 0);
}

// A later timer does not move the alarm, and the alarm of one that was taken back ends no turn.
TEST(Loop, ATimerThatWasTakenBackDoesNotEndTheSleep) {
  rt::Executor executor;
  Loop loop(executor);
  Pipe pipe(loop);
  Counter gone;
  Counter counter;
  do {  // until the pipe ends the turn before the timer does, which a busy machine may prevent
    gone.runs = 0;
    executor.at(loop.clock() + 20ms, gone);
    pipe.put();
    loop.turn(1h);
  } while (gone.runs > 0);
  gone.cancel();
  const rt::Time due = loop.clock() + 30ms;
  executor.at(due, counter);
  loop.turn(1h);
  EXPECT_EQ(gone.runs, 0);
  EXPECT_EQ(counter.runs, 1);
  EXPECT_GE(loop.woke(), due);
}

TEST(Loop, AnEarlierTimerMovesTheAlarm) {
  rt::Executor executor;
  Loop loop(executor);
  Pipe pipe(loop);
  Counter late;
  Counter early;
  executor.at(rt::Time{} + 1h, late);
  pipe.put();
  loop.turn(2h);
  executor.at(loop.clock() + 5ms, early);
  loop.turn(2h);  // would not return for an hour
  EXPECT_EQ(early.runs, 1);
  EXPECT_EQ(late.runs, 0);
}

TEST(Loop, ATurnEndsAfterItsTimeAndTheClockIsKnown) {
  rt::Executor executor;
  Loop loop(executor);
  const rt::Time began = loop.woke();
  loop.turn(4ms);
  EXPECT_GE(loop.woke() - began, 4ms);
  EXPECT_EQ(executor.now(), loop.woke());
  EXPECT_LE(loop.woke(), loop.clock());
}

// What drives a real bus: this room links no simulator, so that none can stand behind it.
TEST(LoopDriver, ItEndsAtADescriptorsEventLongBeforeItsTime) {
  rt::Executor executor;
  LoopDriver driver(executor, 1h);
  Pipe pipe(driver.loop());
  pipe.put();
  EXPECT_TRUE(driver.run_until([&] { return pipe.bytes > 0; }, driver.later(1h)));
  EXPECT_LT(driver.now(), rt::Time{} + 1h);
}

TEST(LoopDriver, TimersRunAtTheirTimeByTheClockAndTheTimeAllowedEndsIt) {
  const auto real = std::chrono::steady_clock::now();
  rt::Executor executor;
  LoopDriver driver(executor, 1h);
  Counter counter;
  executor.after(5ms, counter);
  EXPECT_TRUE(driver.run_until([&] { return counter.runs > 0; }, rt::never));
  EXPECT_GE(driver.now(), rt::Time{} + 5ms);
  const rt::Time end = driver.later(7ms);
  EXPECT_FALSE(driver.run_until([] { return false; }, end));
  EXPECT_GE(driver.now(), end);
  EXPECT_GE(std::chrono::steady_clock::now() - real, 12ms) << "world time is the clock's";
}

TEST(LoopDriver, ASimulatedWorldIsPacedToTheClock) {
  const auto real = std::chrono::steady_clock::now();
  sim::World world;
  LoopDriver driver(world.executor());
  int done = 0;
  for (const auto when : {2ms, 9ms}) world.after(when, [&] { ++done; });
  EXPECT_TRUE(driver.run_until([&] { return done == 2; }, rt::never));
  EXPECT_GE(std::chrono::steady_clock::now() - real, 9ms);
}

TEST(LoopDriver, WhatIsOverWaitsForNothing) {
  rt::Executor executor;
  LoopDriver driver(executor);
  Counter counter;
  executor.post(counter);
  EXPECT_TRUE(driver.run_until([] { return true; }, rt::never));
  EXPECT_EQ(counter.runs, 0);
  EXPECT_EQ(driver.later(rt::Duration::max()), rt::never);
}

TEST(LoopDriver, APredicateThatNoDescriptorTellsOfIsAskedAgain) {
  rt::Executor executor;
  LoopDriver driver(executor, 2ms);
  int asked = 0;
  EXPECT_TRUE(driver.run_until([&] { return ++asked == 4; }, rt::never));
  EXPECT_GE(driver.now(), rt::Time{} + 6ms);
}

// ---- a world's pace ----

/// Two nodes that send to each other, each on its own period.
class Talk {
 public:
  Talk() : bus_(&world.add_bus("line", 500'000)), a_(bus_->attach({.name = "a"})), b_(bus_->attach({.name = "b"})) {
    say(*a_, 0x101, 7ms);
    say(*b_, 0x102, 11ms);
    tap_.bus = bus_;
    bus_->add_tap(tap_);
  }
  ~Talk() { bus_->remove_tap(tap_); }
  Talk(const Talk&) = delete;
  Talk& operator=(const Talk&) = delete;
  [[nodiscard]] unsigned frames() const noexcept { return tap_.frames; }
  sim::World world{7};

 private:
  struct Tap final : can::Tap {
    void frame(const can::Frame&, rt::Time, int) noexcept override { ++frames; }
    sim::Bus* bus = nullptr;
    unsigned frames = 0;
  };
  void say(can::Port& port, std::uint32_t id, rt::Duration period) {
    world.after(period, [this, &port, id, period] {
      can::Frame frame;
      frame.id = id;
      frame.size = 2;
      static_cast<void>(port.send(frame, 0));
      say(port, id, period);
    });
  }
  sim::Bus* bus_;
  std::unique_ptr<sim::Controller> a_, b_;
  Tap tap_;
};

// Held, stepped, slowed and run faster: the frames and their instants are those of a world that runs by itself.
TEST(LoopPace, NothingOfTheWorldChanges) {
  Talk held;
  Loop loop(held.world.executor());
  const auto turn_for = [&](std::chrono::milliseconds time) {
    const auto end = std::chrono::steady_clock::now() + time;
    while (std::chrono::steady_clock::now() < end) loop.turn(2ms);
  };
  turn_for(30ms);
  loop.pause(true);
  turn_for(5ms);
  for (int i = 0; i < 5; ++i) {
    const unsigned before = held.frames();
    EXPECT_TRUE(loop.step_until([&] { return held.frames() > before; }, held.world.now() + 1s));
    EXPECT_EQ(held.frames(), before + 1);
    loop.turn(1ms);
  }
  loop.set_speed(20);
  loop.pause(false);
  turn_for(30ms);
  loop.set_speed(0.5);
  turn_for(30ms);
  Talk alone;
  alone.world.run_until(held.world.now());
  EXPECT_GT(held.frames(), 50U);
  EXPECT_EQ(held.frames(), alone.frames());
  EXPECT_EQ(held.world.trace_hash(), alone.world.trace_hash());
}

TEST(LoopPace, WhileItStandsOnlyWhatIsReadyIsDone) {
  rt::Executor executor;
  Loop loop(executor);
  Counter timed, ready;
  executor.after(1ms, timed);
  loop.pause(true);
  const auto stood = executor.now();
  Pipe pipe(loop);
  pipe.job = &ready;
  pipe.put();
  const auto end = std::chrono::steady_clock::now() + 20ms;
  while (std::chrono::steady_clock::now() < end) loop.turn(5ms);
  EXPECT_EQ(timed.runs, 0);
  EXPECT_EQ(ready.runs, 1) << "who asks is answered";
  EXPECT_LT(executor.now() - stood, 1ms);
  EXPECT_EQ(loop.clock(), executor.now());
  loop.pause(false);
  while (timed.runs == 0) loop.turn(5ms);
  EXPECT_LT(executor.now() - stood, 10s) << "the time that it stood is no time of the world";
}

// Two timers are due by the clock; the job of the first holds the world.
TEST(LoopPace, AJobThatHoldsTheWorldHoldsItAtItsInstant) {
  class Holds final : public rt::Job {
   public:
    explicit Holds(Loop& loop) : loop_(&loop) {}
    void run() noexcept override {
      loop_->pause(true);
      at = loop_->executor().now();
    }
    rt::Time at{};

   private:
    Loop* loop_;
  };
  rt::Executor executor;
  Loop loop(executor);
  Holds holds(loop);
  Counter after;
  executor.after(1ms, holds);
  executor.after(1500us, after);
  std::this_thread::sleep_for(5ms);
  for (int i = 0; i < 3; ++i) loop.turn(1ms);
  EXPECT_EQ(after.runs, 0);
  EXPECT_NE(holds.at, rt::Time{});
  EXPECT_EQ(executor.now(), holds.at);
  EXPECT_EQ(loop.clock(), holds.at);
  loop.pause(false);
  while (after.runs == 0) loop.turn(5ms);
  EXPECT_GE(executor.now() - holds.at, 500us);
}

TEST(LoopPace, TimeThatPassedWhileItStoodIsNotMadeUp) {
  rt::Executor executor;
  Loop loop(executor);
  Counter timed;
  loop.turn(1ms);
  loop.pause(true);
  executor.after(100ms, timed);
  std::this_thread::sleep_for(200ms);
  loop.turn(1ms);
  EXPECT_EQ(timed.runs, 0);
  loop.pause(false);
  const auto began = std::chrono::steady_clock::now();
  while (timed.runs == 0) loop.turn(10ms);
  EXPECT_GE(std::chrono::steady_clock::now() - began, 99ms);
}

TEST(LoopPace, ASpeedIsWorldTimeBesideTheClocks) {
  rt::Executor executor;
  Loop loop(executor);
  Counter timed;
  loop.set_speed(100);
  executor.after(5s, timed);
  const auto began = std::chrono::steady_clock::now();
  while (timed.runs == 0) loop.turn(10ms);
  const auto took = std::chrono::steady_clock::now() - began;
  EXPECT_GE(took, 50ms - 1ms);
  EXPECT_LT(took, 4s) << "5 s of world time, 50 ms of the clock's";
}

/// Takes longer than the instant it is at.
class Slow final : public rt::Job {
 public:
  explicit Slow(rt::Executor& executor) : executor_(&executor) { executor.after(1ms, *this); }
  void run() noexcept override {
    ++runs;
    const auto end = std::chrono::steady_clock::now() + 100us;
    while (std::chrono::steady_clock::now() < end) {
    }
    executor_->after(1ms, *this);
  }
  int runs = 0;

 private:
  rt::Executor* executor_;
};

TEST(LoopPace, AWorldThatIsTooFastIsAsFastAsItCan) {
  rt::Executor executor;
  Loop loop(executor);
  Slow slow(executor);
  loop.set_speed(1000);  // at most some ten times as fast as real time can be computed
  int longest = 0;
  for (int i = 0; i < 5; ++i) {
    const int before = slow.runs;
    loop.turn(10ms);
    longest = std::max(longest, slow.runs - before);
  }
  EXPECT_GT(slow.runs, 0);
  EXPECT_LE(longest, 110) << "a turn does 100 ms of the world's time at most behind the next instant";
}

}  // namespace
}  // namespace berth::io
