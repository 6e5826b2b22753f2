/// The control socket of a running `berth up`: a second command sends one line of JSON (`Request`) and gets one
/// line back (`Reply`). A Unix domain socket in a folder of its owner's, so that no other user commands the
/// machine. Both ends look whose process the other is: this user's, or root's; a stranger's socket or folder is refused
/// in words.
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

/// `$XDG_RUNTIME_DIR/berth-<machine>.sock`, else `/tmp/berth-<uid>/<machine>.sock`. What is no letter, digit, dot, dash
/// or underscore in the machine's name becomes an underscore.
[[nodiscard]] std::string control_path(const std::string& machine);

/// A connection that gives every frame of the machine that listens at `path`, line by line (`ControlServer::frame`).
/// The caller closes it. Failures in words, as of `control_call`.
[[nodiscard]] tl::expected<int, std::string> control_follow(const std::string& path);

/// Sends `request` to the process that listens at `path` and waits for the answer. A failure is told in words: no
/// process there, no answer in `timeout_ms`, another user's folder or process, an answer beyond 16 MiB. Nothing is sent
/// to a stranger. A process that is stopped (Ctrl-Z) is told at once. `on_progress`: lines on the way, where the
/// request wants them. `goes_on` is asked some twenty times a second meanwhile: false gives the answer up, and the
/// other end breaks off what it did for it.
[[nodiscard]] tl::expected<Reply, std::string> control_call(
    const std::string& path, const Request& request, int timeout_ms,
    const std::function<void(const std::string& line)>& on_progress = {}, const std::function<bool()>& goes_on = {});

/// A process accepts connections at `path`.
[[nodiscard]] bool control_answers(const std::string& path);

/// Listens and runs what it is asked, in the loop's executor. Never blocks. Who keeps its seat is `io::Seats`' rule: a
/// whole request is a line, and one too many is refused in words.
class ControlServer final : private io::Watcher {
 public:
  /// Makes the socket (mode 0600; its folder, when it has to be made, 0700). Refused when another process answers
  /// there, with its process id; a socket that a dead process left is taken over. Loop and session must stay; the loop
  /// drives the session's executor.
  [[nodiscard]] static tl::expected<std::unique_ptr<ControlServer>, std::string> listen(const std::string& path,
                                                                                        io::Loop& loop,
                                                                                        tree::Session& session);
  /// Carries one request out. Both stay until the task is done, or is destroyed with its connection.
  using Answer = std::function<rt::Task<void>(const Request& request, Reply& reply)>;
  /// The same of a process that answers more than a session does, or has none.
  [[nodiscard]] static tl::expected<std::unique_ptr<ControlServer>, std::string> listen(const std::string& path,
                                                                                        io::Loop& loop, Answer answer);
  ~ControlServer();
  ControlServer(const ControlServer&) = delete;
  ControlServer& operator=(const ControlServer&) = delete;

  [[nodiscard]] const std::string& path() const noexcept { return path_; }

  /// A client has asked for "frames": it gets every frame's line (candump -L's), until it leaves.
  [[nodiscard]] bool followed() const noexcept;
  /// The line of a frame, with its end, for those that follow. What a client that is too slow has not taken is bounded
  /// (`most_behind` bytes): further lines are left out and counted, and the count is a line of its own, "dropped N".
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
