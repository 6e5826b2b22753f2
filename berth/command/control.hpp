/// The control socket of a running `berth up`: a second command sends one line of JSON (`Request`) and gets one line
/// back (`Reply`). A Unix domain socket in a folder of its owner, so that no other user commands the machine. Both ends
/// check that the other process is this user's or root's; anyone else's socket or folder is refused with a message.
#pragma once

#include <cstdint>
#include <functional>
#include <memory>
#include <string>
#include <tl/expected.hpp>
#include <vector>

#include "berth/command/reply.hpp"
#include "berth/io/acceptor.hpp"
#include "berth/io/loop.hpp"
#include "berth/io/seats.hpp"
#include "berth/rt/later.hpp"
#include "berth/rt/scope.hpp"
#include "berth/tree/session.hpp"

namespace berth::command {

/// `$XDG_RUNTIME_DIR/berth-<machine>.sock`, else `/tmp/berth-<uid>/<machine>.sock`. Other characters than letters,
/// digits, dots, dashes and underscores in the machine's name become underscores.
[[nodiscard]] std::string control_path(const std::string& machine);

/// A connection that delivers every frame of the machine that listens at `path`, line by line (`ControlServer::frame`).
/// The caller closes it. Errors as text, like those of `control_call`.
[[nodiscard]] tl::expected<int, std::string> control_follow(const std::string& path);

/// Sends `request` to the process that listens at `path` and waits for the answer. Errors as text: no process there, no
/// answer in `timeout_ms`, another user's folder or process, an answer beyond 16 MiB. Nothing is sent to another user's
/// process. A stopped process (Ctrl-Z) is reported at once. `on_progress`: lines on the way, if the request wants them.
/// `goes_on` is called about twenty times a second meanwhile: false gives the answer up, and the other end cancels its
/// work for it.
[[nodiscard]] tl::expected<Reply, std::string> control_call(
    const std::string& path, const Request& request, int timeout_ms,
    const std::function<void(const std::string& line)>& on_progress = {}, const std::function<bool()>& goes_on = {});

/// A process accepts connections at `path`.
[[nodiscard]] bool control_answers(const std::string& path);

/// Listens and carries out requests in the loop's executor. Never blocks. `io::Seats` decides which clients keep their
/// seats: a complete request is a line, and one client too many is refused with a message.
class ControlServer final : private io::Watcher {
 public:
  /// Makes the socket (mode 0600; a new folder 0700). Refused if another process answers there, with its process id; a
  /// dead process's socket is taken over. Loop and session must outlive this; the loop drives the session's executor.
  [[nodiscard]] static tl::expected<std::unique_ptr<ControlServer>, std::string> listen(const std::string& path,
                                                                                        io::Loop& loop,
                                                                                        tree::Session& session);
  /// Carries one request out. Both outlive the task, which is destroyed with its connection.
  using Answer = std::function<rt::Task<void>(const Request& request, Reply& reply)>;
  /// The same for a process that answers more than a session does, or has none.
  [[nodiscard]] static tl::expected<std::unique_ptr<ControlServer>, std::string> listen(const std::string& path,
                                                                                        io::Loop& loop, Answer answer);
  ~ControlServer();
  ControlServer(const ControlServer&) = delete;
  ControlServer& operator=(const ControlServer&) = delete;

  [[nodiscard]] const std::string& path() const noexcept { return path_; }

  /// A client asked for "frames": it gets every frame's line (candump -L's) until it leaves.
  [[nodiscard]] bool followed() const noexcept;
  /// The line of a frame, with its line end, for clients that follow. Unread lines of a slow client are limited
  /// (`most_behind` bytes): further ones are omitted and counted, and the count is a line of its own, "dropped N".
  void frame(const std::string& line);
  static constexpr std::size_t most_behind = std::size_t{1} << 20U;
  static constexpr io::SeatRules seat_rules{.most = 16};

 private:
  struct Client;
  ControlServer(std::string path, int fd, io::Loop& loop, Answer answer);
  void ready(std::uint32_t events) noexcept override;
  void serve() noexcept;
  void take(int fd);
  bool read_from(Client& client);
  bool write_to(Client& client);
  void begin(Client& client);

  std::string path_;
  io::Loop* loop_;
  Answer answer_;
  io::Seats seats_;
  std::vector<std::unique_ptr<Client>> clients_;
  rt::Later<ControlServer, &ControlServer::serve> answering_{*this,
                                                             loop_->executor()};  // posted when a command is done
  io::Acceptor acceptor_;
};

}  // namespace berth::command
