/// The CiA 309-3 gateway over TCP: a conversation (`cia309_client.hpp`) for each connection.
///
///     auto server = serve::Server::listen(loop, {"127.0.0.1", 7000}, session, {});
///     while (!over) loop.turn(50ms);
///
/// In one `io::Loop`, non-blocking, bounded: lines up to `set command_size`, 64 commands that wait (then the client
/// waits, its bytes stay in TCP), `most_waiting` bytes of replies (then it is let go). One that has closed its half
/// gets the replies to what it has asked for. There is no password: it listens on loopback unless it is told otherwise,
/// and on real buses clients only read unless `commands`.
///
/// A web page can make a browser connect to loopback, too, and its text follows header lines. So a connection ends at a
/// syntax error before its first valid command (an HTTP request line is one), and nothing after it is carried out.
/// Silent connections lock no client out: who keeps its seat is `io::Seats`' rule, and a whole request is a valid
/// command.
#pragma once

#include <chrono>
#include <functional>
#include <memory>
#include <string>
#include <tl/expected.hpp>

#include "berth/io/loop.hpp"
#include "berth/io/seats.hpp"
#include "berth/io/stream.hpp"
#include "berth/tree/session.hpp"

namespace berth::serve::cia309 {

inline constexpr std::uint16_t default_port = 7000;

struct ServerOptions {
  bool commands = false;   ///< see `House`
  bool confirmed = false;  ///< see `House`
  io::SeatRules seats{.most = 16, .most_per_peer = 8};
  std::size_t most_waiting = std::size_t{4} << 20U;  ///< bytes that a client did not take; then it is let go
  /// Told in words which client came and why it went, and what was refused why; `io::BoundedLines`. Must not destroy
  /// the server.
  std::function<void(const std::string&)> tell{};
};

struct Counters {
  std::uint64_t clients = 0;   ///< that came, ever
  std::uint64_t too_slow = 0;  ///< let go because they took too little
  std::uint64_t too_many = 0;  ///< let go because there were enough
  std::uint64_t silent = 0;    ///< let go by `io::Seats`: silent, half a line, nothing taken, idle when another came
  std::uint64_t strange = 0;   ///< let go because they began with something else than a command
  std::uint64_t lines = 0;     ///< taken
};

class Server {
 public:
  /// `session` must be open and stay. What is wrong is told in words.
  [[nodiscard]] static tl::expected<std::unique_ptr<Server>, std::string> listen(io::Loop& loop,
                                                                                 const io::Endpoint& where,
                                                                                 tree::Session& session,
                                                                                 ServerOptions options);
  ~Server();
  Server(const Server&) = delete;
  Server& operator=(const Server&) = delete;

  /// Where it listens; with the port that the system took when 0 was asked for.
  [[nodiscard]] const io::Endpoint& where() const noexcept;
  [[nodiscard]] std::size_t clients() const noexcept;  ///< now
  [[nodiscard]] const Counters& counters() const noexcept;

 private:
  class Impl;
  explicit Server(std::unique_ptr<Impl> impl) noexcept;
  std::unique_ptr<Impl> impl_;
};

}  // namespace berth::serve::cia309
