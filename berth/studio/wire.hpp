// A client's connection: TCP, or TLS over it. What Beast reads and writes; inside of the server's thread.
#pragma once

#include <boost/asio/ssl/context.hpp>
#include <boost/beast/core/tcp_stream.hpp>
#include <boost/beast/ssl/ssl_stream.hpp>
#include <boost/beast/websocket/ssl.hpp>
#include <utility>
#include <variant>

namespace berth::studio {

class Wire {
 public:
  using Plain = boost::beast::tcp_stream;
  using Secure = boost::beast::ssl_stream<Plain>;
  using executor_type = Plain::executor_type;  // NOLINT(readability-identifier-naming): Asio's name

  explicit Wire(Plain plain) : stream_(std::move(plain)) {}
  /// Nothing can be read before `async_handshake` is done.
  Wire(Plain plain, boost::asio::ssl::context& context)
      : stream_(std::in_place_type<Secure>, std::move(plain), context) {}

  [[nodiscard]] bool secure() const noexcept { return std::holds_alternative<Secure>(stream_); }
  [[nodiscard]] Plain& tcp() noexcept {
    auto* const secured = std::get_if<Secure>(&stream_);
    return secured != nullptr ? secured->next_layer() : *std::get_if<Plain>(&stream_);
  }
  [[nodiscard]] executor_type get_executor() noexcept { return tcp().get_executor(); }

  template <class Buffers, class Handler>
  auto async_read_some(const Buffers& buffers, Handler&& handler) {
    if (auto* const secured = std::get_if<Secure>(&stream_))
      return secured->async_read_some(buffers, std::forward<Handler>(handler));
    return std::get_if<Plain>(&stream_)->async_read_some(buffers, std::forward<Handler>(handler));
  }
  template <class Buffers, class Handler>
  auto async_write_some(const Buffers& buffers, Handler&& handler) {
    if (auto* const secured = std::get_if<Secure>(&stream_))
      return secured->async_write_some(buffers, std::forward<Handler>(handler));
    return std::get_if<Plain>(&stream_)->async_write_some(buffers, std::forward<Handler>(handler));
  }
  /// Of one that is secure.
  template <class Handler>
  void async_handshake(Handler&& handler) {
    std::get<Secure>(stream_).async_handshake(boost::asio::ssl::stream_base::server, std::forward<Handler>(handler));
  }
  template <class Handler>
  void async_shutdown(Handler&& handler) {
    std::get<Secure>(stream_).async_shutdown(std::forward<Handler>(handler));
  }

  // How a WebSocket ends its connection; Beast finds these by their arguments.
  friend void teardown(boost::beast::role_type role, Wire& wire, boost::system::error_code& error) {
    using boost::beast::websocket::teardown;
    std::visit([&](auto& stream) { teardown(role, stream, error); }, wire.stream_);
  }
  template <class Handler>
  friend void async_teardown(boost::beast::role_type role, Wire& wire, Handler&& handler) {
    using boost::beast::websocket::async_teardown;
    if (auto* const secured = std::get_if<Secure>(&wire.stream_))
      return async_teardown(role, *secured, std::forward<Handler>(handler));
    async_teardown(role, *std::get_if<Plain>(&wire.stream_), std::forward<Handler>(handler));
  }
  friend void beast_close_socket(Wire& wire) { wire.tcp().close(); }

 private:
  std::variant<Plain, Secure> stream_;
};

}  // namespace berth::studio
