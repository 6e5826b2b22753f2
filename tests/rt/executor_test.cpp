#include "berth/rt/executor.hpp"

#include <gtest/gtest.h>
#include <algorithm>
#include <chrono>
#include <cstdint>
#include <functional>
#include <memory>
#include <optional>
#include <thread>
#include <vector>

#include "berth/base/random.hpp"

using namespace berth;
using rt::Duration;
using rt::Rank;
using rt::Time;
using namespace std::chrono_literals;

namespace {

struct Call final : rt::Job {
  explicit Call(std::function<void()> f) : what(std::move(f)) {}
  void run() noexcept override { what(); }
  std::function<void()> what;
};

// Jobs that write down who ran and when.
struct ExecutorTest : ::testing::Test {
  rt::Executor executor;
  std::vector<std::pair<int, Time>> log;

  std::unique_ptr<Call> job(int name) {
    return std::make_unique<Call>([this, name] { log.emplace_back(name, executor.now()); });
  }
  [[nodiscard]] std::vector<int> order() const {
    std::vector<int> names;
    for (const auto& [name, when] : log) names.push_back(name);
    return names;
  }
};

TEST_F(ExecutorTest, PostedJobsRunInTheOrderOfPostingAndOnce) {
  auto a = job(1), b = job(2), c = job(3);
  executor.post(*b);
  executor.post(*a);
  executor.post(*c);
  executor.post(*b);
  EXPECT_TRUE(b->ready());
  EXPECT_EQ(executor.next(), Time{});
  executor.advance(Time{});
  EXPECT_EQ(order(), (std::vector{2, 1, 3}));
  EXPECT_FALSE(b->ready());
  EXPECT_EQ(executor.next(), std::nullopt);
  EXPECT_EQ(executor.jobs_run(), 3U);
}

TEST_F(ExecutorTest, NoJobRunsInsideAnother) {
  int depth = 0, deepest = 0, runs = 0;
  std::unique_ptr<Call> other;
  Call first([&] {
    deepest = std::max(deepest, ++depth);
    if (++runs < 10) {
      executor.post(*other);
      executor.at(executor.now(), first);
      executor.at(executor.now() - 1s, *other);
    }
    --depth;
  });
  other = std::make_unique<Call>([&] {
    deepest = std::max(deepest, ++depth);
    executor.post(first);
    --depth;
  });
  executor.post(first);
  executor.advance(Time(1s));
  EXPECT_EQ(deepest, 1);
  EXPECT_GE(runs, 10);
}

TEST_F(ExecutorTest, TimersFireAtTheirTimesAndEqualOnesInTheOrderOfSetting) {
  auto a = job(1), b = job(2), c = job(3), d = job(4);
  executor.at(Time(30ns), *a);
  executor.at(Time(10ns), *b);
  executor.at(Time(30ns), *c);
  executor.at(Time(20ns), *d);
  EXPECT_EQ(executor.next(), Time(10ns));
  executor.advance(Time(25ns));
  EXPECT_EQ(executor.now(), Time(25ns));
  EXPECT_EQ(log, (std::vector<std::pair<int, Time>>{{2, Time(10ns)}, {4, Time(20ns)}}));
  executor.advance(Time(30ns));
  EXPECT_EQ(order(), (std::vector{2, 4, 1, 3}));
}

// HC5.4: a thread may set a timer while the executor's own stands still (a program that starts up in parts).
TEST_F(ExecutorTest, EqualTimesRunInTheOrderOfSettingWhicheverThreadSetThem) {
  const auto a = job(1);
  const auto b = job(2);
  const auto c = job(3);
  executor.at(Time(5ms), *a);
  executor.at(Time(5ms), *b);
  std::thread([&] { executor.at(Time(5ms), *c); }).join();
  executor.advance(Time(5ms));
  EXPECT_EQ(order(), (std::vector{1, 2, 3}));
}

TEST_F(ExecutorTest, MovedEarlierAndLater) {
  auto a = job(1), b = job(2);
  executor.at(Time(50ns), *a);
  executor.at(Time(40ns), *b);
  executor.at(Time(10ns), *a);
  EXPECT_EQ(executor.next(), Time(10ns));
  executor.at(Time(60ns), *a);
  EXPECT_EQ(a->due(), Time(60ns));
  EXPECT_EQ(executor.next(), Time(40ns));
  executor.advance(Time(100ns));
  EXPECT_EQ(log, (std::vector<std::pair<int, Time>>{{2, Time(40ns)}, {1, Time(60ns)}}));
}

// A deadline pushed on again and again is the common case: heartbeat consumers, SDO timeouts.
TEST_F(ExecutorTest, MovedLaterManyTimesFiresOnceAndLast) {
  auto a = job(1), b = job(2);
  for (int i = 1; i <= 1000; ++i) executor.at(Time(Duration(i * 10)), *a);
  executor.at(Time(9'999ns), *b);
  executor.advance(Time(20us));
  EXPECT_EQ(log, (std::vector<std::pair<int, Time>>{{2, Time(9'999ns)}, {1, Time(10us)}}));
}

TEST_F(ExecutorTest, MovedToTheSameTimeCountsAsSetAnew) {
  auto a = job(1), b = job(2), c = job(3);
  executor.at(Time(10ns), *a);
  executor.at(Time(10ns), *b);
  executor.at(Time(10ns), *c);
  executor.at(Time(10ns), *a);
  executor.at(Time(50ns), *b);
  executor.at(Time(10ns), *b);
  executor.advance(Time(10ns));
  EXPECT_EQ(order(), (std::vector{3, 1, 2}));
}

TEST_F(ExecutorTest, CancelWhileReadyAndWhileTimed) {
  auto a = job(1), b = job(2), c = job(3);
  executor.post(*a);
  executor.at(Time(5ns), *a);
  executor.at(Time(6ns), *b);
  executor.post(*c);
  a->cancel();
  b->cancel_timer();
  EXPECT_FALSE(a->ready());
  EXPECT_FALSE(a->timed());
  EXPECT_FALSE(b->timed());
  executor.advance(Time(1s));
  EXPECT_EQ(order(), std::vector{3});
}

TEST_F(ExecutorTest, CancelTimerLeavesItReady) {
  auto a = job(1);
  executor.post(*a);
  executor.at(Time(5ns), *a);
  a->cancel_timer();
  executor.advance(Time(1s));
  EXPECT_EQ(log, (std::vector<std::pair<int, Time>>{{1, Time{}}}));
}

TEST_F(ExecutorTest, AJobCancelsAndDestroysOthersOfTheSameInstant) {
  auto b = job(2), c = job(3), d = job(4);
  Call a([&] {
    b->cancel();
    c.reset();
  });
  executor.at(Time(5ns), a);
  executor.at(Time(5ns), *b);
  executor.at(Time(5ns), *c);
  executor.at(Time(5ns), *d);
  executor.advance(Time(5ns));
  EXPECT_EQ(order(), std::vector{4});
}

TEST_F(ExecutorTest, AJobDestroysItselfInItsOwnRun) {
  std::unique_ptr<Call> a;
  auto b = job(2);
  bool ran = false;
  a = std::make_unique<Call>([&] {
    ran = true;
    executor.post(*a);
    executor.at(Time(1us), *a);
    // The function object dies with the job, so its captures are taken first.
    auto& owner = a;
    owner.reset();
  });
  executor.post(*a);
  executor.post(*b);
  executor.advance(Time(1s));
  EXPECT_TRUE(ran);
  EXPECT_EQ(order(), std::vector{2});
}

TEST_F(ExecutorTest, JobsOutliveTheExecutor) {
  auto a = job(1), b = job(2), c = job(3);
  {
    rt::Executor shortlived;
    shortlived.post(*a);
    shortlived.at(Time(1s), *b);
    shortlived.at(Time(2s), *a);
    shortlived.post(*c, Rank::medium);
  }
  EXPECT_FALSE(a->ready() || a->timed() || b->timed() || c->ready());
  executor.post(*a);
  executor.at(Time(1ns), *b);
  executor.advance(Time(1ns));
  EXPECT_EQ(order(), (std::vector{1, 2}));
}

TEST_F(ExecutorTest, MediumWaitsForEveryNodeJobOfItsInstant) {
  auto late = job(3), later = job(4), medium_two = job(20);
  Call node([&] {
    log.emplace_back(1, executor.now());
    executor.post(*late);
  });
  Call medium([&] {
    log.emplace_back(10, executor.now());
    executor.post(*later);  // runs before the next medium job
  });
  executor.post(medium, Rank::medium);
  executor.post(*medium_two, Rank::medium);
  executor.post(node);
  executor.advance(Time{});
  EXPECT_EQ(order(), (std::vector{1, 3, 10, 4, 20}));
}

TEST_F(ExecutorTest, MediumWaitsForTimersSetForItsInstant) {
  auto timer = job(1), medium = job(10), medium_timer = job(11);
  Call node([&] { executor.at(executor.now(), *timer); });
  executor.at(Time(5ns), *medium_timer, Rank::medium);
  Call poster([&] { executor.post(*medium, Rank::medium); });
  executor.at(Time(5ns), poster);
  executor.at(Time(5ns), node);
  executor.advance(Time(5ns));
  ASSERT_EQ(log.size(), 3U);
  EXPECT_EQ(log[0].first, 1);
}

TEST_F(ExecutorTest, ATimerOfTheMediumRunsBehindNodeTimersOfTheInstantSetLater) {
  auto medium = job(10), node = job(1);
  executor.at(Time(5ns), *medium, Rank::medium);
  executor.at(Time(5ns), *node);
  executor.advance(Time(5ns));
  EXPECT_EQ(order(), (std::vector{1, 10}));
}

TEST_F(ExecutorTest, StepRunsOneInstant) {
  auto a = job(1), b = job(2), c = job(3);
  executor.at(Time(10ns), *a);
  executor.at(Time(10ns), *b);
  executor.at(Time(11ns), *c);
  EXPECT_FALSE(executor.step(Time(9ns)));
  EXPECT_TRUE(executor.step(Time(100ns)));
  EXPECT_EQ(executor.now(), Time(10ns));
  EXPECT_EQ(order(), (std::vector{1, 2}));
  EXPECT_TRUE(executor.step(Time(100ns)));
  EXPECT_FALSE(executor.step(Time(100ns)));
}

TEST_F(ExecutorTest, AdvanceToThePastRunsWhatIsReadyAndKeepsTheTime) {
  auto a = job(1);
  executor.advance(Time(1s));
  executor.post(*a);
  executor.advance(Time(10ns));
  EXPECT_EQ(executor.now(), Time(1s));
  EXPECT_EQ(log, (std::vector<std::pair<int, Time>>{{1, Time(1s)}}));
  executor.at(Time(5ns), *a);  // long ago: due at once
  EXPECT_EQ(executor.next(), Time(1s));
}

TEST_F(ExecutorTest, PerturbChangesTheOrderOfAnInstantAndIsTheSameForASeed) {
  const auto run = [](std::uint64_t seed) {
    rt::Executor fresh;
    if (seed != 0) fresh.perturb(seed);
    std::vector<int> seen;
    std::vector<std::unique_ptr<Call>> jobs;
    for (int i = 0; i < 20; ++i) {
      jobs.push_back(std::make_unique<Call>([&seen, i] { seen.push_back(i); }));
      if (i % 2 == 0) {
        fresh.post(*jobs.back());
      } else {
        fresh.at(Time(5ns), *jobs.back());
      }
    }
    fresh.advance(Time(10ns));
    return seen;
  };
  std::vector<int> plain = run(0);
  int different = 0;
  for (std::uint64_t seed = 1; seed <= 50; ++seed) {
    auto seen = run(seed * 2);
    EXPECT_EQ(seen, run(seed * 2)) << seed;
    different += seen != plain ? 1 : 0;
    // The even ones were ready now, the odd ones 5 ns later: no perturbation crosses an instant.
    for (std::size_t i = 0; i < 20; ++i) EXPECT_EQ(seen[i] % 2, i < 10 ? 0 : 1);
    std::ranges::sort(seen);
    std::vector<int> sorted = plain;
    std::ranges::sort(sorted);
    EXPECT_EQ(seen, sorted);
  }
  EXPECT_GT(different, 45);
}

// Does the same with a vector that is searched from one end to the other.
struct Model {
  struct Timer {
    Time due;
    std::uint64_t order;
    int name;
  };
  Time now{};
  std::uint64_t order = 0;
  std::vector<Timer> timers;
  std::vector<int> ready;
  std::vector<std::pair<int, Time>> log;

  void drop_timer(int name) {
    std::erase_if(timers, [&](const Timer& t) { return t.name == name; });
  }
  void at(Time when, int name) {
    drop_timer(name);
    timers.push_back({std::max(when, now), ++order, name});
  }
  void post(int name) {
    if (std::ranges::find(ready, name) == ready.end()) ready.push_back(name);
  }
  void cancel(int name) {
    drop_timer(name);
    std::erase(ready, name);
  }
  [[nodiscard]] std::vector<Timer>::iterator earliest() {
    return std::ranges::min_element(
        timers, [](const Timer& a, const Timer& b) { return std::tie(a.due, a.order) < std::tie(b.due, b.order); });
  }
  [[nodiscard]] std::optional<Time> next() {
    if (!ready.empty()) return now;
    if (timers.empty()) return std::nullopt;
    return earliest()->due;
  }
  // `act` is what the job does when it runs.
  template <class Act>
  void advance(Time until, Act act) {
    until = std::max(until, now);
    for (;;) {
      // At the start of an instant and whenever nothing is ready, what is due becomes ready.
      const auto when = next();
      if (!when || *when > until) break;
      now = *when;
      collect();
      while (!ready.empty()) {
        const int name = ready.front();
        ready.erase(ready.begin());
        log.emplace_back(name, now);
        act(name);
        if (ready.empty()) collect();
      }
    }
    now = until;
  }
  void collect() {
    while (!timers.empty() && earliest()->due <= now) {
      const int name = earliest()->name;
      drop_timer(name);
      post(name);
    }
  }
};

// What a job does when it runs depends on nothing but its name and how often it ran.
struct Script {
  struct Step {
    enum Kind { post, at, cancel, nothing } kind;
    int name;
    std::int64_t delay;
  };
  static Step step(std::uint64_t seed, int name, int count) {
    Random random(seed ^ (static_cast<std::uint64_t>(name) << 32) ^ static_cast<std::uint64_t>(count));
    if (count > 40) return {Step::nothing, 0, 0};
    return {static_cast<Step::Kind>(random.below(4)), static_cast<int>(random.below(12)), random.between(-2, 9)};
  }
};

TEST(ExecutorModel, RandomProgramsRunAsInTheNaiveModel) {
  for (std::uint64_t seed = 1; seed <= 1500; ++seed) {
    Random random(seed);
    rt::Executor executor;
    Model model;
    std::vector<std::pair<int, Time>> log;
    std::vector<std::unique_ptr<Call>> jobs;
    std::vector<int> counts(12), model_counts(12);
    for (int name = 0; name < 12; ++name) {
      jobs.push_back(std::make_unique<Call>([&, name] {
        log.emplace_back(name, executor.now());
        const auto step = Script::step(seed, name, ++counts[static_cast<std::size_t>(name)]);
        rt::Job& other = *jobs[static_cast<std::size_t>(step.name)];
        if (step.kind == Script::Step::post) executor.post(other);
        if (step.kind == Script::Step::at) executor.after(Duration(step.delay), other);
        if (step.kind == Script::Step::cancel) other.cancel();
      }));
    }
    const auto act = [&](int name) {
      const auto step = Script::step(seed, name, ++model_counts[static_cast<std::size_t>(name)]);
      if (step.kind == Script::Step::post) model.post(step.name);
      if (step.kind == Script::Step::at) model.at(model.now + Duration(step.delay), step.name);
      if (step.kind == Script::Step::cancel) model.cancel(step.name);
    };
    for (int i = 0; i < 60; ++i) {
      const auto name = static_cast<int>(random.below(12));
      auto& job = *jobs[static_cast<std::size_t>(name)];
      const auto when = executor.now() + Duration(random.between(-3, 20));
      switch (random.below(6)) {
        case 0:
          executor.post(job);
          model.post(name);
          break;
        case 1:
        case 2:
        case 3:
          executor.at(when, job);
          model.at(when, name);
          break;
        case 4:
          job.cancel();
          model.cancel(name);
          break;
        default: executor.advance(when); model.advance(when, act);
      }
      ASSERT_EQ(executor.next(), model.next()) << "seed " << seed << " step " << i;
      ASSERT_EQ(executor.now(), model.now) << "seed " << seed << " step " << i;
      for (std::size_t k = 0; k < jobs.size(); ++k) {
        const auto timed =
            std::ranges::any_of(model.timers, [&](const auto& t) { return t.name == static_cast<int>(k); });
        ASSERT_EQ(jobs[k]->timed(), timed) << "seed " << seed << " step " << i;
      }
    }
    executor.advance(executor.now() + 1us);
    model.advance(model.now + 1us, act);
    ASSERT_EQ(log, model.log) << "seed " << seed;
  }
}

// Twenty thousand timers, moved and cancelled at random, must come out sorted; the heap's shape is put to the test.
TEST(ExecutorModel, ManyTimersComeSorted) {
  rt::Executor executor;
  Random random(7);
  std::vector<Time> fired;
  std::vector<std::unique_ptr<Call>> jobs;
  for (int i = 0; i < 20'000; ++i) {
    jobs.push_back(std::make_unique<Call>([&] { fired.push_back(executor.now()); }));
    executor.at(Time(Duration(random.below(1'000'000))), *jobs.back());
  }
  std::size_t cancelled = 0;
  for (auto& job : jobs) {
    if (random.below(4) == 0) executor.at(Time(Duration(random.below(1'000'000))), *job);
    if (random.below(8) == 0) {
      job.reset();
      ++cancelled;
    }
  }
  executor.advance(Time(1ms));
  EXPECT_EQ(fired.size(), jobs.size() - cancelled);
  EXPECT_TRUE(std::ranges::is_sorted(fired));
}

}  // namespace
