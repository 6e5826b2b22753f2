#include "berth/io/loop.hpp"

#include <sys/timerfd.h>
#include <unistd.h>

#include <algorithm>
#include <utility>

namespace berth::io {

using Clock = std::chrono::steady_clock;

namespace {

// With factor 1 the time stays exact, to the nanosecond.
rt::Duration scaled(rt::Duration time, double factor) noexcept {
  return factor == 1 ? time : rt::Duration(static_cast<std::int64_t>(static_cast<double>(time.count()) * factor));
}

}  // namespace

// std::chrono::steady_clock is CLOCK_MONOTONIC here.
Loop::Loop(rt::Executor& executor)
    : executor_(&executor),
      epoll_(::epoll_create1(EPOLL_CLOEXEC)),
      alarm_(::timerfd_create(CLOCK_MONOTONIC, TFD_CLOEXEC | TFD_NONBLOCK)),
      began_(executor.now()),
      real_(Clock::now()),
      woke_(began_) {
  epoll_event event{};
  event.events = EPOLLIN;
  event.data.fd = alarm_;
  if (good()) ::epoll_ctl(epoll_, EPOLL_CTL_ADD, alarm_, &event);
}

Loop::~Loop() {
  if (alarm_ >= 0) ::close(alarm_);
  if (epoll_ >= 0) ::close(epoll_);
}

rt::Time Loop::clock() const noexcept {
  if (paused_) return std::max(began_, executor_->now());
  const auto passed = std::chrono::duration_cast<rt::Duration>(Clock::now() - real_);
  return std::max(began_ + scaled(passed, speed_), executor_->now());
}

void Loop::begin_at(rt::Time world) noexcept {
  began_ = woke_ = std::max(world, executor_->now());
  real_ = Clock::now();
  alarm_at_ = rt::Time::min();
}

void Loop::set_speed(double factor) noexcept {
  begin_at(woke_);
  speed_ = factor;
}

void Loop::pause(bool on) noexcept {
  if (paused_ == on) return;
  begin_at(executor_->now());
  paused_ = on;
}

// A world that cannot be computed at the wanted speed loses time, instead of computing more and more at once.
void Loop::keep_up() noexcept {
  constexpr rt::Duration most_at_once = std::chrono::milliseconds(100);
  if (paused_ || speed_ <= 1) return;
  const rt::Time latest = std::max(executor_->next().value_or(woke_), executor_->now()) + most_at_once;
  if (woke_ > latest) begin_at(latest);
}

bool Loop::watch(int fd, Watcher& watcher, std::uint32_t events) {
  epoll_event event{};
  event.events = events;
  event.data.fd = fd;
  const auto it = std::ranges::find(watched_, fd, &Watched::fd);
  const bool known = it != watched_.end();
  if (::epoll_ctl(epoll_, known ? EPOLL_CTL_MOD : EPOLL_CTL_ADD, fd, &event) != 0) return false;
  if (known) {
    it->watcher = &watcher;
  } else {
    watched_.push_back({fd, &watcher});
  }
  return true;
}

void Loop::forget(int fd) noexcept {
  if (std::erase_if(watched_, [fd](const Watched& w) { return w.fd == fd; }) == 0) return;
  ::epoll_ctl(epoll_, EPOLL_CTL_DEL, fd, nullptr);
}

Watcher* Loop::watcher_of(int fd) const noexcept {
  const auto it = std::ranges::find(watched_, fd, &Watched::fd);
  return it == watched_.end() ? nullptr : it->watcher;
}

// An alarm that comes early enough is left as it is: waking in vain costs less than a system call for each wait.
void Loop::set_alarm(rt::Time at) noexcept {
  if (alarm_at_ > woke_ && alarm_at_ <= at) return;
  arm(at == rt::never ? rt::Duration{0} : real_.time_since_epoch() + scaled(at - began_, 1 / speed_));
  alarm_at_ = at;
}

// Zero: never.
void Loop::arm(std::chrono::nanoseconds since_boot) noexcept {
  itimerspec setting{};
  setting.it_value = {static_cast<time_t>(since_boot.count() / 1'000'000'000),
                      static_cast<long>(since_boot.count() % 1'000'000'000)};
  ::timerfd_settime(alarm_, TFD_TIMER_ABSTIME, &setting, nullptr);
}

int Loop::collect(int patience_ms) noexcept {
  events_.resize(watched_.size() + 1);  // room for every descriptor and for the alarm
  return ::epoll_wait(epoll_, events_.data(), static_cast<int>(events_.size()), patience_ms);
}

// Handles one batch. A watcher that an earlier one of the batch removed is not called. False: only the alarm came, or
// nothing.
bool Loop::wait(bool sleep) noexcept {
  int count = sleep ? collect(-1) : 0;
  const bool interrupted = count < 0;
  woke_ = clock();
  keep_up();
  // After the wait the process may have been stopped (by SIGSTOP, for seconds). Then the clock is later than what the
  // wait reported. So all that arrived until then is read before a timer runs.
  const auto next = executor_->next();
  if (!sleep || (next && *next <= woke_)) count = collect(0);
  bool came = interrupted || count < 0;
  for (int i = 0; i < count; ++i) {
    const epoll_event event = events_[static_cast<std::size_t>(i)];
    if (event.data.fd == alarm_) continue;
    if (!std::exchange(came, true)) {
      rt::Time until = woke_;
      if (next) until = std::min(until, *next - rt::Duration{1});
      if (until > executor_->now()) executor_->advance(until);
    }
    if (Watcher* const watcher = watcher_of(event.data.fd)) watcher->ready(event.events);
  }
  return came;
}

// Time does not pass: only descriptors are handled, and the jobs that they make ready.
void Loop::stand(rt::Duration most) {
  const auto next = executor_->next();
  const bool sleep = most > rt::Duration{0} && (!next || *next > woke_);
  if (sleep) arm(Clock::now().time_since_epoch() + std::min<rt::Duration>(most, std::chrono::hours(1)));
  alarm_at_ = rt::Time::min();
  wait(sleep);
}

void Loop::run(rt::Duration most) {
  const rt::Duration world = scaled(most, most == rt::Duration::max() ? 1 : speed_);
  const rt::Time limit = world < rt::never - woke_ ? woke_ + world : rt::never;
  for (;;) {
    const rt::Time until = std::min(limit, executor_->next().value_or(rt::never));
    const bool sleep = until > woke_;
    if (sleep) set_alarm(until);
    if (wait(sleep) || woke_ >= until) break;
  }
}

void Loop::turn(rt::Duration most) {
  if (paused_) {
    stand(most);
  } else {
    run(most);
  }
  advance(std::min(woke_, std::exchange(held_, rt::never)));
}

// Goes no further than the instant of a job that pauses the world: that time is reported to whoever asked for the
// pause.
void Loop::advance(rt::Time until) noexcept {
  const bool stood = paused_;
  while (paused_ == stood && executor_->step(until)) {
  }
  if (paused_ == stood) executor_->advance(until);
}

}  // namespace berth::io
