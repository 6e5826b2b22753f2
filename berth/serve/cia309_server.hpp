/// The CiA 309-3 gateway over TCP: a conversation (`cia309_client.hpp`) for each connection.
///
///     auto server = serve::Server::listen(loop, {"127.0.0.1", 7000}, session, {});
///     while (!over) loop.turn(50ms);
///
/// Runs in one `io::Loop`, non-blocking, with limits: lines up to `set command_size`; 64 waiting commands (then the
/// client waits, its bytes stay in TCP); `most_waiting` bytes of replies (then it is disconnected). A client that
/// closed its half still gets the pending replies. There is no password: it listens on loopback by default, and on real
/// buses clients only read unless `commands`.
///
/// A web page can make a browser connect to loopback, too, where its text follows header lines. So a connection ends at
/// a syntax error before its first valid command (an HTTP request line is one), and nothing after it is carried out.
/// Silent connections lock no client out: `io::Seats` decides which keep their seats; here a complete request is a
/// valid command.
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
  std::size_t most_waiting = std::size_t{4} << 20U;  ///< unread bytes of a client; beyond this it is disconnected
  /// Called with a text when a client comes or goes, with the reason, and for each refusal; `io::BoundedLines`. Must
  /// not destroy the server.
  std::function<void(const std::string&)> tell{};
};

struct Counters {
  std::uint64_t clients = 0;   ///< total of connections
  std::uint64_t too_slow = 0;  ///< disconnected because they read too slowly
  std::uint64_t too_many = 0;  ///< disconnected because there were too many
  std::uint64_t silent = 0;    ///< disconnected by `io::Seats`: silent, half a line, not reading, idle when another
                               ///< came
  std::uint64_t strange = 0;   ///< disconnected because they did not begin with a command
  std::uint64_t lines = 0;     ///< accepted
};

class Server {
 public:
  /// `session` must be open and outlive this. Errors as text.
  [[nodiscard]] static tl::expected<std::unique_ptr<Server>, std::string> listen(io::Loop& loop,
                                                                                 const io::Endpoint& where,
                                                                                 tree::Session& session,
                                                                                 ServerOptions options);
  ~Server();
  Server(const Server&) = delete;
  Server& operator=(const Server&) = delete;

  /// Where it listens; if port 0 was requested, with the port that the system chose.
  [[nodiscard]] const io::Endpoint& where() const noexcept;
  [[nodiscard]] std::size_t clients() const noexcept;  ///< now
  [[nodiscard]] const Counters& counters() const noexcept;

 private:
  class Impl;
  explicit Server(std::unique_ptr<Impl> impl) noexcept;
  std::unique_ptr<Impl> impl_;
};

}  // namespace berth::serve::cia309
