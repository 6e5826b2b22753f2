#include "interrupt.hpp"

#include <signal.h>
#include <sys/signalfd.h>
#include <unistd.h>

namespace berth::cli {

using Clock = std::chrono::steady_clock;

Interrupt::Interrupt(io::Loop* loop) : loop_(loop) {
  sigset_t set;
  sigemptyset(&set);
  sigaddset(&set, SIGINT);
  sigaddset(&set, SIGTERM);
  ::sigprocmask(SIG_BLOCK, &set, &before_);
  fd_ = ::signalfd(-1, &set, SFD_NONBLOCK | SFD_CLOEXEC);
  if (loop_ != nullptr) loop_->watch(fd_, *this, EPOLLIN);
}

// A signal that nobody has looked at since is taken: what it was to end is over.
Interrupt::~Interrupt() {
  signalfd_siginfo info{};
  while (::read(fd_, &info, sizeof info) == static_cast<ssize_t>(sizeof info)) continue;
  if (loop_ != nullptr) loop_->forget(fd_);
  if (fd_ >= 0) ::close(fd_);
  ::sigprocmask(SIG_SETMASK, &before_, nullptr);
}

bool Interrupt::came() noexcept {
  signalfd_siginfo info{};
  came_ = came_ || ::read(fd_, &info, sizeof info) == static_cast<ssize_t>(sizeof info);
  return came_;
}

void Interrupt::ready(std::uint32_t) noexcept { static_cast<void>(came()); }

// A loop tells of a signal by itself.
bool Interrupt::noticed() noexcept {
  constexpr unsigned seldom = 256;
  const bool looks = loop_ == nullptr && ++asked_ % seldom == 0;
  return looks ? came() : came_;
}

bool wait_until(rt::Driver& driver, Interrupt& interrupt, const rt::Driver::Predicate& over, rt::Duration most) {
  driver.run_until([&] { return over() || interrupt.noticed(); }, driver.later(most));
  return over();
}

void wait_for(rt::Driver& driver, Interrupt& interrupt, rt::Duration time) {
  wait_until(
      driver, interrupt, [] { return false; }, time);
}

std::function<bool()> ended_by(std::optional<std::chrono::nanoseconds> after) {
  const auto end = after ? Clock::now() + *after : Clock::time_point::max();
  return [end] {
    sigset_t waiting;
    ::sigpending(&waiting);
    return ::sigismember(&waiting, SIGINT) == 1 || ::sigismember(&waiting, SIGTERM) == 1 || Clock::now() >= end;
  };
}

}  // namespace berth::cli
