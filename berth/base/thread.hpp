/// A thread that takes no signal: signals are for the threads that wait for them.
#pragma once

#include <pthread.h>

#include <csignal>
#include <system_error>
#include <thread>
#include <utility>

namespace berth {

/// Not joinable: the system has no thread for it.
template <class Run>
[[nodiscard]] std::thread thread_without_signals(Run run) {
  sigset_t all{}, before{};
  ::sigfillset(&all);
  ::pthread_sigmask(SIG_SETMASK, &all, &before);
  std::thread thread;
  try {
    thread = std::thread(std::move(run));
  } catch (const std::system_error&) {  // the caller sees that it is not joinable
  }
  ::pthread_sigmask(SIG_SETMASK, &before, nullptr);
  return thread;
}

}  // namespace berth
