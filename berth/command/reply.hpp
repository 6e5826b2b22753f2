/// The answer to a request, and functions that the verbs fill it with.
#pragma once

#include <functional>
#include <optional>
#include <string>
#include <vector>

#include "berth/base/result.hpp"
#include "berth/command/json.hpp"
#include "berth/command/request.hpp"

namespace berth::command {

/// Exit status as on the command line: 0 done, 1 the answer is no, 2 wrong usage, 3 the bus or a file failed.
struct Reply {
  int status = 0;
  std::string json;                ///< one JSON object on one line, always; a failure is {"error": {"message", ...}}
  std::vector<std::string> lines;  ///< the same for users
  std::string error;  ///< for users, if the status is not 0: what, where, what to do; each error is one line
  /// The error of a failed service, for interfaces that answer in codes (CiA 309). Not sent on the control socket.
  std::optional<Error> cause{};
  /// Set by a caller that wants progress: called with a line for users during long work. May be empty.
  std::function<void(const std::string& line)> progress{};
  /// Calls `progress`, if set.
  void tell(const std::string& line) const {
    if (progress) progress(line);
  }
};

/// The reply as one line of JSON for the control socket: {"status", "reply", "lines", "error"}.
[[nodiscard]] std::string to_json(const Reply& reply);
/// A progress line on the way to it: {"progress": "..."}; `parse_progress`: empty for anything else.
[[nodiscard]] std::string progress_json(const std::string& line);
[[nodiscard]] std::optional<std::string> parse_progress(const std::string& line);
/// Reads a reply; for anything else `status` 3 and the reason in `error`.
[[nodiscard]] Reply parse_reply(const std::string& line);

/// A reply that only says why something is not done.
[[nodiscard]] Reply refusal(int status, std::string message);

void give(Reply& reply, const Json& json, std::vector<std::string> lines);
/// One line for users: a name from a device or a client's request cannot begin another line.
[[nodiscard]] std::string error_line(const std::string& message, const std::string& fix = {});
/// `message` for users, `fix`: what to do.
void refuse(Reply& reply, int status, const std::string& message, const std::string& fix = {});
/// The exit status of an error: 3 if the bus or a file failed, else 1.
[[nodiscard]] int status_of(Errc code) noexcept;
/// A service's error: status by its code, abort code with its text. `where`: "bus backbone, SDO read". `path`: of its
/// node, if beneath gateways; else empty.
void fail_with(Reply& reply, const Error& error, const std::string& where, const std::string& fix = {},
               const std::string& path = {});

}  // namespace berth::command
