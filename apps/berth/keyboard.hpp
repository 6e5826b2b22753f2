/// Input while a live table is on the terminal: keys that scroll the table, and lines. The terminal's echo is off
/// meanwhile: the table has a line that shows what is typed, so that no redraw erases it.
#pragma once

#include <termios.h>

#include <functional>
#include <string>

#include "berth/io/loop.hpp"

namespace berth::cli {

enum class Key : std::uint8_t { up, down, page_up, page_down, home, end };

class Keyboard final : private io::Watcher {
 public:
  /// `loop` must outlive it. `changed`: redraw, because what is typed or the table has changed. `alone`: handles a key
  /// at the beginning of a line; false: the key is the line's first.
  Keyboard(io::Loop& loop, std::function<void(Key)> key, std::function<void(const std::string&)> line,
           std::function<void()> changed, std::function<bool(char)> alone);
  /// Restores the terminal.
  ~Keyboard();
  Keyboard(const Keyboard&) = delete;
  Keyboard& operator=(const Keyboard&) = delete;

  /// What is typed and not ended with Enter yet.
  [[nodiscard]] const std::string& typed() const noexcept { return typed_; }
  /// After a stop of the process (Ctrl-Z, `fg`) the terminal has the shell's settings. True when they were wrong and
  /// are corrected.
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
  std::string escape_;  // of an incomplete escape sequence
};

}  // namespace berth::cli
