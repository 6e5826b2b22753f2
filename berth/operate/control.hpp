/// The control socket of a running `berth up`: a second command sends one line of JSON (`CommandRequest`) and gets one
/// line back (`CommandReply`). A Unix domain socket in a folder of its owner's, so that no other user commands the
/// machine. Both ends look whose process the other is: this user's, or root's; a stranger's socket or folder is refused
/// in words.
#pragma once

#include <poll.h>

#include <cstdint>
#include <functional>
#include <memory>
#include <string>
#include <tl/expected.hpp>
#include <vector>

#include "berth/operate/commands.hpp"
#include "berth/operate/session.hpp"
#include "berth/rt/scope.hpp"

namespace berth::operate {

/// `$XDG_RUNTIME_DIR/berth-<machine>.sock`, else `/tmp/berth-<uid>/<machine>.sock`. What is no letter, digit, dot, dash
/// or underscore in the machine's name becomes an underscore.
[[nodiscard]] std::string control_path(const std::string& machine);

/// Sends `request` to the process that listens at `path` and waits for the answer. A failure is told in words: no
/// process there, no answer in `timeout_ms`, another user's folder or process, an answer beyond 16 MiB. Nothing is sent
/// to a stranger.
[[nodiscard]] tl::expected<CommandReply, std::string> control_call(const std::string& path,
                                                                   const CommandRequest& request, int timeout_ms);

/// A process accepts connections at `path`.
[[nodiscard]] bool control_answers(const std::string& path);

/// Listens and runs what it is asked, in the session's executor. Never blocks; its owner polls. Not from inside a job.
class ControlServer {
 public:
  /// Makes the socket (mode 0600; its folder, when it has to be made, 0700). Refused when another process answers
  /// there, with its process id; a socket that a dead process left is taken over.
  [[nodiscard]] static tl::expected<std::unique_ptr<ControlServer>, std::string> listen(const std::string& path,
                                                                                        Session& session);
  ~ControlServer();
  ControlServer(const ControlServer&) = delete;
  ControlServer& operator=(const ControlServer&) = delete;

  /// Adds the descriptors to wait for.
  void fill(std::vector<pollfd>& descriptors) const;
  /// Does what can be done now: new connections, requests, answers. Call after `poll`, and after the executor ran.
  void serve();

  [[nodiscard]] const std::string& path() const noexcept { return path_; }

 private:
  struct Client;
  ControlServer(std::string path, int fd, Session& session);
  void accept_all();
  bool read_from(Client& client);
  bool write_to(Client& client);
  void begin(Client& client);

  std::string path_;
  int fd_;
  Session* session_;
  std::vector<std::unique_ptr<Client>> clients_;
};

}  // namespace berth::operate
