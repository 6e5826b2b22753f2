/// A `berth` that runs beside a test, with what it says so far.
#pragma once

#include <fcntl.h>
#include <sys/wait.h>
#include <unistd.h>

#include <chrono>
#include <csignal>
#include <filesystem>
#include <fstream>
#include <functional>
#include <sstream>
#include <string>
#include <thread>
#include <vector>

#include "../paths.hpp"

namespace berth::test {

/// Everything in the machine takes 15 to 30 times longer than outside.
constexpr std::chrono::seconds patience{120};

/// Looks again and again until it is so, or so much time has passed that it never will be.
inline bool eventually(const std::function<bool()>& so, std::chrono::seconds most = patience) {
  const auto end = std::chrono::steady_clock::now() + most;
  while (!so()) {
    if (std::chrono::steady_clock::now() >= end) return false;
    std::this_thread::sleep_for(std::chrono::milliseconds(50));  // between two looks
  }
  return true;
}

/// A folder that goes with its object.
class Place {
 public:
  Place() {
    std::string name = "/tmp/berth-vm-XXXXXX";
    path_ = ::mkdtemp(name.data());
  }
  ~Place() { std::filesystem::remove_all(path_); }
  Place(const Place&) = delete;
  Place& operator=(const Place&) = delete;
  [[nodiscard]] std::string file(const std::string& name) const { return path_ + "/" + name; }
  std::string write(const std::string& name, const std::string& text) const {
    std::ofstream(file(name)) << text;
    return file(name);
  }

 private:
  std::string path_;
};

inline std::string read_whole(const std::string& path) {
  std::ostringstream text;
  text << std::ifstream(path).rdbuf();
  return text.str();
}

class Running {
 public:
  /// Its two streams go to NAME.out and NAME.err in `place`.
  Running(const Place& place, const std::string& name, std::vector<std::string> words)
      : out_(place.file(name + ".out")), err_(place.file(name + ".err")) {
    words.insert(words.begin(), berth::test::binary());
    std::vector<char*> argv;
    for (auto& word : words) argv.push_back(word.data());
    argv.push_back(nullptr);
    pid_ = ::fork();
    if (pid_ != 0) return;
    constexpr int flags = O_WRONLY | O_CREAT | O_TRUNC;
    ::dup2(::open(out_.c_str(), flags, 0600), 1);
    ::dup2(::open(err_.c_str(), flags, 0600), 2);
    ::execv(argv[0], argv.data());
    ::_exit(127);
  }
  ~Running() { kill(); }
  Running(const Running&) = delete;
  Running& operator=(const Running&) = delete;

  [[nodiscard]] pid_t pid() const { return pid_; }
  void signal(int number) const {
    if (pid_ > 0) ::kill(pid_, number);
  }
  void kill() {
    signal(SIGKILL);
    wait();
  }
  /// Its exit status, 128 + signal; -1 when it does not end.
  int wait() {
    if (pid_ <= 0) return status_;
    int raw = 0;
    if (!eventually([&] { return ::waitpid(pid_, &raw, WNOHANG) == pid_; })) return -1;
    pid_ = -1;
    return status_ = WIFEXITED(raw) ? WEXITSTATUS(raw) : 128 + WTERMSIG(raw);
  }
  [[nodiscard]] bool running() {
    if (pid_ <= 0) return false;
    int raw = 0;
    if (::waitpid(pid_, &raw, WNOHANG) != pid_) return true;
    pid_ = -1;
    status_ = WIFEXITED(raw) ? WEXITSTATUS(raw) : 128 + WTERMSIG(raw);
    return false;
  }
  [[nodiscard]] std::string out() const { return read_whole(out_); }
  [[nodiscard]] std::string err() const { return read_whole(err_); }
  /// Waits until it has said so on standard output; false also when it ended without.
  bool says(const std::string& text) {
    bool alive = true;
    return eventually([&] {
             alive = alive && running();
             return !alive || out().find(text) != std::string::npos;
           }) &&
           out().find(text) != std::string::npos;
  }

 private:
  pid_t pid_ = -1;
  int status_ = -1;
  std::string out_, err_;
};

}  // namespace berth::test
