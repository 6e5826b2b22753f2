// Small costs that everything pays: a frame's exact length, jobs and timers, one await.
#include <benchmark/benchmark.h>

#include <memory>
#include <span>
#include <vector>

#include "berth/can/length.hpp"
#include "berth/rt/scope.hpp"

using namespace berth;
using namespace std::chrono_literals;

namespace {

void frame_length(benchmark::State& state) {
  std::vector<can::Frame> frames(256);
  std::uint8_t byte = 1;
  for (auto& frame : frames) {
    frame.id = byte;
    frame.size = static_cast<std::uint8_t>(state.range(0));
    for (auto& data : std::span(frame.data).first(frame.size)) data = byte = static_cast<std::uint8_t>(byte * 5U + 3U);
  }
  std::size_t at = 0;
  for (auto _ : state) benchmark::DoNotOptimize(can::exact_bits(frames[at++ & 255U]));
}
BENCHMARK(frame_length)->Arg(0)->Arg(8);

struct Nothing final : rt::Job {
  void run() noexcept override {}
};

void job_posted_and_run(benchmark::State& state) {
  rt::Executor executor;
  Nothing job;
  for (auto _ : state) {
    executor.post(job);
    executor.advance(executor.now());
  }
}
BENCHMARK(job_posted_and_run);

/// Each timer sets itself anew when it fires, so that there are always as many.
struct Ticking final : rt::Job {
  void run() noexcept override { executor->after(period, *this); }
  rt::Executor* executor = nullptr;
  rt::Duration period{};
};

void timer_fires_among(benchmark::State& state) {
  rt::Executor executor;
  std::vector<std::unique_ptr<Ticking>> timers;
  for (std::int64_t i = 0; i < state.range(0); ++i) {
    auto& timer = *timers.emplace_back(std::make_unique<Ticking>());
    timer.executor = &executor;
    timer.period = 1ms + 7919ns * i;
    executor.after(timer.period, timer);
  }
  for (auto _ : state) executor.step(rt::never);
}
BENCHMARK(timer_fires_among)->Arg(1)->Arg(30)->Arg(1000);

rt::Task<void> sleeps(std::uint64_t& count) {
  for (;;) {
    co_await rt::sleep_for(1us);
    ++count;
  }
}

void task_sleeps_and_wakes(benchmark::State& state) {
  rt::Executor executor;
  std::uint64_t count = 0;
  rt::Scope scope(executor);
  scope.spawn(sleeps(count));
  for (auto _ : state) executor.step(rt::never);
  benchmark::DoNotOptimize(count);
}
BENCHMARK(task_sleeps_and_wakes);

}  // namespace

BENCHMARK_MAIN();
