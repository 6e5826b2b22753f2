/// Single commands as data. The command line can run them in its own world or send them to a running `berth up` through
/// its control socket: the same code answers both. The verbs: verbs.hpp.
#pragma once

#include <map>
#include <string>

namespace berth::command {

/// "sdo read" with {"bus": "backbone", "node": "5", "object": "1018h:04"}.
struct Request {
  std::string verb;
  std::map<std::string, std::string> arguments;
  bool progress = false;  ///< the sender wants lines on the way (`Reply::progress`); not part of the request's content
  friend bool operator==(const Request&, const Request&) = default;
};

/// One line of JSON: {"verb": ..., "arguments": {...}}, and "progress": true if wanted. For anything else
/// `parse_request` returns a request with an empty verb, and the reason in `error`.
[[nodiscard]] std::string to_json(const Request& request);
[[nodiscard]] Request parse_request(const std::string& line, std::string& error);

}  // namespace berth::command
