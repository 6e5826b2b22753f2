/// A connection's way to the broker: TCP, or TLS over it, never blocking. Internal to room `mqtt`.
#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <tl/expected.hpp>

#include "berth/mqtt/cause.hpp"
#include "berth/mqtt/tls.hpp"

namespace berth::mqtt {

class Line {
 public:
  /// Begins to connect. `tls` null: without.
  [[nodiscard]] static tl::expected<std::unique_ptr<Line>, Cause> open(const std::string& address, std::uint16_t port,
                                                                       std::shared_ptr<Tls> tls);
  ~Line();
  Line(const Line&) = delete;
  Line& operator=(const Line&) = delete;

  [[nodiscard]] int descriptor() const noexcept { return fd_; }
  /// To be watched for these events (epoll(7)).
  [[nodiscard]] std::uint32_t events() const noexcept;
  /// TCP is connected.
  [[nodiscard]] bool has_reached() const noexcept { return reached_; }
  /// And TLS is set up: bytes can pass.
  [[nodiscard]] bool is_open() const noexcept { return open_; }
  /// Bytes wait until the system takes them.
  [[nodiscard]] bool is_writing() const noexcept { return !out_.empty(); }

  /// The descriptor has events: goes on with what was begun. A cause: it has failed.
  [[nodiscard]] std::optional<Cause> go_on() noexcept;
  /// How many bytes came; 0: none now. A cause: it is over (`Why::closed`: the peer has closed it).
  [[nodiscard]] tl::expected<std::size_t, Cause> read(std::span<char> buffer) noexcept;
  /// Sends them, or keeps what the system does not take.
  [[nodiscard]] std::optional<Cause> write(std::string_view bytes) noexcept;
  /// Nothing more will be written: the peer is told so.
  void finish() noexcept;

 private:
  Line(int fd, std::shared_ptr<Tls> tls) noexcept : tls_(std::move(tls)), fd_(fd) {}
  [[nodiscard]] std::optional<Cause> shake_hands() noexcept;
  [[nodiscard]] std::optional<Cause> flush() noexcept;
  [[nodiscard]] Cause failed(int result, int error) noexcept;

  std::shared_ptr<Tls> tls_;
  ssl_st* ssl_ = nullptr;
  TlsNews news_{};
  int fd_;
  bool reached_ = false;
  bool open_ = false;
  std::string out_;
};

}  // namespace berth::mqtt
