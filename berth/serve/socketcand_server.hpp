/// Offers CAN buses to other programs by socketcand over TCP: python-can, Kayak, another Berth. Each client is its own
/// node on a bus, so clients receive each other's frames but not their own.
///
///     auto server = serve::SocketcandServer::listen(loop, {"127.0.0.1", 29536}, factory, {});
///     while (!over) loop.turn(50ms);
///
/// Runs in one `io::Loop`, with plain non-blocking sockets: a client is a few hundred bytes of state and its buffers,
/// and no data crosses threads, as it would with Boost Asio.
///
/// Like socketcand: `< hi >`; `< open >` by name; BCM mode (send, add, update, delete, filter, subscribe, unsubscribe),
/// raw mode, control mode (statistics), echo; `< error unknown command >`; a command with wrong words is silently
/// ignored; bytes outside elements end the connection, and so does an element that is too long or an unknown bus.
/// Better than socketcand: an element may come in any number of pieces; a client whose queue is full waits (its bytes
/// stay in TCP) instead of being disconnected; a client that reads too slowly is disconnected instead of holding up the
/// bus. Not supported: isotpmode, muxfilter, bit timing by the client. Remote and FD frames, which the protocol does
/// not have, are counted.
///
/// `< echo >` is answered when the client's earlier frames were acknowledged on the bus, or 100 ms later: so a Berth at
/// the other end knows when its own frames were sent. Frames in the first 100 ms of raw mode wait for the client's next
/// message: python-can takes anything together with `< ok >` for an error.
#pragma once

#include <functional>
#include <memory>
#include <string>
#include <tl/expected.hpp>
#include <vector>

#include "berth/can/port.hpp"
#include "berth/io/loop.hpp"
#include "berth/io/seats.hpp"
#include "berth/io/stream.hpp"

namespace berth::serve {

struct ServerOptions {
  io::SeatRules seats{.most = 64};       ///< a complete request is an opened bus, or a command to it
  std::size_t most_waiting = 1U << 22U;  ///< unread bytes of a client; beyond this it is disconnected
  /// The wall-clock time of the executor's time 0, for the frames' times; 0: from the system's clock at the beginning.
  std::chrono::microseconds epoch{0};
  /// Called with a text when a client comes, opens a bus or goes, with the reason; `io::BoundedLines`. Must not destroy
  /// the server.
  std::function<void(const std::string&)> tell{};
};

struct ServerCounters {
  std::uint64_t clients = 0;      ///< total of connections
  std::uint64_t too_slow = 0;     ///< disconnected because they read too slowly
  std::uint64_t misbehaved = 0;   ///< disconnected because of their messages
  std::uint64_t silent = 0;       ///< disconnected by `io::Seats`
  std::uint64_t frames_out = 0;   ///< from a bus to clients
  std::uint64_t frames_in = 0;    ///< from clients, queued on a bus
  std::uint64_t not_sent = 0;     ///< from clients, not accepted by the bus (bus-off, listening only, down)
  std::uint64_t unspeakable = 0;  ///< remote and FD frames not sent to clients
  std::uint64_t malformed = 0;    ///< commands with wrong words
};

class SocketcandServer {
 public:
  /// Gives a new client its own node on the bus; null, with the reason in `why`: there is none of that name. Destroying
  /// the port removes the node from the bus. Must not block.
  using Factory = std::function<std::unique_ptr<can::Port>(const std::string& bus, std::string& why)>;

  [[nodiscard]] static tl::expected<std::unique_ptr<SocketcandServer>, std::string> listen(io::Loop& loop,
                                                                                           const io::Endpoint& where,
                                                                                           Factory factory,
                                                                                           ServerOptions options);
  ~SocketcandServer();
  SocketcandServer(const SocketcandServer&) = delete;
  SocketcandServer& operator=(const SocketcandServer&) = delete;

  /// Where it listens; if port 0 was requested, with the port that the system chose.
  [[nodiscard]] const io::Endpoint& where() const noexcept;
  [[nodiscard]] std::size_t clients() const noexcept;  ///< now
  [[nodiscard]] const ServerCounters& counters() const noexcept;

 private:
  class Impl;
  explicit SocketcandServer(std::unique_ptr<Impl> impl) noexcept;
  std::unique_ptr<Impl> impl_;
};

}  // namespace berth::serve
