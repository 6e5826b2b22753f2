// How late `io::Loop` is with timers: of single ones after so much sleep, on an otherwise idle thread, as it is and
// with real-time priority where the system gives it. Times are this host's, and of whatever else runs on it.
#include <fmt/format.h>

#include <algorithm>
#include <cstdio>
#include <vector>

#include "bench/tools/figures.hpp"
#include "berth/io/loop.hpp"
#include "berth/io/realtime.hpp"

using namespace berth;
using namespace std::chrono_literals;

namespace {

class Alarm final : public rt::Job {
 public:
  explicit Alarm(io::Loop& loop) noexcept : loop_(&loop) {}
  void run() noexcept override {
    late = loop_->clock() - due();
    rung = true;
  }
  rt::Duration late{};
  bool rung = false;

 private:
  io::Loop* loop_;
};

std::vector<std::string> lateness(const std::string& how, rt::Duration sleep, unsigned count) {
  rt::Executor executor;
  io::Loop loop(executor);
  std::vector<rt::Duration> late;
  for (unsigned i = 0; i < count; ++i) {
    Alarm alarm(loop);
    executor.at(loop.clock() + sleep, alarm);
    while (!alarm.rung) loop.turn(1h);
    late.push_back(alarm.late);
  }
  std::ranges::sort(late);
  const auto us = [](rt::Duration d) {
    return fmt::format("{:.0f}", std::chrono::duration<double, std::micro>(d).count());
  };
  return {how,
          bench::time_text(sleep),
          std::to_string(count),
          us(late[count / 2]),
          us(late[count * 99 / 100]),
          us(late.back())};
}

}  // namespace

int main() {
  constexpr struct {
    rt::Duration sleep;
    unsigned count;
  } runs[] = {{1ms, 2000}, {10ms, 300}, {100ms, 50}, {1s, 5}};
  std::vector<std::vector<std::string>> rows;
  for (const auto& run : runs) rows.push_back(lateness("as it is", run.sleep, run.count));
  const auto real_time = io::go_real_time({.priority = 80, .lock_memory = true});
  if (real_time) {
    for (const auto& run : runs) rows.push_back(lateness("real-time 80", run.sleep, run.count));
  }
  bench::print_columns("io::Loop: timers late by, in us", {"thread", "sleep", "count", "median", "99 %", "most"}, rows);
  if (!real_time) std::printf("real-time: %s\n", real_time.error().c_str());
  return 0;
}
