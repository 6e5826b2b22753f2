#include "berth/io/loop.hpp"

#include <poll.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cerrno>

namespace berth::io {

using Clock = std::chrono::steady_clock;

Loop::Loop(rt::Executor& executor)
    : executor_(&executor), epoll_(::epoll_create1(EPOLL_CLOEXEC)), began_(executor.now()), real_(Clock::now()) {}

Loop::~Loop() {
  if (epoll_ >= 0) ::close(epoll_);
}

rt::Time Loop::clock() const noexcept {
  const rt::Time now = began_ + std::chrono::duration_cast<rt::Duration>(Clock::now() - real_);
  return std::max(now, executor_->now());
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

namespace {

timespec as_timespec(rt::Duration d) noexcept {
  return {static_cast<time_t>(d.count() / 1'000'000'000), static_cast<long>(d.count() % 1'000'000'000)};
}

int wait_for(int epoll, std::span<epoll_event> events, rt::Duration most) noexcept {
  const timespec time = as_timespec(most);
  const int count = ::epoll_pwait2(epoll, events.data(), static_cast<int>(events.size()), &time, nullptr);
  return count < 0 && errno == ENOSYS ? detail::wait_by_poll(epoll, events, most) : count;
}

// Linux may wake a thread late by 0.1 % of its sleep, 0.5 % when it is nice, to save wake-ups (PR_SET_TIMERSLACK is the
// least, 50 us). A long sleep to a timer is therefore done in two parts.
constexpr rt::Duration long_sleep = std::chrono::milliseconds(20);
constexpr int last_part = 128;

}  // namespace

int detail::wait_by_poll(int epoll, std::span<epoll_event> events, rt::Duration most) noexcept {
  pollfd one{epoll, POLLIN, 0};
  const timespec time = as_timespec(most);
  const int ready = ::ppoll(&one, 1, &time, nullptr);
  return ready <= 0 ? ready : ::epoll_wait(epoll, events.data(), static_cast<int>(events.size()), 0);
}

// One batch; a watcher that an earlier one of the batch made forgotten is not called.
bool Loop::wait(rt::Duration most) noexcept {
  std::array<epoll_event, 32> events;
  const int count = wait_for(epoll_, events, most);
  if (count <= 0) return count < 0;
  rt::Time until = clock();
  if (const auto next = executor_->next()) until = std::min(until, *next - rt::Duration{1});
  if (until > executor_->now()) executor_->advance(until);
  for (int i = 0; i < count; ++i) {
    const auto& event = events[static_cast<std::size_t>(i)];
    if (Watcher* const watcher = watcher_of(event.data.fd)) watcher->ready(event.events);
  }
  return true;
}

void Loop::turn(rt::Duration most) {
  const rt::Time now = clock();
  const auto next = executor_->next();
  if (next) most = std::min(most, std::max(*next - now, rt::Duration{0}));
  const bool in_parts = next && most > long_sleep;
  if (!wait(in_parts ? most - most / last_part : most) && in_parts)
    wait(std::max(now + most - clock(), rt::Duration{0}));
  executor_->advance(clock());
}

}  // namespace berth::io
