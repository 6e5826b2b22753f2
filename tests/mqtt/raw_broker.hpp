/// A server that is no broker: the test reads and writes its bytes.
#pragma once

#include <gtest/gtest.h>
#include <poll.h>

#include <array>
#include <cstdint>
#include <optional>
#include <string>
#include <string_view>

#include "broker.hpp"

namespace berth::mqtt::test {

/// One packet of MQTT as it came.
struct Packet {
  std::uint8_t type = 0;  // with its flags
  std::string body{};
  [[nodiscard]] unsigned kind() const { return type >> 4U; }
};

inline constexpr unsigned connect_packet = 1, publish_packet = 3, subscribe_packet = 8, disconnect_packet = 14;

class Socket {
 public:
  explicit Socket(int fd) : fd_(fd) {}
  Socket(Socket&& other) noexcept : fd_(std::exchange(other.fd_, -1)) {}
  ~Socket() { close(); }
  void close() {
    if (fd_ >= 0) ::close(std::exchange(fd_, -1));
  }
  /// False: the peer is gone.
  bool say(std::string_view text) const {
    while (!text.empty()) {
      const auto sent = ::send(fd_, text.data(), text.size(), MSG_NOSIGNAL);
      if (sent <= 0) return false;
      text.remove_prefix(static_cast<std::size_t>(sent));
    }
    return true;
  }
  /// Empty: the peer ended the connection, or nothing came.
  [[nodiscard]] std::optional<std::string> hear(std::size_t count) const {
    std::string text;
    while (text.size() < count) {
      pollfd waits{fd_, POLLIN, 0};
      std::array<char, 4096> piece{};
      if (::poll(&waits, 1, static_cast<int>(std::chrono::milliseconds(patience).count())) != 1) return std::nullopt;
      const auto got = ::recv(fd_, piece.data(), std::min(piece.size(), count - text.size()), 0);
      if (got <= 0) return std::nullopt;
      text.append(piece.data(), static_cast<std::size_t>(got));
    }
    return text;
  }
  [[nodiscard]] std::optional<Packet> packet() const {
    const auto head = hear(1);
    if (!head) return std::nullopt;
    std::size_t length = 0;
    for (unsigned shift = 0;; shift += 7) {
      const auto next = hear(1);
      if (!next || shift > 21) return std::nullopt;
      const auto value = static_cast<unsigned char>(next->front());
      length |= std::size_t{value & 127U} << shift;
      if ((value & 128U) == 0) break;
    }
    auto body = hear(length);
    if (!body) return std::nullopt;
    return Packet{static_cast<std::uint8_t>(head->front()), std::move(*body)};
  }
  /// The peer has ended the connection; what it says before is passed over.
  [[nodiscard]] bool is_ended() const {
    while (hear(1)) {
    }
    std::array<char, 1> none{};
    return ::recv(fd_, none.data(), 1, MSG_DONTWAIT) == 0 || errno == ECONNRESET;
  }

 private:
  int fd_;
};

class RawBroker {
 public:
  RawBroker() : fd_(::socket(AF_INET, SOCK_STREAM | SOCK_CLOEXEC, 0)) {
    EXPECT_TRUE(name_socket(::bind, fd_, 0) && ::listen(fd_, 16) == 0);
  }
  ~RawBroker() { ::close(fd_); }
  RawBroker(const RawBroker&) = delete;
  RawBroker& operator=(const RawBroker&) = delete;
  [[nodiscard]] Where where() const { return {false, "127.0.0.1", port_of(fd_)}; }
  /// The next client; its first packet was not read.
  [[nodiscard]] Socket accept() const {
    pollfd waits{fd_, POLLIN, 0};
    EXPECT_EQ(::poll(&waits, 1, static_cast<int>(std::chrono::milliseconds(patience).count())), 1);
    return Socket(::accept4(fd_, nullptr, nullptr, SOCK_CLOEXEC));
  }

 private:
  int fd_;
};

using std::string_view_literals::operator""sv;
inline constexpr auto connack_3 = "\x20\x02\x00\x00"sv;      // accepted, as 3.1.1 says it
inline constexpr auto connack_5 = "\x20\x03\x00\x00\x00"sv;  // accepted, no properties

}  // namespace berth::mqtt::test
