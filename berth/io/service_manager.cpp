#include "berth/io/service_manager.hpp"

#include <fmt/format.h>
#include <sys/socket.h>
#include <sys/stat.h>
#include <sys/un.h>
#include <unistd.h>

#include <charconv>
#include <cstddef>
#include <cstdlib>
#include <cstring>
#include <ctime>
#include <utility>

namespace berth::io {
namespace {

std::string taken(const char* name) {
  const char* const value = std::getenv(name);
  std::string text = value != nullptr ? value : "";
  ::unsetenv(name);
  return text;
}

template <class Number>
std::optional<Number> number(std::string_view text) noexcept {
  Number value{};
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), value);
  if (error != std::errc() || end != text.data() + text.size()) return {};
  return value;
}

// The watchdog may be meant for another process of the unit.
std::optional<std::chrono::microseconds> watchdog_of(std::string_view microseconds, std::string_view process) noexcept {
  const auto period = number<std::int64_t>(microseconds);
  if (!period || *period <= 0) return {};
  if (!process.empty() && number<pid_t>(process) != ::getpid()) return {};
  return std::chrono::microseconds(*period);
}

// "@name" is an abstract address, "/path" a file.
std::string address_of(std::string text) noexcept {
  const bool usable =
      text.size() > 1 && text.size() < sizeof(sockaddr_un::sun_path) && (text[0] == '/' || text[0] == '@');
  if (!usable) return {};
  if (text[0] == '@') text[0] = '\0';
  return text;
}

}  // namespace

std::optional<ServiceManager> ServiceManager::of_environment() {
  std::string address = address_of(taken("NOTIFY_SOCKET"));
  const std::string microseconds = taken("WATCHDOG_USEC");
  const std::string process = taken("WATCHDOG_PID");
  if (address.empty()) return {};
  const int fd = ::socket(AF_UNIX, SOCK_DGRAM | SOCK_CLOEXEC | SOCK_NONBLOCK, 0);
  if (fd < 0) return {};
  return ServiceManager(fd, std::move(address), watchdog_of(microseconds, process));
}

ServiceManager::ServiceManager(ServiceManager&& other) noexcept
    : fd_(std::exchange(other.fd_, -1)), address_(std::move(other.address_)), watchdog_(other.watchdog_) {}

ServiceManager::~ServiceManager() {
  if (fd_ >= 0) ::close(fd_);
}

bool ServiceManager::tell(std::string_view assignments) const noexcept {
  sockaddr_un to{};
  to.sun_family = AF_UNIX;
  std::memcpy(to.sun_path, address_.data(), address_.size());
  const auto length = static_cast<socklen_t>(offsetof(sockaddr_un, sun_path) + address_.size());
  const auto sent = ::sendto(fd_, assignments.data(), assignments.size(), MSG_NOSIGNAL,
                             reinterpret_cast<const sockaddr*>(&to), length);
  return sent == static_cast<ssize_t>(assignments.size());
}

bool ServiceManager::tell_reloading() const {
  timespec now{};
  ::clock_gettime(CLOCK_MONOTONIC, &now);
  return tell(fmt::format("RELOADING=1\nMONOTONIC_USEC={}",
                          static_cast<std::int64_t>(now.tv_sec) * 1'000'000 + now.tv_nsec / 1000));
}

std::string status_line(std::string_view text) {
  std::string line(text);
  for (char& c : line) {
    const auto byte = static_cast<unsigned char>(c);
    if (byte < 0x20 || byte == 0x7F) c = ' ';
  }
  return line;
}

bool is_journal(int fd) noexcept {
  const char* const stream = std::getenv("JOURNAL_STREAM");
  if (stream == nullptr) return false;
  const std::string_view text(stream);
  const auto colon = text.find(':');
  if (colon == std::string_view::npos) return false;
  const auto device = number<dev_t>(text.substr(0, colon));
  const auto inode = number<ino_t>(text.substr(colon + 1));
  struct stat there {};
  return device && inode && ::fstat(fd, &there) == 0 && there.st_dev == *device && there.st_ino == *inode;
}

}  // namespace berth::io
