/// The CiA 309-3 gateway over TCP: a conversation (`gateway_309_client.hpp`) for each connection.
///
///     auto server = serve::Gateway309Server::listen(loop, {"127.0.0.1", 7000}, session, {});
///     while (!over) loop.turn(50ms);
///
/// In one `io::Loop`, non-blocking, bounded: lines up to `set command_size`, 64 commands that wait (then the client
/// waits, its bytes stay in TCP), `most_waiting` bytes of replies (then it is let go). Who has closed his half gets the
/// replies to what he has asked for. Anybody who can connect commands the machine: it listens on loopback unless it is
/// told otherwise, and there is no password.
#pragma once

#include <functional>
#include <memory>
#include <string>
#include <tl/expected.hpp>

#include "berth/io/loop.hpp"
#include "berth/io/stream.hpp"
#include "berth/operate/session.hpp"

namespace berth::serve {

inline constexpr std::uint16_t gateway_309_port = 7000;

struct Gateway309Options {
  bool confirmed = false;                            ///< see `House309`
  std::size_t most_clients = 16;                     ///< one more is let go
  std::size_t most_waiting = std::size_t{4} << 20U;  ///< bytes that a client did not take; then it is let go
  /// Told in words who came and why it went, and what was refused why. Must not destroy the server.
  std::function<void(const std::string&)> tell{};
};

struct Gateway309Counters {
  std::uint64_t clients = 0;   ///< that came, ever
  std::uint64_t too_slow = 0;  ///< let go because they took too little
  std::uint64_t too_many = 0;  ///< let go because there were enough
  std::uint64_t lines = 0;     ///< taken
};

class Gateway309Server {
 public:
  /// `session` must be open and stay. What is wrong is told in words.
  [[nodiscard]] static tl::expected<std::unique_ptr<Gateway309Server>, std::string> listen(io::Loop& loop,
                                                                                           const io::Endpoint& where,
                                                                                           operate::Session& session,
                                                                                           Gateway309Options options);
  ~Gateway309Server();
  Gateway309Server(const Gateway309Server&) = delete;
  Gateway309Server& operator=(const Gateway309Server&) = delete;

  /// Where it listens; with the port that the system took when 0 was asked for.
  [[nodiscard]] const io::Endpoint& where() const noexcept;
  [[nodiscard]] std::size_t clients() const noexcept;  ///< now
  [[nodiscard]] const Gateway309Counters& counters() const noexcept;

 private:
  class Impl;
  explicit Gateway309Server(std::unique_ptr<Impl> impl) noexcept;
  std::unique_ptr<Impl> impl_;
};

}  // namespace berth::serve
