#include "interrupt.hpp"

#include <signal.h>
#include <sys/signalfd.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <utility>

#include "output.hpp"

namespace berth::cli {

using Clock = std::chrono::steady_clock;

namespace {

// The signals by which a user, a supervisor or a closing terminal ends a program.
constexpr std::array<int, 3> ending{SIGINT, SIGTERM, SIGHUP};

// `Interrupt::reload_by`; only one `Interrupt` exists at a time.
bool hangup_reloads = false;

sigset_t ending_signals() noexcept {
  sigset_t set;
  sigemptyset(&set);
  for (const int signal : ending) sigaddset(&set, signal);
  return set;
}

}  // namespace

Interrupt::Interrupt(io::Loop* loop) : loop_(loop) {
  const sigset_t set = ending_signals();
  ::sigprocmask(SIG_BLOCK, &set, &before_);
  fd_ = ::signalfd(-1, &set, SFD_NONBLOCK | SFD_CLOEXEC);
  if (loop_ != nullptr) loop_->watch(fd_, *this, EPOLLIN);
}

// Discards a signal that nobody has read: the work that it should end is over.
Interrupt::~Interrupt() {
  signalfd_siginfo info{};
  while (::read(fd_, &info, sizeof info) == static_cast<ssize_t>(sizeof info)) continue;
  if (loop_ != nullptr) loop_->forget(fd_);
  if (fd_ >= 0) ::close(fd_);
  hangup_reloads = false;
  ::sigprocmask(SIG_SETMASK, &before_, nullptr);
}

void Interrupt::reload_by(std::function<void()> reload) {
  reload_ = std::move(reload);
  hangup_reloads = static_cast<bool>(reload_);
}

// True: a signal that ends the command.
bool Interrupt::take_signal() noexcept {
  signalfd_siginfo info{};
  if (::read(fd_, &info, sizeof info) != static_cast<ssize_t>(sizeof info)) return false;
  const bool reloads = info.ssi_signo == SIGHUP && reload_;
  if (reloads) reload_();
  return !reloads;
}

bool Interrupt::came() noexcept {
  came_ = came_ || run_must_end() || take_signal();
  return came_;
}

void Interrupt::ready(std::uint32_t) noexcept { static_cast<void>(came()); }

// With a loop, the loop reports a signal. Without one, look only now and then, at every 256th call.
bool Interrupt::noticed() noexcept {
  constexpr unsigned seldom = 256;
  const bool looks = loop_ == nullptr && ++asked_ % seldom == 0;
  return looks ? came() : came_ || run_must_end();
}

bool wait_until(rt::Driver& driver, Interrupt& interrupt, const rt::Driver::Predicate& over, rt::Duration most) {
  driver.run_until([&] { return over() || interrupt.noticed(); }, driver.later(most));
  return over();
}

void wait_for(rt::Driver& driver, Interrupt& interrupt, rt::Duration time) {
  wait_until(
      driver, interrupt, [] { return false; }, time);
}

bool is_ending() noexcept {
  sigset_t waiting;
  ::sigpending(&waiting);
  const bool ends = std::ranges::any_of(ending, [&](int s) {
    const bool reloads = s == SIGHUP && hangup_reloads;
    return !reloads && ::sigismember(&waiting, s) == 1;
  });
  return ends || run_must_end();
}

std::function<bool()> ended_by(std::optional<std::chrono::nanoseconds> after) {
  const auto end = after ? Clock::now() + *after : Clock::time_point::max();
  return [end] { return is_ending() || Clock::now() >= end; };
}

}  // namespace berth::cli
