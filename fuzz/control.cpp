// Any bytes as a line of the control socket, in either direction: a request or a reason, a reply with a status, and
// what was read is written and read back equal.
#include "berth/command/reply.hpp"
#include "fuzz/require.hpp"

namespace control_target {

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  using namespace berth;
  const std::string line(reinterpret_cast<const char*>(data), size);
  std::string problem;
  const auto request = command::parse_request(line, problem);
  fuzz::require(request.verb.empty() == !problem.empty());
  if (!request.verb.empty()) {
    const auto again = command::parse_request(command::to_json(request), problem);
    fuzz::require(again.verb.empty() || again.arguments.size() == request.arguments.size());
  }
  const auto reply = command::parse_reply(line);
  if (reply.status != 0) return 0;
  fuzz::require(command::parse_reply(command::to_json(reply)).lines.size() == reply.lines.size());
  return 0;
}

}  // namespace control_target
