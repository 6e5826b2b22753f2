/// Output of a program that must not wait for its reader: a thread of its own writes it.
///
/// A write waits when a pipe or a terminal is full because its reader has stopped (Ctrl-S, a pager), when the journal
/// hangs, or when a disk is slow. The caller of `add` never does. What is kept for a reader that does not read is
/// bounded; what comes then is lost, and how many lines that were is written as soon as there is room.
///
/// Any thread may call the functions.
#pragma once

#include <chrono>
#include <cstddef>
#include <functional>
#include <memory>
#include <string>
#include <thread>

namespace berth::io {

class WriteBehind {
 public:
  struct Options {
    std::size_t most_bytes = 4U << 20;  ///< kept until they are written
    /// `finish` waits so long for a reader that takes nothing, and then leaves the rest unwritten.
    std::chrono::milliseconds patience{10'000};
    /// Where it is said that lines were lost, and in which words; without them it is not said.
    int told_at = 2;
    std::function<std::string(std::size_t lines)> lost{};
  };
  explicit WriteBehind(Options options);
  ~WriteBehind() { finish(); }
  WriteBehind(const WriteBehind&) = delete;
  WriteBehind& operator=(const WriteBehind&) = delete;

  /// False: the system has no thread for it, and nothing may be added.
  [[nodiscard]] bool good() const noexcept { return thread_.joinable(); }
  /// Writes `text` to the descriptor, after all that was added before.
  void add(int descriptor, std::string text);
  /// Waits until all is written; afterwards nothing may be added.
  void finish();
  /// `errno` of the first write to this descriptor that failed; 0: none. What comes for it afterwards is dropped.
  [[nodiscard]] int broken(int descriptor) const;

 private:
  class State;
  // The thread has it, too: one that waits for a reader for ever is left behind.
  std::shared_ptr<State> state_;
  std::thread thread_;
};

}  // namespace berth::io
