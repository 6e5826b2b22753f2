#include "keyboard.hpp"

#include <unistd.h>

#include <array>
#include <string_view>
#include <utility>

namespace berth::cli {
namespace {

constexpr char escape = '\x1b';
constexpr std::size_t longest_line = 512;

struct Sequence {
  std::string_view bytes;  // those after ESC
  Key key;
};
// The sequences of xterm, in both of its modes, and of the Linux console.
constexpr std::array<Sequence, 12> sequences{{{"[A", Key::up},
                                              {"[B", Key::down},
                                              {"OA", Key::up},
                                              {"OB", Key::down},
                                              {"[5~", Key::page_up},
                                              {"[6~", Key::page_down},
                                              {"[H", Key::home},
                                              {"[F", Key::end},
                                              {"OH", Key::home},
                                              {"OF", Key::end},
                                              {"[1~", Key::home},
                                              {"[4~", Key::end}}};

bool in_foreground() noexcept { return ::tcgetpgrp(STDIN_FILENO) == ::getpgrp(); }

}  // namespace

Keyboard::Keyboard(io::Loop& loop, std::function<void(Key)> key, std::function<void(const std::string&)> line,
                   std::function<void()> changed, std::function<bool(char)> alone)
    : loop_(&loop),
      key_(std::move(key)),
      line_(std::move(line)),
      changed_(std::move(changed)),
      alone_(std::move(alone)) {
  set();
  loop_->watch(STDIN_FILENO, *this, EPOLLIN);
}

Keyboard::~Keyboard() {
  loop_->forget(STDIN_FILENO);
  if (set_ && in_foreground()) ::tcsetattr(STDIN_FILENO, TCSANOW, &before_);
}

// The system stops a background process that changes the terminal.
void Keyboard::set() noexcept {
  if (!in_foreground() || ::tcgetattr(STDIN_FILENO, &before_) != 0) return;
  termios mine = before_;
  mine.c_lflag &= ~static_cast<tcflag_t>(ICANON | ECHO);
  mine.c_cc[VMIN] = 1;
  mine.c_cc[VTIME] = 0;
  set_ = ::tcsetattr(STDIN_FILENO, TCSANOW, &mine) == 0;
}

bool Keyboard::take_again() noexcept {
  termios now{};
  if (!in_foreground() || ::tcgetattr(STDIN_FILENO, &now) != 0 || (now.c_lflag & ICANON) == 0) return false;
  set();
  return true;
}

void Keyboard::ready(std::uint32_t) noexcept {
  std::array<char, 256> bytes{};
  const auto count = ::read(STDIN_FILENO, bytes.data(), bytes.size());
  if (count <= 0) return loop_->forget(STDIN_FILENO);  // the terminal is gone
  for (ssize_t i = 0; i < count; ++i) take(bytes[static_cast<std::size_t>(i)]);
  changed_();
}

void Keyboard::take(char byte) {
  constexpr char rubout = '\x7f';
  constexpr char control_u = '\x15';
  if (byte == escape || !escape_.empty()) {
    if (take_escape(byte)) return;
  }
  if (byte == '\n' || byte == '\r') {
    const std::string line = std::exchange(typed_, {});
    if (!line.empty()) line_(line);
  } else if (byte == rubout || byte == '\b') {
    rub_out();
  } else if (byte == control_u) {
    typed_.clear();
  } else if (static_cast<unsigned char>(byte) >= ' ' && typed_.size() < longest_line) {
    const bool done = typed_.empty() && alone_ && alone_(byte);
    if (!done) typed_ += byte;
  }
}

// False: the byte belongs to no key.
bool Keyboard::take_escape(char byte) {
  if (byte == escape) {
    escape_ = byte;
    return true;
  }
  escape_ += byte;
  const std::string_view bytes = std::string_view(escape_).substr(1);
  for (const auto& sequence : sequences) {
    if (sequence.bytes != bytes) continue;
    escape_.clear();
    key_(sequence.key);
    return true;
  }
  const bool begins = bytes == "[" || bytes == "O" || (bytes.front() == '[' && byte >= '0' && byte <= '?');
  if (begins && escape_.size() < 16) return true;
  const bool unknown_key = bytes.size() > 1;  // a complete sequence without a meaning here
  escape_.clear();
  return unknown_key;
}

void Keyboard::rub_out() noexcept {
  while (!typed_.empty()) {
    const auto last = static_cast<unsigned char>(typed_.back());
    typed_.pop_back();
    if ((last & 0xC0U) != 0x80U) return;
  }
}

}  // namespace berth::cli
