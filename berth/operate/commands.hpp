/// Single commands as data, so that the command line can run them in a world of its own or hand them to a running
/// `berth up` through its control socket: the same code answers both.
#pragma once

#include <map>
#include <string>
#include <vector>

#include "berth/rt/task.hpp"

namespace berth::operate {

class Session;

/// "sdo read" with {"bus": "backbone", "node": "5", "index": "0x1000", "sub": "0"}. Arguments are text as the person
/// wrote them; `execute` checks them.
struct CommandRequest {
  std::string verb;  ///< "report", "scan", "bind", "replace", "sdo read", "sdo write", "nmt", "lss <service>"
  std::map<std::string, std::string> arguments;
};

/// Exit status as the command line has it: 0 done, 1 the answer is no, 2 wrong usage, 3 the bus or a file failed.
struct CommandReply {
  int status = 0;
  std::string json;                 ///< one JSON object, always
  std::vector<std::string> lines;   ///< the same for people
};

/// One line of JSON: {"verb": ..., "arguments": {...}}. `parse_request` gives a request with an empty verb, and the
/// reason in `error`, for anything else.
[[nodiscard]] std::string to_json(const CommandRequest& request);
[[nodiscard]] CommandRequest parse_request(const std::string& line, std::string& error);

/// Runs one command. `request` and `reply` must stay until the task is done.
[[nodiscard]] rt::Task<void> execute(Session& session, const CommandRequest& request, CommandReply& reply);

}  // namespace berth::operate
