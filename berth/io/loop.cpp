#include "berth/io/loop.hpp"

#include <sys/epoll.h>
#include <unistd.h>

#include <algorithm>
#include <array>

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

// One batch; a watcher that an earlier one of the batch made forgotten is not called.
void Loop::wait(std::int64_t nanoseconds) noexcept {
  std::array<epoll_event, 32> events{};
  const timespec time{nanoseconds / 1'000'000'000, nanoseconds % 1'000'000'000};
  const int count = ::epoll_pwait2(epoll_, events.data(), static_cast<int>(events.size()), &time, nullptr);
  if (count <= 0) return;
  rt::Time until = clock();
  if (const auto next = executor_->next()) until = std::min(until, *next - rt::Duration{1});
  if (until > executor_->now()) executor_->advance(until);
  for (int i = 0; i < count; ++i) {
    const auto& event = events[static_cast<std::size_t>(i)];
    if (Watcher* const watcher = watcher_of(event.data.fd)) watcher->ready(event.events);
  }
}

void Loop::turn(rt::Duration most) {
  const rt::Time now = clock();
  const auto next = executor_->next();
  if (next) most = std::min(most, std::max(*next - now, rt::Duration{0}));
  wait(most.count());
  executor_->advance(clock());
}

}  // namespace berth::io
