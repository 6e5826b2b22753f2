#include "berth/io/netlink_socket.hpp"

#include <linux/netlink.h>
#include <linux/rtnetlink.h>
#include <poll.h>
#include <sys/socket.h>
#include <unistd.h>

#include <cerrno>
#include <cstring>

namespace berth::io {
namespace {

constexpr int patience_ms = 10'000;  // bringing up a USB adapter takes up to some seconds

int open_socket(bool watches) noexcept {
  const int fd = ::socket(AF_NETLINK, SOCK_RAW | SOCK_CLOEXEC | SOCK_NONBLOCK, NETLINK_ROUTE);
  if (fd < 0) return -1;
  const int one = 1;
  ::setsockopt(fd, SOL_NETLINK, NETLINK_EXT_ACK, &one, sizeof one);
  ::setsockopt(fd, SOL_NETLINK, NETLINK_CAP_ACK, &one, sizeof one);
  sockaddr_nl address{};
  address.nl_family = AF_NETLINK;
  address.nl_groups = watches ? RTMGRP_LINK : 0;
  const void* const plain = &address;
  if (::bind(fd, static_cast<const sockaddr*>(plain), sizeof address) == 0) return fd;
  const int why = errno;
  ::close(fd);
  errno = why;
  return -1;
}

bool send_to_kernel(int fd, const std::vector<std::uint8_t>& request) noexcept {
  return !request.empty() && ::send(fd, request.data(), request.size(), 0) == static_cast<ssize_t>(request.size());
}

// -1 with EAGAIN if there is nothing. Only the kernel has port 0; other processes could send, too.
ssize_t receive_from_kernel(int fd, std::vector<std::uint8_t>& buffer) noexcept {
  for (;;) {
    sockaddr_nl from{};
    socklen_t size = sizeof from;
    void* const plain = &from;
    const auto n = ::recvfrom(fd, buffer.data(), buffer.size(), MSG_DONTWAIT, static_cast<sockaddr*>(plain), &size);
    if (n < 0 && errno == EINTR) continue;
    if (n >= 0 && from.nl_pid != 0) continue;
    return n;
  }
}

Refusal refusal(int error, const std::string& text = {}) {
  return {error, text.empty() ? std::strerror(error) : std::string(std::strerror(error)) + " (" + text + ")"};
}

// The first notice that answers the request.
tl::expected<LinkNotice, Refusal> converse(const std::vector<std::uint8_t>& request, std::uint32_t sequence) {
  const int fd = open_socket(false);
  if (fd < 0) return tl::unexpected(refusal(errno));
  const auto ends = [fd](auto answer) {
    ::close(fd);
    return answer;
  };
  using Answer = tl::expected<LinkNotice, Refusal>;
  if (request.empty()) return ends(Answer(tl::unexpected(refusal(ENODEV))));
  if (!send_to_kernel(fd, request)) return ends(Answer(tl::unexpected(refusal(errno))));
  std::vector<std::uint8_t> buffer(longest_packet);
  for (;;) {
    pollfd wait{fd, POLLIN, 0};
    const int ready = ::poll(&wait, 1, patience_ms);
    if (ready < 0 && errno == EINTR) continue;
    if (ready <= 0) return ends(Answer(tl::unexpected(refusal(ETIMEDOUT))));
    const auto n = receive_from_kernel(fd, buffer);
    if (n < 0 && errno == EAGAIN) continue;
    if (n < 0) return ends(Answer(tl::unexpected(refusal(errno))));
    for (auto& notice : decode_links({buffer.data(), static_cast<std::size_t>(n)})) {
      if (notice.sequence == sequence && notice.kind != LinkNotice::Kind::other) return ends(Answer(std::move(notice)));
    }
  }
}

}  // namespace

bool Refusal::not_allowed() const noexcept { return error == EPERM || error == EACCES; }

bool LinkWatch::open() noexcept {
  close();
  fd_ = open_socket(true);
  return fd_ >= 0;
}

void LinkWatch::close() noexcept {
  if (fd_ >= 0) ::close(fd_);
  fd_ = -1;
}

bool LinkWatch::ask(std::uint32_t sequence, const std::string& name) noexcept {
  return send_to_kernel(fd_, ask_link(sequence, name));
}

std::optional<LinkWatch::Heard> LinkWatch::receive() {
  buffer_.resize(longest_packet);
  const auto n = receive_from_kernel(fd_, buffer_);
  if (n < 0 && errno == ENOBUFS) return Heard{{}, true};
  if (n <= 0) return std::nullopt;
  return Heard{decode_links({buffer_.data(), static_cast<std::size_t>(n)}), false};
}

tl::expected<Link, Refusal> read_link(const std::string& name) {
  auto answer = converse(ask_link(1, name), 1);
  if (!answer) return tl::unexpected(std::move(answer.error()));
  if (answer->kind == LinkNotice::Kind::link) return std::move(answer->link);
  return tl::unexpected(refusal(answer->error != 0 ? answer->error : ENODEV, answer->text));
}

tl::expected<void, Refusal> apply(int index, const LinkChange& change) {
  const auto answer = converse(change_link(2, index, change), 2);
  if (!answer) return tl::unexpected(answer.error());
  if (answer->error != 0) return tl::unexpected(refusal(answer->error, answer->text));
  return {};
}

}  // namespace berth::io
