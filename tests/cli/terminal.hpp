/// The screen of a terminal, as far as `berth` uses one: text, line feeds, cursor up and down, erasing, colours. What a
/// program writes is fed in, and the screen can be compared.
#pragma once

#include <algorithm>
#include <cstdlib>
#include <stdexcept>
#include <string>
#include <vector>

namespace berth::test {

/// ASCII only; anything that it does not know throws.
class Terminal {
 public:
  Terminal(std::size_t columns, std::size_t rows) : columns_(columns), screen_(rows, std::string(columns, ' ')) {}

  void feed(const std::string& bytes) {
    for (const char c : bytes) take(c);
  }
  /// Without spaces at the end.
  [[nodiscard]] std::string row(std::size_t i) const {
    const auto end = screen_[i].find_last_not_of(' ');
    return end == std::string::npos ? "" : screen_[i].substr(0, end + 1);
  }
  /// All rows.
  [[nodiscard]] std::string text() const {
    std::string all;
    for (std::size_t i = 0; i < screen_.size(); ++i) all += row(i) + "\n";
    return all;
  }
  /// Rows that went out at the top, oldest first.
  [[nodiscard]] const std::vector<std::string>& scrolled_out() const noexcept { return out_; }

 private:
  void take(char c) {
    if (!escape_.empty()) return take_escape(c);
    if (c == '\x1b') {
      escape_ = c;
    } else if (c == '\n') {
      next_row();
    } else if (c == '\r') {
      x_ = 0;
    } else {
      if (x_ == columns_) {
        x_ = 0;
        next_row();
      }
      screen_[y_][x_++] = c;
    }
  }
  void next_row() {
    if (++y_ < screen_.size()) return;
    y_ = screen_.size() - 1;
    out_.push_back(row(0));
    screen_.erase(screen_.begin());
    screen_.emplace_back(columns_, ' ');
  }
  void take_escape(char c) {
    escape_ += c;
    if (c == '[' || (c >= '0' && c <= '9') || c == ';') return;
    const auto count = static_cast<std::size_t>(std::max(1, std::atoi(escape_.c_str() + 2)));
    escape_.clear();
    switch (c) {
      case 'A': y_ -= std::min(y_, count); break;
      case 'B': y_ = std::min(y_ + count, screen_.size() - 1); break;
      case 'K': std::fill(screen_[y_].begin() + static_cast<std::ptrdiff_t>(x_), screen_[y_].end(), ' '); break;
      case 'J':
        std::fill(screen_[y_].begin() + static_cast<std::ptrdiff_t>(x_), screen_[y_].end(), ' ');
        for (std::size_t i = y_ + 1; i < screen_.size(); ++i) screen_[i].assign(columns_, ' ');
        break;
      case 'm': break;
      default: throw std::runtime_error("the terminal of the tests does not know this escape sequence");
    }
  }

  std::size_t columns_;
  std::vector<std::string> screen_;
  std::vector<std::string> out_;
  std::size_t x_ = 0;
  std::size_t y_ = 0;
  std::string escape_;
};

}  // namespace berth::test
