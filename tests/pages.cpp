#include "pages.hpp"

#include <fcntl.h>
#include <gtest/gtest.h>
#include <poll.h>
#include <pty.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <chrono>
#include <csignal>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <functional>
#include <regex>
#include <sstream>
#include <stdexcept>
#include <utility>

#include "cli/terminal.hpp"
#include "paths.hpp"

namespace berth::test {
namespace {

namespace fs = std::filesystem;
using Clock = std::chrono::steady_clock;

constexpr std::size_t columns = 120;
constexpr std::size_t rows = 40;
/// A page breaks a long line where it ends, and not where a terminal does.
constexpr std::size_t longest_line = 1000;
/// No figure of the product: a machine that does much else needs some of it.
constexpr std::chrono::minutes patience{2};
constexpr std::chrono::milliseconds between_looks{50};
const std::string left_out = "…";

std::string contents_of(const std::string& path) {
  std::ostringstream text;
  text << std::ifstream(path, std::ios::binary).rdbuf();
  return text.str();
}

std::vector<std::string> lines_of(const std::string& text) {
  std::vector<std::string> lines;
  std::istringstream in(text);
  for (std::string line; std::getline(in, line);) {
    line.erase(line.find_last_not_of(" \r") + 1);
    lines.push_back(line);
  }
  while (!lines.empty() && lines.back().empty()) lines.pop_back();
  return lines;
}

std::string text_of(const std::vector<std::string>& lines) {
  std::string all;
  for (const auto& line : lines) all += line + "\n";
  return all;
}

/// A shell's command on a terminal of its own.
class OnPty {
 public:
  explicit OnPty(const std::string& script) {
    winsize size{};
    size.ws_row = rows;
    size.ws_col = columns;
    pid_ = ::forkpty(&fd_, nullptr, nullptr, &size);
    if (pid_ < 0) throw std::runtime_error("forkpty");
    if (pid_ != 0) return;
    ::execl("/bin/sh", "sh", "-c", script.c_str(), nullptr);
    ::_exit(127);
  }
  ~OnPty() {
    if (pid_ > 0) {
      ::kill(-pid_, SIGKILL);
      ::waitpid(pid_, nullptr, 0);
    }
    ::close(fd_);
  }
  OnPty(const OnPty&) = delete;
  OnPty& operator=(const OnPty&) = delete;

  /// Reads what comes within this time; false after its end.
  bool read_some(std::chrono::milliseconds within = between_looks) {
    pollfd one{fd_, POLLIN, 0};
    if (::poll(&one, 1, static_cast<int>(within.count())) <= 0) return true;
    std::array<char, 4096> buffer{};
    const auto n = ::read(fd_, buffer.data(), buffer.size());
    if (n <= 0) return false;
    said_.append(buffer.data(), static_cast<std::size_t>(n));
    return true;
  }
  /// `meanwhile` is called again and again.
  int wait(const std::function<void()>& meanwhile = {}) {
    const auto until = Clock::now() + patience;
    while (Clock::now() < until) {
      if (meanwhile) meanwhile();
      if (read_some()) continue;
      int status = 0;
      ::waitpid(std::exchange(pid_, -1), &status, 0);
      return WIFEXITED(status) ? WEXITSTATUS(status) : 128 + WTERMSIG(status);
    }
    return -1;
  }
  void interrupt() const {
    if (::write(fd_, "\x03", 1) != 1) throw std::runtime_error("the terminal takes nothing");
  }
  [[nodiscard]] std::string screen() const {
    Terminal terminal(longest_line, rows);
    terminal.feed(said_);
    std::string all;
    for (const auto& row : terminal.scrolled_out()) all += row + "\n";
    return all + terminal.text();
  }

 private:
  pid_t pid_ = -1;
  int fd_ = -1;
  std::string said_;
};

bool equal_from(const std::vector<std::string>& part, const std::vector<std::string>& all, std::size_t at) {
  return at + part.size() <= all.size() &&
         std::equal(part.begin(), part.end(), all.begin() + static_cast<std::ptrdiff_t>(at));
}

/// Lines that stand together, between two "…".
std::vector<std::vector<std::string>> parts_of(const std::vector<std::string>& shown) {
  std::vector<std::vector<std::string>> parts(1);
  for (const auto& line : shown) {
    if (line == left_out) {
      parts.emplace_back();
    } else {
      parts.back().push_back(line);
    }
  }
  return parts;
}

std::string not_there(const std::vector<std::string>& part, const std::string& screen) {
  std::string all = "the page shows\n";
  for (const auto& line : part) all += "  | " + line + "\n";
  all += "and what comes is\n";
  for (const auto& line : lines_of(screen)) all += "  | " + line + "\n";
  return all;
}

}  // namespace

std::optional<std::string> difference(const std::string& shown, const std::string& screen) {
  const auto real = lines_of(screen);
  const auto parts = parts_of(lines_of(shown));
  std::size_t at = 0;
  for (std::size_t i = 0; i < parts.size(); ++i) {
    const auto& part = parts[i];
    const bool last = i + 1 == parts.size();
    if (last && i > 0 && !part.empty()) {
      if (real.size() < at + part.size()) return not_there(part, screen);
      at = real.size() - part.size();
    }
    while (i > 0 && !last && at < real.size() && !equal_from(part, real, at)) ++at;
    if (!equal_from(part, real, at)) return not_there(part, screen);
    at += part.size();
    if (last && !part.empty() && at != real.size()) return not_there(part, screen);
    if (last && i == 0 && at != real.size()) return not_there(part, screen);
  }
  return std::nullopt;
}

std::string without_times(const std::string& text) {
  static const std::regex number("[0-9]+(\\.[0-9]+)?( ?)(s|ms|us|min|%|frames?/s|a second)(?![A-Za-z])");
  static const std::regex spaces("  +");
  return std::regex_replace(std::regex_replace(text, number, "#$2$3"), spaces, " ");
}

std::string without_stamps(const std::string& text) {
  static const std::regex stamp("\\([0-9]+\\.[0-9]+\\)");
  return std::regex_replace(text, stamp, "(#)");
}

std::vector<PageBlock> blocks_of(const std::string& page) {
  static const std::regex mark_form("<!-- test: (.*) -->");
  std::vector<PageBlock> blocks;
  std::istringstream in(page);
  std::size_t number = 0;
  PageBlock block;
  std::string fence;
  for (std::string line; std::getline(in, line);) {
    ++number;
    std::smatch found;
    if (!fence.empty() && line == fence) {
      blocks.push_back(std::exchange(block, {}));
      fence.clear();
    } else if (!fence.empty()) {
      block.text += line + "\n";
    } else if (line.starts_with("```")) {
      fence = "```";
      block.language = line.substr(3, line.find(' ') - 3);
      block.line = number + 1;
    } else if (std::regex_match(line, found, mark_form)) {
      block.mark = found[1];
      block.line = number;
    } else if (!block.mark.empty()) {
      blocks.push_back(std::exchange(block, {}));
    }
  }
  if (!block.mark.empty()) blocks.push_back(block);
  return blocks;
}

struct PageShell::Parts {
  std::string root;
  std::string folder;
  std::vector<std::unique_ptr<OnPty>> staying;

  [[nodiscard]] std::string script(const std::string& command) const {
    return "export HOME='" + root + "' XDG_RUNTIME_DIR='" + root + "/run' PATH='" + root +
           "/bin':$PATH TERM=xterm NO_COLOR=1 LC_ALL=C.UTF-8; cd '" + folder + "' || exit 127\n" + command +
           "\nstatus=$?; pwd > '" + root + "/cwd'; exit $status";
  }
};

PageShell::PageShell() : parts_(std::make_unique<Parts>()) {
  std::string pattern = (fs::temp_directory_path() / "berth-page-XXXXXX").string();
  if (::mkdtemp(pattern.data()) == nullptr) throw std::runtime_error("mkdtemp");
  parts_->root = pattern;
  parts_->folder = pattern;
  for (const auto* const name : {"/bin", "/run"}) fs::create_directory(pattern + name);
  fs::permissions(pattern + "/run", fs::perms::owner_all);
  fs::create_symlink(binary(), pattern + "/bin/berth");
  fs::create_symlink(source_dir(), pattern + "/berth");
  fs::create_symlink(fs::path(binary()).parent_path() / "examples/example_device", pattern + "/bin/example_device");
  // Root of the virtual machine needs none, and it may not be installed.
  std::ofstream(pattern + "/bin/sudo") << "#!/bin/sh\nexec \"$@\"\n";
  fs::permissions(pattern + "/bin/sudo", fs::perms::owner_all);
}

PageShell::~PageShell() {
  parts_->staying.clear();
  std::error_code ignored;
  fs::remove_all(parts_->root, ignored);
}

PageShell::Typed PageShell::type(const std::string& command) {
  OnPty one(parts_->script(command));
  // Nobody writes to a terminal that is not read.
  const int status = one.wait([this] {
    for (const auto& other : parts_->staying) other->read_some({});
  });
  const auto at = contents_of(parts_->root + "/cwd");
  if (!at.empty()) parts_->folder = at.substr(0, at.find('\n'));
  return {status, one.screen()};
}

void PageShell::start(const std::string& command) {
  parts_->staying.push_back(std::make_unique<OnPty>(parts_->script("exec " + command)));
}

std::string PageShell::screen() {
  if (parts_->staying.empty()) return "(no terminal stays)";
  parts_->staying.back()->read_some();
  return parts_->staying.back()->screen();
}

PageShell::Typed PageShell::end() {
  if (parts_->staying.empty()) return {};
  auto one = std::move(parts_->staying.back());
  parts_->staying.pop_back();
  one->interrupt();
  const int status = one->wait();
  return {status, one->screen()};
}

std::string PageShell::file(const std::string& name) const {
  return name.starts_with("~/") ? parts_->root + name.substr(1) : parts_->folder + "/" + name;
}

namespace {

/// One page on its way through.
class Follower {
 public:
  Follower(PageShell& shell, std::string page)
      : shell_(shell), page_(std::move(page)), updates_(std::getenv("BERTH_PAGES_UPDATE") != nullptr) {}

  void all() {
    std::string text = contents_of(page_);
    const auto blocks = blocks_of(text);
    std::size_t done = 0;
    for (const auto& block : blocks) {
      const std::string came = one(block);
      done += block.language == "console" ? 1 : 0;
      if (!updates_ || came == block.text || block.text.empty()) continue;
      const auto at = text.find("\n" + block.text + "```");
      if (at != std::string::npos) text.replace(at + 1, block.text.size(), came);
    }
    EXPECT_GT(done, 0U) << page_ << " has no block that is typed";
    if (updates_ && text != contents_of(page_)) std::ofstream(page_, std::ios::binary) << text;
  }

 private:
  void fail(const PageBlock& block, const std::string& why) const {
    ADD_FAILURE_AT(page_.c_str(), static_cast<int>(block.line)) << why;
  }
  [[nodiscard]] static bool has(const PageBlock& block, const std::string& word) {
    return (" " + block.mark + " ").find(" " + word + " ") != std::string::npos;
  }
  [[nodiscard]] static std::string after(const PageBlock& block, const std::string& word) {
    const auto at = block.mark.find(word + " ");
    return at == std::string::npos ? "" : block.mark.substr(at + word.size() + 1);
  }
  [[nodiscard]] static std::optional<std::string> differs(const PageBlock& block, const std::string& shown,
                                                          const std::string& screen) {
    if (has(block, "stamps")) return difference(without_stamps(shown), without_stamps(screen));
    return has(block, "times") ? difference(without_times(shown), without_times(screen)) : difference(shown, screen);
  }

  /// Does the block; its text as it should be.
  std::string one(const PageBlock& block) {
    if (block.mark == "ctrl-c") {
      (void)shell_.end();
    } else if (const auto written = after(block, "write"); !written.empty()) {
      std::ofstream(shell_.file(written), std::ios::binary) << block.text;
    } else if (const auto shown = after(block, "shown"); !shown.empty()) {
      return compared(block, block.text, contents_of(shell_.file(shown)));
    } else if (has(block, "screen")) {
      return awaited(block, block.text);
    } else if (block.language == "console" && !has(block, "not run")) {
      return typed(block);
    }
    return block.text;
  }

  /// The shown text, or when pages are updated what came in its place.
  std::string compared(const PageBlock& block, const std::string& shown, const std::string& screen) const {
    const auto why = differs(block, shown, screen);
    if (!why) return shown;
    if (!updates_ || shown.find(left_out) != std::string::npos) {
      fail(block, *why);
      return shown;
    }
    return text_of(lines_of(screen));
  }

  /// As `compared`, of the terminal that stays: until it shows this. A screen that is to be written is what it shows
  /// after a while.
  std::string awaited(const PageBlock& block, const std::string& shown) {
    const bool empty = updates_ && shown.empty();
    const std::string part = left_out + "\n" + shown + left_out + "\n";
    const auto until = Clock::now() + (updates_ ? std::chrono::seconds(20) : std::chrono::seconds(patience));
    std::optional<std::string> why;
    do {
      why = differs(block, part, shell_.screen());
    } while ((why || empty) && Clock::now() < until);
    if (!why && !empty) return shown;
    if (!empty) fail(block, *why);
    return empty ? text_of(lines_of(shell_.screen())) : shown;
  }

  std::string typed(const PageBlock& block) {
    std::string all;
    std::string command;
    std::string shown;
    const auto finish = [&](bool last) {
      if (!command.empty()) all += "$ " + command + "\n" + typed(block, command, shown, last);
      command.clear();
      shown.clear();
    };
    for (std::istringstream in(block.text); in.good();) {
      std::string line;
      if (!std::getline(in, line)) break;
      if (line.starts_with("$ ")) {
        finish(false);
        command = line.substr(2);
      } else if (command.ends_with("\\") && shown.empty()) {
        command += "\n" + line;
      } else {
        shown += line + "\n";
      }
    }
    finish(true);
    return all;
  }

  std::string typed(const PageBlock& block, const std::string& command, const std::string& shown, bool last) {
    if (has(block, "stays")) {
      shell_.start(command);
      return awaited(block, shown);
    }
    const auto ran = shell_.type(command);
    const auto status = after(block, "status");
    const int wanted = last ? std::atoi(status.c_str()) : 0;
    if (ran.status != wanted) {
      fail(block, command + "\nends with status " + std::to_string(ran.status) + ":\n" + ran.screen);
    }
    return compared(block, shown, ran.screen);
  }

  PageShell& shell_;
  std::string page_;
  bool updates_;
};

}  // namespace

void follow(PageShell& shell, const std::string& page) { Follower(shell, source_dir() + "/" + page).all(); }

}  // namespace berth::test
