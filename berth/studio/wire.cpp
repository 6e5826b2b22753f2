// asio/awaitable.hpp of Boost 1.74 uses std::exchange without this.
#include <utility>

#include "berth/studio/wire.hpp"

#include <boost/beast/websocket/ssl.hpp>

namespace berth::studio {

namespace websocket = boost::beast::websocket;

void Wire::handshake(std::function<void(Code)> done) {
  std::get<Secure>(stream_).async_handshake(boost::asio::ssl::stream_base::server, std::move(done));
}

void Wire::shutdown(std::function<void(Code)> done) { std::get<Secure>(stream_).async_shutdown(std::move(done)); }

void Wire::read_some(std::vector<boost::asio::mutable_buffer> buffers, Transferred done) {
  std::visit([&](auto& stream) { stream.async_read_some(buffers, std::move(done)); }, stream_);
}

void Wire::write_some(std::vector<boost::asio::const_buffer> buffers, Transferred done) {
  std::visit([&](auto& stream) { stream.async_write_some(buffers, std::move(done)); }, stream_);
}

void Wire::tear_down(boost::beast::role_type role, Code& error) {
  using websocket::teardown;
  std::visit([&](auto& stream) { teardown(role, stream, error); }, stream_);
}

void Wire::tear_down(boost::beast::role_type role, std::function<void(Code)> done) {
  using websocket::async_teardown;
  std::visit([&](auto& stream) { async_teardown(role, stream, std::move(done)); }, stream_);
}

}  // namespace berth::studio
