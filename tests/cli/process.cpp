#include "process.hpp"
#include "../paths.hpp"

#include <fcntl.h>
#include <poll.h>
#include <pty.h>
#include <signal.h>
#include <sys/ioctl.h>
#include <sys/wait.h>
#include <unistd.h>
#include <optional>
#include <string>
#include <vector>

#include <array>
#include <cerrno>
#include <chrono>
#include <filesystem>
#include <fstream>
#include <sstream>
#include <stdexcept>
#include <thread>

namespace berth::test {
namespace {

constexpr int two_minutes = 120'000;
constexpr std::chrono::milliseconds between_looks{20};

struct Pipe {
  int read = -1;
  int write = -1;
};

Pipe make_pipe() {
  std::array<int, 2> ends{};
  if (::pipe2(ends.data(), O_CLOEXEC) != 0) throw std::runtime_error("pipe");
  return {ends[0], ends[1]};
}

[[noreturn]] void become(const Words& arguments) {
  std::vector<char*> words;
  std::string name = berth::test::binary();
  words.push_back(name.data());
  Words copy = arguments;
  for (auto& word : copy) words.push_back(word.data());
  words.push_back(nullptr);
  ::execv(name.c_str(), words.data());
  ::_exit(127);
}

}  // namespace

bool eventually(const std::function<bool()>& so) {
  const auto end = std::chrono::steady_clock::now() + std::chrono::milliseconds(two_minutes);
  while (!so()) {
    if (std::chrono::steady_clock::now() >= end) return false;
    std::this_thread::sleep_for(between_looks);
  }
  return true;
}

Background::Background(const Words& arguments, const std::optional<OnTerminal>& terminal) {
  const Pipe err = make_pipe();
  Pipe out;
  if (terminal) {
    winsize size{};
    size.ws_row = terminal->rows;
    size.ws_col = terminal->columns;
    if (::openpty(&out.read, &out.write, nullptr, nullptr, &size) != 0) throw std::runtime_error("openpty");
    ::fcntl(out.read, F_SETFD, FD_CLOEXEC);
  } else {
    out = make_pipe();
  }
  pid_ = ::fork();
  if (pid_ == 0) {
    ::dup2(out.write, STDOUT_FILENO);
    ::dup2(terminal && terminal->errors ? out.write : err.write, STDERR_FILENO);
    if (terminal) {
      // Its own, as in a shell: who reads it must be in the foreground.
      ::setsid();
      ::ioctl(out.write, TIOCSCTTY, 0);
      ::dup2(out.write, STDIN_FILENO);
      ::close(out.write);
      if (terminal->type.empty()) ::unsetenv("TERM");
      if (!terminal->type.empty()) ::setenv("TERM", terminal->type.c_str(), 1);
      if (!terminal->colours) ::setenv("NO_COLOR", "1", 1);
    }
    become(arguments);
  }
  ::close(out.write);
  ::close(err.write);
  out_ = out.read;
  err_ = err.read;
}

Background::~Background() {
  if (pid_ > 0) {
    ::kill(pid_, SIGKILL);
    ::waitpid(pid_, nullptr, 0);
  }
  if (out_ >= 0) ::close(out_);
  if (err_ >= 0) ::close(err_);
}

void Background::signal(int number) const { ::kill(pid_, number); }

void Background::type(const std::string& text) const {
  if (::write(out_, text.data(), text.size()) < 0) throw std::runtime_error("the terminal takes nothing");
}

void Background::read_all(int timeout_ms, const std::function<bool()>& enough) {
  const auto end = std::chrono::steady_clock::now() + std::chrono::milliseconds(timeout_ms);
  while ((out_ >= 0 || err_ >= 0) && !enough()) {
    std::array<pollfd, 2> ends{{{out_, POLLIN, 0}, {err_, POLLIN, 0}}};
    const auto left = std::chrono::duration_cast<std::chrono::milliseconds>(end - std::chrono::steady_clock::now());
    if (left.count() <= 0 || ::poll(ends.data(), ends.size(), static_cast<int>(left.count())) <= 0) return;
    for (std::size_t i = 0; i < 2; ++i) {
      if ((ends[i].revents & (POLLIN | POLLHUP | POLLERR)) == 0) continue;
      std::array<char, 4096> buffer{};
      int& fd = i == 0 ? out_ : err_;
      const auto n = ::read(fd, buffer.data(), buffer.size());
      if (n > 0) {
        (i == 0 ? outcome_.out : outcome_.err).append(buffer.data(), static_cast<std::size_t>(n));
      } else {  // end, or EIO of a terminal whose program ended
        ::close(fd);
        fd = -1;
      }
    }
  }
}

Outcome Background::end() {
  read_all(two_minutes, [] { return false; });
  int status = 0;
  const bool ended = out_ < 0 && err_ < 0;
  if (!ended) ::kill(pid_, SIGKILL);
  ::waitpid(pid_, &status, 0);
  pid_ = -1;
  if (ended) outcome_.status = WIFEXITED(status) ? WEXITSTATUS(status) : 128 + WTERMSIG(status);
  return outcome_;
}

bool Background::says(const std::string& text) {
  return says([&](const std::string& so_far) { return so_far.find(text) != std::string::npos; });
}

bool Background::says(const std::function<bool(const std::string& so_far)>& enough) {
  const auto said = [&] { return enough(outcome_.out); };
  read_all(two_minutes, said);
  return said();
}

void Background::resize(unsigned short columns, unsigned short rows) const {
  winsize size{};
  size.ws_row = rows;
  size.ws_col = columns;
  ::ioctl(out_, TIOCSWINSZ, &size);
}

Outcome berth(const Words& arguments) { return Background(arguments).end(); }

Folder::Folder() {
  std::string pattern = (std::filesystem::temp_directory_path() / "berth-cli-XXXXXX").string();
  if (::mkdtemp(pattern.data()) == nullptr) throw std::runtime_error("mkdtemp");
  path_ = pattern;
}

Folder::~Folder() {
  std::error_code ignored;
  std::filesystem::remove_all(path_, ignored);
}

std::string Folder::bring(const std::string& name) const {
  namespace fs = std::filesystem;
  const fs::path to = file(name);
  fs::create_directories(to.parent_path());
  fs::copy(example(name), to, fs::copy_options::recursive | fs::copy_options::overwrite_existing);
  return to.string();
}

std::string Folder::write(const std::string& name, const std::string& text) const {
  std::ofstream(file(name), std::ios::binary) << text;
  return file(name);
}

std::string contents(const std::string& path) {
  std::ostringstream text;
  text << std::ifstream(path, std::ios::binary).rdbuf();
  return text.str();
}

bool exists(const std::string& path) { return std::filesystem::exists(path); }

std::string example(const std::string& name) { return berth::test::source_dir() + "/examples/" + name; }

}  // namespace berth::test
