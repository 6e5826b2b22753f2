/// What is answered to a request, and what the verbs' source files put into it.
#pragma once

#include <functional>
#include <optional>
#include <string>
#include <vector>

#include "berth/base/result.hpp"
#include "berth/command/json.hpp"
#include "berth/command/request.hpp"

namespace berth::command {

/// Exit status as the command line has it: 0 done, 1 the answer is no, 2 wrong usage, 3 the bus or a file failed.
struct Reply {
  int status = 0;
  std::string json;                ///< one JSON object on one line, always; a failure is {"error": {"message", ...}}
  std::vector<std::string> lines;  ///< the same for people
  std::string error;  ///< for people, when the status is not 0: what, where, what to do; each error is one line
  /// Of a service that failed, for who answers in codes (CiA 309). It does not pass the control socket.
  std::optional<Error> cause{};
  /// Set by who wants to hear of it: a line for people on what takes long, while it is done. May be empty.
  std::function<void(const std::string& line)> progress{};
  /// Tells `progress`, where somebody listens.
  void tell(const std::string& line) const {
    if (progress) progress(line);
  }
};

/// The reply as one line of JSON for the control socket: {"status", "reply", "lines", "error"}.
[[nodiscard]] std::string to_json(const Reply& reply);
/// A line on the way to it: {"progress": "..."}; and back, empty for anything else.
[[nodiscard]] std::string progress_json(const std::string& line);
[[nodiscard]] std::optional<std::string> parse_progress(const std::string& line);
/// Reads it back; `status` 3 and the reason in `error` for anything else.
[[nodiscard]] Reply parse_reply(const std::string& line);

/// A reply that says only that, and why, something is not done.
[[nodiscard]] Reply refusal(int status, std::string message);

void give(Reply& reply, const Json& json, std::vector<std::string> lines);
/// One line for people: a name of a device or of a client's request begins no other.
[[nodiscard]] std::string error_line(const std::string& message, const std::string& fix = {});
/// `message` for people, `fix` what to do.
void refuse(Reply& reply, int status, const std::string& message, const std::string& fix = {});
/// The exit status of an error: 3 when the bus or a file failed, else 1.
[[nodiscard]] int status_of(Errc code) noexcept;
/// An error of a service: status by its code, abort code with its text. `where`: "bus backbone, SDO read". `path`: of
/// its node, where that is beneath gateways; else empty.
void fail_with(Reply& reply, const Error& error, const std::string& where, const std::string& fix = {},
               const std::string& path = {});

}  // namespace berth::command
