/// The service manager that started this process: systemd, or another that sets NOTIFY_SOCKET (sd_notify(3)). One
/// datagram a message; systemd documents the protocol as stable and to be written without its library.
///
///     const auto manager = io::ServiceManager::of_environment();
///     if (manager) manager->tell("READY=1\nSTATUS=5 of 5 slots operational");
#pragma once

#include <chrono>
#include <optional>
#include <string>
#include <string_view>

namespace berth::io {

class ServiceManager {
 public:
  /// Empty: none started this process, or its socket cannot be used. Removes NOTIFY_SOCKET, WATCHDOG_USEC and
  /// WATCHDOG_PID from the environment: a child process must not speak for this one.
  [[nodiscard]] static std::optional<ServiceManager> of_environment();
  ServiceManager(ServiceManager&& other) noexcept;
  ServiceManager& operator=(ServiceManager&&) = delete;
  ~ServiceManager();

  /// Assignments, one a line. Does not wait: a manager that does not read loses them. False: not sent.
  bool tell(std::string_view assignments) const noexcept;
  /// RELOADING=1 with the time that the manager asks for; end it with READY=1.
  bool tell_reloading() const;
  /// The manager restarts this process if it hears no WATCHDOG=1 for this long. Empty: it does not watch.
  [[nodiscard]] std::optional<std::chrono::microseconds> watchdog() const noexcept { return watchdog_; }

 private:
  ServiceManager(int fd, std::string address, std::optional<std::chrono::microseconds> watchdog) noexcept
      : fd_(fd), address_(std::move(address)), watchdog_(watchdog) {}
  int fd_;
  std::string address_;  // as in sockaddr_un: begins with a zero byte if it is abstract
  std::optional<std::chrono::microseconds> watchdog_;
};

/// For STATUS=: one line without control characters.
[[nodiscard]] std::string status_line(std::string_view text);

/// True if the descriptor is a stream to systemd's journal (JOURNAL_STREAM, sd-daemon(3)): lines may begin with "<3>".
[[nodiscard]] bool is_journal(int fd) noexcept;

}  // namespace berth::io
