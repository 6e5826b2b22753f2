// A request as a node writes it to 1023h, or a client sends it: whatever its text, what is let through is a verb that
// was listed, without a person's arguments; and of a client's, on a real bus, a verb that only asks.
#include <algorithm>
#include <cstdint>
#include <cstdlib>
#include <string>

#include "berth/command/rights.hpp"
#include "berth/command/verbs.hpp"

namespace rights_target {

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  using namespace berth::command;
  static const berth::design::BusCommands listed{{"report", "sdo read", "program download", "bind"}};
  std::string error;
  const Request request = parse_request(std::string(reinterpret_cast<const char*>(data), size), error);
  const Verb* const known = verb(request.verb);
  if (!error.empty() || known == nullptr) return 0;
  const bool personal = request.arguments.contains("yes") || request.arguments.contains("from-scratch") ||
                        (request.verb == "program download" && request.arguments.contains("file"));
  const bool node_may = why_refused(Face::node, request, {.listed = &listed}).empty();
  if (node_may && (!listed.allow(request.verb) || personal)) std::abort();
  const bool client_may = why_refused(Face::gateway, request, {}).empty();
  if (client_may && (known->effect() == Effect::changes || personal)) std::abort();
  const bool page_may = why_refused(Face::studio, request, {}).empty();
  const bool more_than_yes = request.arguments.contains("from-scratch") || request.arguments.contains("file");
  if (page_may && (known->effect() == Effect::changes || more_than_yes)) std::abort();
  return 0;
}

}  // namespace rights_target
