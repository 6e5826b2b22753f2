/// Offers CAN buses to other programs by socketcand over TCP: python-can, Kayak, another Berth. One node on a bus for
/// each client, so clients hear each other and never themselves.
///
///     auto server = serve::SocketcandServer::listen(loop, {"127.0.0.1", 29536}, factory, {});
///     while (!over) loop.turn(50ms);
///
/// In one `io::Loop`, on plain non-blocking sockets: a client is a few hundred bytes of state and its buffers, and
/// nothing has to be handed between threads, which is what Boost Asio would bring.
///
/// What it does as socketcand does: `< hi >`; `< open >` by name; BCM mode (send, add, update, delete, filter,
/// subscribe, unsubscribe), raw mode, control mode (statistics), echo; `< error unknown command >`; a command with
/// wrong words is passed over in silence; bytes that are no element end the connection, and so does an element that is
/// too long or a bus that is not there. What it does better: an element may come in any number of pieces; a client
/// whose queue is full waits (its bytes stay in TCP) instead of being thrown out; one that takes too little is thrown
/// out instead of holding up the bus. Not here: isotpmode, muxfilter, bit timing by the client. Remote and FD frames,
/// which the protocol cannot say, are counted.
///
/// `< echo >` is answered when the frames that the client sent before it were acknowledged on the bus, or 100 ms later:
/// so a Berth at the other end knows when its own frames were sent. Frames in the first 100 ms of raw mode wait for the
/// client's next word: python-can takes what comes together with `< ok >` for an error.
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
  io::SeatRules seats{.most = 64};       ///< a whole request is a bus that was opened, or a command to it
  std::size_t most_waiting = 1U << 22U;  ///< bytes that a client did not take; then it is let go
  /// Wall-clock time of the executor's time 0, for the frames' times; 0: by the system's clock at the beginning.
  std::chrono::microseconds epoch{0};
  /// Told in words which client came, opened what and why it went; `io::BoundedLines`. Must not destroy the server.
  std::function<void(const std::string&)> tell{};
};

struct ServerCounters {
  std::uint64_t clients = 0;      ///< that came, ever
  std::uint64_t too_slow = 0;     ///< let go because they took too little
  std::uint64_t misbehaved = 0;   ///< let go because of what they sent
  std::uint64_t silent = 0;       ///< let go by `io::Seats`
  std::uint64_t frames_out = 0;   ///< from a bus to clients
  std::uint64_t frames_in = 0;    ///< from clients, queued on a bus
  std::uint64_t not_sent = 0;     ///< from clients, that the bus did not take (bus-off, listening only, down)
  std::uint64_t unspeakable = 0;  ///< remote and FD frames, which clients did not get
  std::uint64_t malformed = 0;    ///< commands with wrong words
};

class SocketcandServer {
 public:
  /// Gives a new client its own node on the bus; null, and `why` in words: there is none of that name. Destroying the
  /// port takes the node off the bus. Must not block.
  using Factory = std::function<std::unique_ptr<can::Port>(const std::string& bus, std::string& why)>;

  [[nodiscard]] static tl::expected<std::unique_ptr<SocketcandServer>, std::string> listen(io::Loop& loop,
                                                                                           const io::Endpoint& where,
                                                                                           Factory factory,
                                                                                           ServerOptions options);
  ~SocketcandServer();
  SocketcandServer(const SocketcandServer&) = delete;
  SocketcandServer& operator=(const SocketcandServer&) = delete;

  /// Where it listens; with the port that the system took when 0 was asked for.
  [[nodiscard]] const io::Endpoint& where() const noexcept;
  [[nodiscard]] std::size_t clients() const noexcept;  ///< now
  [[nodiscard]] const ServerCounters& counters() const noexcept;

 private:
  class Impl;
  explicit SocketcandServer(std::unique_ptr<Impl> impl) noexcept;
  std::unique_ptr<Impl> impl_;
};

}  // namespace berth::serve
