/// A child of the test, which ends with it.
#pragma once

#include <fcntl.h>
#include <signal.h>
#include <sys/prctl.h>
#include <sys/wait.h>
#include <unistd.h>

#include <string>
#include <vector>

namespace berth::mqtt::test {

class Process {
 public:
  Process() = default;
  /// Both of its streams go to the file `log`.
  Process(const std::vector<std::string>& command, const std::string& log) : pid_(::fork()) {
    if (pid_ != 0) return;
    ::prctl(PR_SET_PDEATHSIG, SIGKILL);
    const int out = ::open(log.c_str(), O_WRONLY | O_CREAT | O_APPEND, 0600);
    const int in = ::open("/dev/null", O_RDONLY);
    ::dup2(in, 0);
    ::dup2(out, 1);
    ::dup2(out, 2);
    std::vector<char*> words;
    for (const auto& word : command) words.push_back(const_cast<char*>(word.c_str()));
    words.push_back(nullptr);
    ::execvp(words.front(), words.data());
    ::_exit(127);
  }
  /// One that exists already.
  explicit Process(pid_t pid) : pid_(pid) {}
  ~Process() { end(SIGKILL); }
  Process(const Process&) = delete;
  Process& operator=(Process&& other) noexcept {
    std::swap(pid_, other.pid_);
    return *this;
  }

  void signal(int number) const {
    if (pid_ > 0) ::kill(pid_, number);
  }
  /// Waits until it is gone.
  void end(int number) {
    if (pid_ <= 0) return;
    signal(number);
    signal(SIGCONT);
    ::waitpid(pid_, nullptr, 0);
    pid_ = -1;
  }
  [[nodiscard]] bool is_running() {
    if (pid_ <= 0) return false;
    if (::waitpid(pid_, nullptr, WNOHANG) != pid_) return true;
    pid_ = -1;
    return false;
  }

 private:
  pid_t pid_ = -1;
};

/// A command's exit status; its streams go to `log`.
inline int run(const std::vector<std::string>& command, const std::string& log) {
  std::string line;
  for (const auto& word : command) line += "'" + word + "' ";
  const int status = std::system((line + ">>'" + log + "' 2>&1").c_str());
  return WIFEXITED(status) ? WEXITSTATUS(status) : 128;
}

}  // namespace berth::mqtt::test
