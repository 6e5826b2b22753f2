// A client's connection: TCP, or TLS over it, with Beast's interface. Internal to the server's thread.
//
// Beast instantiates an operation for each type of buffers and handler given to a stream. A `Wire` uses one type each
// for reads and writes, so TCP and TLS are compiled once and not some fifty times: this halves time and memory for
// client.cpp.
#pragma once

#include <boost/asio/buffer.hpp>
#include <boost/asio/ssl/context.hpp>
#include <boost/beast/core/tcp_stream.hpp>
#include <boost/beast/ssl/ssl_stream.hpp>
#include <boost/beast/websocket/teardown.hpp>
#include <functional>
#include <memory>
#include <utility>
#include <variant>
#include <vector>

namespace berth::studio {

class Wire {
 public:
  using Plain = boost::beast::tcp_stream;
  using Secure = boost::beast::ssl_stream<Plain>;
  using Code = boost::system::error_code;
  using executor_type = Plain::executor_type;  // NOLINT(readability-identifier-naming): Asio's name

  explicit Wire(Plain plain) : stream_(std::move(plain)) {}
  /// Nothing can be read before `handshake` is done.
  Wire(Plain plain, boost::asio::ssl::context& context)
      : stream_(std::in_place_type<Secure>, std::move(plain), context) {}

  [[nodiscard]] bool secure() const noexcept { return std::holds_alternative<Secure>(stream_); }
  [[nodiscard]] Plain& tcp() noexcept {
    auto* const secured = std::get_if<Secure>(&stream_);
    return secured != nullptr ? secured->next_layer() : *std::get_if<Plain>(&stream_);
  }
  [[nodiscard]] executor_type get_executor() noexcept { return tcp().get_executor(); }

  // Of one that is secure.
  void handshake(std::function<void(Code)> done);
  void shutdown(std::function<void(Code)> done);

  // Beast's requirements on a stream.
  template <class Buffers, class Handler>
  void async_read_some(const Buffers& buffers, Handler&& handler) {
    read_some(listed<boost::asio::mutable_buffer>(buffers), kept<Code, std::size_t>(std::forward<Handler>(handler)));
  }
  template <class Buffers, class Handler>
  void async_write_some(const Buffers& buffers, Handler&& handler) {
    write_some(listed<boost::asio::const_buffer>(buffers), kept<Code, std::size_t>(std::forward<Handler>(handler)));
  }
  // How a WebSocket ends its connection; Beast finds these by their arguments.
  friend void teardown(boost::beast::role_type role, Wire& wire, Code& error) { wire.tear_down(role, error); }
  template <class Handler>
  friend void async_teardown(boost::beast::role_type role, Wire& wire, Handler&& handler) {
    wire.tear_down(role, kept<Code>(std::forward<Handler>(handler)));
  }
  friend void beast_close_socket(Wire& wire) { wire.tcp().close(); }

 private:
  using Transferred = std::function<void(Code, std::size_t)>;
  void read_some(std::vector<boost::asio::mutable_buffer> buffers, Transferred done);
  void write_some(std::vector<boost::asio::const_buffer> buffers, Transferred done);
  void tear_down(boost::beast::role_type role, Code& error);
  void tear_down(boost::beast::role_type role, std::function<void(Code)> done);

  template <class Buffer, class Buffers>
  static std::vector<Buffer> listed(const Buffers& buffers) {
    return {boost::asio::buffer_sequence_begin(buffers), boost::asio::buffer_sequence_end(buffers)};
  }
  // A handler can only be moved, a std::function is copied. All run in the server's single thread, whatever executor
  // they name.
  template <class... Values, class Handler>
  static std::function<void(Values...)> kept(Handler&& handler) {
    auto shared = std::make_shared<std::decay_t<Handler>>(std::forward<Handler>(handler));
    return [shared](Values... values) {
      auto own = std::move(*shared);
      own(values...);
    };
  }

  std::variant<Plain, Secure> stream_;
};

}  // namespace berth::studio
