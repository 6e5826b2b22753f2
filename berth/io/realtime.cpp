#include "berth/io/realtime.hpp"

#include <sched.h>
#include <sys/mman.h>
#include <sys/prctl.h>

#include <cerrno>
#include <cstring>

namespace berth::io {
namespace {

std::string reason(int why, const char* remedy) {
  return std::string(std::strerror(why)) + (why == EPERM || why == ENOMEM || why == EAGAIN ? remedy : "");
}

}  // namespace

tl::expected<void, std::string> go_real_time(const RealTime& wanted) {
  if (wanted.priority < 0 || wanted.priority > 99)
    return tl::unexpected("real-time priority " + std::to_string(wanted.priority) + ": there are 1 to 99");
  if (wanted.lock_memory && ::mlockall(MCL_CURRENT | MCL_FUTURE) != 0) {
    return tl::unexpected(
        "the memory cannot be locked: " +
        reason(errno, "; run as root, or allow it: setcap cap_ipc_lock+ep PROGRAM, or ulimit -l unlimited"));
  }
  if (wanted.priority == 0) return {};
  sched_param parameter{};
  parameter.sched_priority = wanted.priority;
  if (::sched_setscheduler(0, SCHED_FIFO | SCHED_RESET_ON_FORK, &parameter) != 0) {
    const int why = errno;
    if (wanted.lock_memory) ::munlockall();
    return tl::unexpected("real-time priority " + std::to_string(wanted.priority) + ": " +
                          reason(why, "; run as root, or allow it: setcap cap_sys_nice+ep PROGRAM, or ulimit -r 99"));
  }
  ::prctl(PR_SET_TIMERSLACK, 1UL);
  return {};
}

}  // namespace berth::io
