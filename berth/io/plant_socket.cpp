#include "berth/io/plant_socket.hpp"

#include <sys/epoll.h>
#include <sys/socket.h>
#include <unistd.h>

#include <array>
#include <cerrno>
#include <cstring>

namespace berth::io {

bool address_of(const std::string& path, sockaddr_un& address) noexcept {
  address = {};
  address.sun_family = AF_UNIX;
  if (path.empty() || path.size() >= sizeof address.sun_path) return false;
  std::memcpy(address.sun_path, path.data(), path.size());
  return true;
}

PlantSocket::PlantSocket(Loop& loop, int fd, Watcher& watcher) : loop_(&loop), fd_(fd), watcher_(&watcher) {
  if (!loop_->watch(fd_, watcher, EPOLLIN)) closing_ = true;
}

PlantSocket::~PlantSocket() { close(); }

void PlantSocket::close() noexcept {
  if (fd_ < 0) return;
  loop_->forget(fd_);
  ::close(fd_);
  fd_ = -1;
  closing_ = true;
}

// The descriptor stays, shut down, so that the loop informs the owner outside of jobs.
void PlantSocket::give_up() noexcept {
  closing_ = true;
  waiting_.clear();
  if (fd_ >= 0) ::shutdown(fd_, SHUT_RDWR);
}

bool PlantSocket::put(const std::vector<std::uint8_t>& packet) {
  for (;;) {
    const auto n = ::send(fd_, packet.data(), packet.size(), MSG_NOSIGNAL | MSG_DONTWAIT);
    if (n >= 0) ++taken_;
    if (n >= 0) return true;
    if (errno == EINTR) continue;
    if (errno != EAGAIN && errno != EWOULDBLOCK && errno != ENOBUFS) give_up();
    return false;
  }
}

bool PlantSocket::send(const Message& message) {
  if (fd_ < 0 || closing_) return false;
  auto packet = encode(message);
  if (waiting_.empty() && put(packet)) return true;
  if (closing_) return false;
  if (waiting_.size() >= most_waiting) {
    give_up();
    return false;
  }
  if (waiting_.empty() && !loop_->watch(fd_, *watcher_, EPOLLIN | EPOLLOUT)) give_up();
  waiting_.push_back(std::move(packet));
  return !closing_;
}

bool PlantSocket::flush() {
  while (!waiting_.empty() && fd_ >= 0 && !closing_) {
    if (!put(waiting_.front())) return !closing_;
    waiting_.pop_front();
  }
  if (fd_ >= 0 && !closing_ && !loop_->watch(fd_, *watcher_, EPOLLIN)) give_up();
  return !closing_;
}

std::optional<Message> PlantSocket::receive() {
  std::array<std::uint8_t, longest_message + 1> buffer;  // one byte more shows that a packet is too long
  while (fd_ >= 0 && !closing_) {
    const auto n = ::recv(fd_, buffer.data(), buffer.size(), MSG_DONTWAIT);
    if (n < 0 && errno == EINTR) continue;
    if (n < 0 && (errno == EAGAIN || errno == EWOULDBLOCK)) return std::nullopt;
    if (n > 0) {
      auto message = decode({buffer.data(), static_cast<std::size_t>(n)});
      if (message) return message;
    }
    give_up();
  }
  return std::nullopt;
}

}  // namespace berth::io
