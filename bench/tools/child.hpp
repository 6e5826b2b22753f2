/// A child process that a bench starts: lines to it and from it, and what it costs.
#pragma once

#include <sys/types.h>

#include <chrono>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

namespace berth::bench {

/// Seconds of processor time of this process, user and system.
[[nodiscard]] double own_cpu_seconds();

class Child {
 public:
  /// Ends with this process. What it writes to standard error is shown, unless `quiet`.
  explicit Child(const std::vector<std::string>& command, bool quiet = false);
  ~Child();
  Child(const Child&) = delete;
  Child& operator=(const Child&) = delete;

  void say(std::string_view line) const;
  /// The next line of its standard output; empty: none came within this time, or it has ended.
  [[nodiscard]] std::optional<std::string> hear(std::chrono::milliseconds patience);
  /// Sends the signal and waits until the process is gone.
  void end(int signal);
  [[nodiscard]] bool is_running();
  /// Of its life, user and system.
  [[nodiscard]] double cpu_seconds() const;
  /// The most memory that was ever resident, in MiB (VmHWM).
  [[nodiscard]] double peak_mib() const;

 private:
  pid_t pid_ = -1;
  int to_ = -1;
  int from_ = -1;
  std::string heard_;
};

}  // namespace berth::bench
