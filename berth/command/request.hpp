/// Single commands as data, so that the command line can run them in a world of its own or hand them to a running
/// `berth up` through its control socket: the same code answers both. Which verbs there are: verbs.hpp.
#pragma once

#include <functional>
#include <map>
#include <optional>
#include <string>
#include <vector>

#include "berth/base/result.hpp"

namespace berth::command {

/// "sdo read" with {"bus": "backbone", "node": "5", "object": "1018h:04"}.
struct Request {
  std::string verb;
  std::map<std::string, std::string> arguments;
  bool progress = false;  ///< who asks wants lines on the way (`Reply::progress`); no part of what is asked
  friend bool operator==(const Request&, const Request&) = default;
};

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

/// One line of JSON: {"verb": ..., "arguments": {...}}, and "progress": true where it is wanted. `parse_request` gives
/// a request with an empty verb, and the reason in `error`, for anything else.
[[nodiscard]] std::string to_json(const Request& request);
[[nodiscard]] Request parse_request(const std::string& line, std::string& error);

/// The reply as one line of JSON for the control socket: {"status", "reply", "lines", "error"}.
[[nodiscard]] std::string to_json(const Reply& reply);
/// A line on the way to it: {"progress": "..."}; and back, empty for anything else.
[[nodiscard]] std::string progress_json(const std::string& line);
[[nodiscard]] std::optional<std::string> parse_progress(const std::string& line);
/// Reads it back; `status` 3 and the reason in `error` for anything else.
[[nodiscard]] Reply parse_reply(const std::string& line);

/// A reply that says only that, and why, something is not done.
[[nodiscard]] Reply refusal(int status, std::string message);

}  // namespace berth::command
