/// A client of a server that runs in the same thread: a plain socket that does not block, and what turns the server's
/// loop while it waits.
#pragma once

#include <gtest/gtest.h>
#include <sys/socket.h>
#include <unistd.h>

#include <array>
#include <cerrno>
#include <functional>
#include <string>
#include <string_view>
#include <utility>

#include "berth/io/stream.hpp"

namespace berth::serve {

class ClientSocket {
 public:
  /// Turns the loops until it is so; false when it never will be.
  using Until = std::function<bool(const std::function<bool()>& done)>;

  ClientSocket(Until until, const io::Endpoint& server, int receive_buffer = 0) : until_(std::move(until)) {
    fd_ = io::begin_connect(io::look_up(server).value().front());
    if (receive_buffer > 0) ::setsockopt(fd_, SOL_SOCKET, SO_RCVBUF, &receive_buffer, sizeof receive_buffer);
  }
  ~ClientSocket() { close(); }
  ClientSocket(const ClientSocket&) = delete;
  ClientSocket& operator=(const ClientSocket&) = delete;
  void close() {
    if (fd_ >= 0) ::close(fd_);
    fd_ = -1;
  }
  /// It says no more, and still hears.
  void shut() const { ::shutdown(fd_, SHUT_WR); }

  /// As much as goes without waiting.
  std::size_t push(std::string_view text) {
    const auto n = ::send(fd_, text.data(), text.size(), MSG_NOSIGNAL | MSG_DONTWAIT);
    if (n < 0 && errno != EAGAIN) broken_ = true;
    return n > 0 ? static_cast<std::size_t>(n) : 0;
  }
  /// All of it, however long the server makes it wait; less when the server has hung up.
  void say(std::string_view text) {
    ASSERT_TRUE(until_([&] {
      text.remove_prefix(push(text));
      return text.empty() || broken_;
    }));
  }
  /// What came so far.
  const std::string& heard() {
    std::array<char, 65536> buffer;
    for (;;) {
      const auto n = ::recv(fd_, buffer.data(), buffer.size(), MSG_DONTWAIT);
      if (n == 0 || (n < 0 && errno != EAGAIN)) ended = true;
      if (n <= 0) return text_;
      text_.append(buffer.data(), static_cast<std::size_t>(n));
    }
  }
  /// Exactly this comes; then it is forgotten.
  bool hear(const std::string& expected) {
    const bool good = until_([&] { return heard().size() >= expected.size() || ended; });
    EXPECT_EQ(text_, expected);
    return good && std::exchange(text_, {}) == expected;
  }
  bool contains(const std::string& expected) {
    return until_([&] { return heard().find(expected) != std::string::npos; });
  }
  bool hung_up() {
    return until_([&] {
      heard();
      return ended;
    });
  }
  void forget() { text_.clear(); }
  [[nodiscard]] int fd() const { return fd_; }
  bool ended = false;

 private:
  Until until_;
  int fd_ = -1;
  bool broken_ = false;
  std::string text_;
};

}  // namespace berth::serve
