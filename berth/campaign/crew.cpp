#include "berth/campaign/crew.hpp"

#include <poll.h>
#include <signal.h>
#include <sys/prctl.h>
#include <sys/socket.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <cstdio>
#include <cstring>

namespace berth::campaign {
namespace {

using Clock = std::chrono::steady_clock;
constexpr std::uint32_t longest_text = 1U << 20U;

/// False: the other end is gone.
bool send_all(int fd, const void* data, std::size_t size) {
  const auto* at = static_cast<const char*>(data);
  while (size > 0) {
    const auto sent = ::send(fd, at, size, MSG_NOSIGNAL);
    if (sent < 0 && errno == EINTR) continue;
    if (sent <= 0) return false;
    at += sent;
    size -= static_cast<std::size_t>(sent);
  }
  return true;
}
bool receive_all(int fd, void* data, std::size_t size) {
  auto* at = static_cast<char*>(data);
  while (size > 0) {
    const auto got = ::recv(fd, at, size, 0);
    if (got < 0 && errno == EINTR) continue;
    if (got <= 0) return false;
    at += got;
    size -= static_cast<std::size_t>(got);
  }
  return true;
}

std::string words_for(int status) {
  if (WIFSIGNALED(status)) {
    const int signal = WTERMSIG(status);
    return "signal " + std::to_string(signal) + " (" + ::strsignal(signal) + ")";
  }
  return "exit status " + std::to_string(WIFEXITED(status) ? WEXITSTATUS(status) : status);
}

/// One process, as its parent sees it.
struct Worker {
  pid_t process = -1;  // -1: there is none
  int line = -1;
  std::optional<std::uint64_t> seed{};  // none: it waits
  Clock::time_point begun{};
};

class Crew {
 public:
  Crew(const CrewOptions& options, const SeedWork& work, const NextSeed& next, const TakeEnded& take)
      : options_(options), work_(work), next_(next), take_(take), workers_(std::max(1U, options.jobs)) {}
  ~Crew() {
    for (auto& worker : workers_) end(worker);
  }
  Crew(const Crew&) = delete;
  Crew& operator=(const Crew&) = delete;

  Result<bool> run() {
    for (auto& worker : workers_) {
      if (const int error = give(worker); error != 0) return failed(error);
    }
    while (std::ranges::any_of(workers_, [](const Worker& w) { return w.seed.has_value(); })) {
      if (!wait()) return false;
      for (auto& worker : workers_) {
        const auto ended = look(worker);
        if (!ended) continue;
        if (!take_(*ended) || options_.must_stop()) return false;
        if (const int error = give(worker); error != 0) return failed(error);
      }
    }
    return true;
  }

 private:
  static tl::unexpected<Error> failed(int error) {
    return fail({.code = Errc::io, .detail = static_cast<std::uint32_t>(error), .text = "making a process"});
  }

  /// The next seed, if there is one, and a process where the worker has none. 0, or an errno.
  int give(Worker& worker) {
    const auto seed = next_();
    if (!seed) return 0;
    if (worker.process < 0) {
      if (const int error = begin(worker); error != 0) return error;
    }
    worker.seed = seed;
    worker.begun = Clock::now();
    // A worker that died just now is noticed by its line.
    static_cast<void>(send_all(worker.line, &*seed, sizeof *seed));
    return 0;
  }

  int begin(Worker& worker) {
    std::array<int, 2> ends{};
    if (::socketpair(AF_UNIX, SOCK_STREAM | SOCK_CLOEXEC, 0, ends.data()) != 0) return errno;
    std::fflush(nullptr);
    const pid_t parent = ::getpid();
    worker.process = ::fork();
    if (worker.process == 0) work_on(ends[1], ends[0], parent);
    const int error = errno;
    ::close(ends[1]);
    worker.line = ends[0];
    if (worker.process > 0) return 0;
    end(worker);
    return error;
  }

  /// The worker's process: never returns.
  [[noreturn]] void work_on(int line, int of_parent, pid_t parent) {
    // Ctrl-C at a terminal is for the parent, which ends this; a parent that is killed takes this along.
    ::prctl(PR_SET_PDEATHSIG, SIGKILL);
    if (::getppid() != parent) ::_exit(0);
    for (const int signal : {SIGINT, SIGTERM, SIGHUP}) ::signal(signal, SIG_IGN);
    ::close(of_parent);
    for (const auto& other : workers_) {
      if (other.line >= 0) ::close(other.line);
    }
    for (const int descriptor : options_.not_for_workers) ::close(descriptor);
    std::uint64_t seed = 0;
    while (receive_all(line, &seed, sizeof seed)) {
      const std::string text = work_(seed);
      const auto size = static_cast<std::uint32_t>(std::min<std::size_t>(text.size(), longest_text));
      if (!send_all(line, &size, sizeof size) || !send_all(line, text.data(), size)) break;
    }
    ::_exit(0);
  }

  /// Until a worker may have ended its seed, or is over its limit. False: the crew is to stop.
  bool wait() {
    std::vector<pollfd> lines;
    for (const auto& worker : workers_) {
      if (worker.seed) lines.push_back({worker.line, POLLIN, 0});
    }
    if (options_.stop >= 0) lines.push_back({options_.stop, POLLIN, 0});
    const int ready = ::poll(lines.data(), lines.size(), patience());
    if (ready < 0 && errno != EINTR) return false;
    return options_.stop < 0 || ready <= 0 || lines.back().revents == 0;
  }
  /// Milliseconds until the next limit; -1: there is none.
  [[nodiscard]] int patience() const {
    if (options_.limit.count() == 0) return -1;
    auto least = Clock::now() + std::chrono::hours(1);
    for (const auto& worker : workers_) {
      if (worker.seed) least = std::min(least, worker.begun + options_.limit);
    }
    const auto left = std::chrono::ceil<std::chrono::milliseconds>(least - Clock::now()).count();
    return static_cast<int>(std::max<std::int64_t>(0, left));
  }

  /// What came of its seed; none: it still works, or has none.
  std::optional<Ended> look(Worker& worker) {
    if (!worker.seed) return std::nullopt;
    pollfd line{worker.line, POLLIN, 0};
    if (::poll(&line, 1, 0) > 0) return hear(worker);
    const bool over = options_.limit.count() > 0 && Clock::now() >= worker.begun + options_.limit;
    if (!over) return std::nullopt;
    const Ended ended{.seed = *worker.seed, .how = Ended::How::too_long, .text = {}};
    end(worker);
    return ended;
  }
  Ended hear(Worker& worker) {
    Ended ended{.seed = *worker.seed, .how = Ended::How::done, .text = {}};
    std::uint32_t size = 0;
    bool whole = receive_all(worker.line, &size, sizeof size) && size <= longest_text;
    if (whole) ended.text.resize(size);
    whole = whole && receive_all(worker.line, ended.text.data(), size);
    if (whole) {
      worker.seed.reset();
      return ended;
    }
    const int status = end(worker);
    // No mistake in a program raises SIGKILL: the system does when memory runs out, or somebody does.
    const bool killed = WIFSIGNALED(status) && WTERMSIG(status) == SIGKILL;
    ended.how = killed ? Ended::How::killed : Ended::How::died;
    ended.text = words_for(status);
    return ended;
  }

  /// Its process is killed where it lives; gives its status.
  static int end(Worker& worker) {
    if (worker.line >= 0) ::close(worker.line);
    int status = 0;
    if (worker.process > 0) {
      ::kill(worker.process, SIGKILL);
      while (::waitpid(worker.process, &status, 0) < 0 && errno == EINTR) {
      }
    }
    worker = {};
    return status;
  }

  const CrewOptions& options_;
  const SeedWork& work_;
  const NextSeed& next_;
  const TakeEnded& take_;
  std::vector<Worker> workers_;
};

}  // namespace

Result<bool> run_crew(const CrewOptions& options, const SeedWork& work, const NextSeed& next, const TakeEnded& take) {
  return Crew(options, work, next, take).run();
}

}  // namespace berth::campaign
