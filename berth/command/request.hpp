/// Single commands as data, so that the command line can run them in a world of its own or hand them to a running
/// `berth up` through its control socket: the same code answers both. Which verbs there are: verbs.hpp.
#pragma once

#include <map>
#include <string>

namespace berth::command {

/// "sdo read" with {"bus": "backbone", "node": "5", "object": "1018h:04"}.
struct Request {
  std::string verb;
  std::map<std::string, std::string> arguments;
  bool progress = false;  ///< who asks wants lines on the way (`Reply::progress`); no part of what is asked
  friend bool operator==(const Request&, const Request&) = default;
};

/// One line of JSON: {"verb": ..., "arguments": {...}}, and "progress": true where it is wanted. `parse_request` gives
/// a request with an empty verb, and the reason in `error`, for anything else.
[[nodiscard]] std::string to_json(const Request& request);
[[nodiscard]] Request parse_request(const std::string& line, std::string& error);

}  // namespace berth::command
