#include "berth/io/realtime.hpp"

#include <gtest/gtest.h>
#include <sched.h>
#include <sys/resource.h>
#include <sys/wait.h>
#include <unistd.h>
#include <string>

extern "C" __attribute__((weak)) void __asan_init();
extern "C" __attribute__((weak)) void __tsan_init();

namespace berth::io {
namespace {

// With a sanitizer mlockall does nothing, and that well.
bool locks_memory() { return __asan_init == nullptr && __tsan_init == nullptr; }

// In a process of its own, as what it changes stays. 0: everything was as it should.
int in_child(int (*body)()) {
  const pid_t child = ::fork();
  if (child == 0) ::_exit(body());
  int status = 0;
  ::waitpid(child, &status, 0);
  return WIFEXITED(status) ? WEXITSTATUS(status) : -1;
}

TEST(RealTime, PrioritiesThatThereAreNotAreRefused) {
  for (const int wrong : {-1, 100}) {
    const auto done = go_real_time({.priority = wrong});
    ASSERT_FALSE(done);
    EXPECT_NE(done.error().find(std::to_string(wrong)), std::string::npos);
  }
  EXPECT_TRUE(go_real_time({}));
}

// As whoever may do nothing: the error says what would help, and nothing was changed.
TEST(RealTime, WithoutTheRightItSaysWhatWouldHelp) {
  EXPECT_EQ(in_child([] {
              const rlimit none{0, 0};
              ::setrlimit(RLIMIT_RTPRIO, &none);
              ::setrlimit(RLIMIT_MEMLOCK, &none);
              if (::geteuid() == 0 && ::setuid(65534) != 0) return 1;
              const auto priority = go_real_time({.priority = 40});
              if (priority || priority.error().find("cap_sys_nice") == std::string::npos) return 2;
              if (!locks_memory()) return 0;
              const auto memory = go_real_time({.lock_memory = true});
              if (memory || memory.error().find("cap_ipc_lock") == std::string::npos) return 3;
              return ::sched_getscheduler(0) == SCHED_OTHER ? 0 : 4;
            }),
            0);
}

TEST(RealTime, WithTheRightItIsSo) {
  const int seen = in_child([] {
    const auto done = go_real_time({.priority = 10});
    if (!done) return 77;
    sched_param now{};
    ::sched_getparam(0, &now);
    return (::sched_getscheduler(0) & ~SCHED_RESET_ON_FORK) == SCHED_FIFO && now.sched_priority == 10 ? 0 : 1;
  });
  if (seen == 77) GTEST_SKIP() << "needs root: this system gives no real-time priority";
  EXPECT_EQ(seen, 0);
}

}  // namespace
}  // namespace berth::io
