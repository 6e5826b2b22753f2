#include "port_lock.hpp"

#include <fmt/format.h>
#include <sys/socket.h>
#include <sys/un.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <cstddef>
#include <cstring>
#include <filesystem>
#include <optional>
#include <span>

#include "berth/base/crc.hpp"
#include "options.hpp"

namespace berth::cli {
namespace {

struct Address {
  sockaddr_un plain{};
  socklen_t size = 0;
};

// Resolves links, since two paths of one serial device are the same port.
std::string name_of(const can::PortSpec& port) {
  std::error_code error;
  const auto canonical = port.kind == can::PortKind::slcan ? std::filesystem::canonical(port.address, error) : "";
  return canonical.empty() ? can::to_string(port) : "slcan:" + canonical.string();
}

// A first byte of 0 makes it an abstract socket: a name in the kernel, not a file.
Address address_of(std::string name) {
  name = "berth-port-" + name;
  Address address;
  constexpr std::size_t room = sizeof address.plain.sun_path - 1;
  if (name.size() > room) {
    const void* const bytes = name.data();
    const auto sum = crc32(std::span(static_cast<const std::uint8_t*>(bytes), name.size()));
    name.replace(room - 9, std::string::npos, fmt::format("-{:08x}", sum));
  }
  address.plain.sun_family = AF_UNIX;
  std::ranges::copy(name, address.plain.sun_path + 1);
  address.size = static_cast<socklen_t>(offsetof(sockaddr_un, sun_path) + 1 + name.size());
  return address;
}

const sockaddr* plain(const Address& address) noexcept {
  const void* const bytes = &address.plain;
  return static_cast<const sockaddr*>(bytes);
}

int make_socket() noexcept { return ::socket(AF_UNIX, SOCK_STREAM | SOCK_NONBLOCK | SOCK_CLOEXEC, 0); }

// The process that listens there, from the kernel. Empty: too many processes have asked, and the kernel refuses.
std::optional<ucred> holder_of(const Address& address) noexcept {
  const int fd = make_socket();
  if (fd < 0) return std::nullopt;
  ucred who{};
  socklen_t size = sizeof who;
  const bool told =
      ::connect(fd, plain(address), address.size) == 0 && ::getsockopt(fd, SOL_SOCKET, SO_PEERCRED, &who, &size) == 0;
  ::close(fd);
  return told ? std::optional(who) : std::nullopt;
}

bool other_users(const std::optional<ucred>& holder) noexcept {
  return holder && holder->uid != ::geteuid() && holder->uid != 0;
}

// A process in another container has no process id here.
std::string words_of(const std::optional<ucred>& holder) {
  if (!holder || holder->pid == 0) return "another process of Berth";
  return other_users(holder) ? fmt::format("process {} of user {}", holder->pid, holder->uid)
                             : fmt::format("process {}", holder->pid);
}

// Length of the queue: connections of refused processes are never accepted, and stay in it until the owner ends.
constexpr int most_refused = 4096;

}  // namespace

tl::expected<PortLock, Failure> PortLock::take(const can::PortSpec& port) {
  const auto address = address_of(name_of(port));
  const int fd = make_socket();
  if (fd >= 0 && ::bind(fd, plain(address), address.size) == 0 && ::listen(fd, most_refused) == 0) return PortLock(fd);
  const int why = errno;
  if (fd >= 0) ::close(fd);
  if (why != EADDRINUSE) {
    return tl::unexpected(failure(
        Exit::failed, fmt::format("{}: the port cannot be locked: {}", can::to_string(port), std::strerror(why))));
  }
  const auto holder = holder_of(address);
  if (port.kind == can::PortKind::slcan && other_users(holder)) return PortLock(-1);
  const char* const advice =
      other_users(holder)
          ? "Have that user or root end it"
          : "Ask that one (its control socket is found by the machine's name, or give --control), or end it";
  return tl::unexpected(failure(Exit::failed, fmt::format("{} belongs to {} already: one process owns a port. {}",
                                                          can::to_string(port), words_of(holder), advice)));
}

PortLock::~PortLock() {
  if (fd_ >= 0) ::close(fd_);
}

}  // namespace berth::cli
