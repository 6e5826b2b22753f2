/// What is typed while a live table is on the terminal: keys that move the table, and lines. The terminal's own echo is
/// off meanwhile: the table has a line for what is typed, so that no redraw erases it.
#pragma once

#include <termios.h>

#include <functional>
#include <string>

#include "berth/io/loop.hpp"

namespace berth::cli {

enum class Key : std::uint8_t { up, down, page_up, page_down, home, end };

class Keyboard final : private io::Watcher {
 public:
  /// `loop` must stay. `changed`: what is typed so far, or the table, is to be drawn anew.
  /// `alone`: a key at the beginning of a line; false: it is the line's first.
  Keyboard(io::Loop& loop, std::function<void(Key)> key, std::function<void(const std::string&)> line,
           std::function<void()> changed, std::function<bool(char)> alone);
  /// The terminal is as it was.
  ~Keyboard();
  Keyboard(const Keyboard&) = delete;
  Keyboard& operator=(const Keyboard&) = delete;

  /// Not ended with Enter yet.
  [[nodiscard]] const std::string& typed() const noexcept { return typed_; }
  /// After the process was stopped and goes on (Ctrl-Z, `fg`) the terminal has the shell's settings: true when they
  /// were wrong, and are right again.
  bool take_again() noexcept;

 private:
  void ready(std::uint32_t events) noexcept override;
  void set() noexcept;
  void take(char byte);
  [[nodiscard]] bool take_escape(char byte);
  void rub_out() noexcept;

  io::Loop* loop_;
  std::function<void(Key)> key_;
  std::function<void(const std::string&)> line_;
  std::function<void()> changed_;
  std::function<bool(char)> alone_;
  termios before_{};
  bool set_ = false;
  std::string typed_;
  std::string escape_;  // of a key that is not whole yet
};

}  // namespace berth::cli
