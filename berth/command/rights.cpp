#include "berth/command/rights.hpp"

#include <fmt/format.h>

#include "berth/command/verbs.hpp"
#include "berth/text/quantity.hpp"

namespace berth::command {
namespace {

// A person's arguments: a file of this computer, and "yes".
std::string personal_argument(const Verb& verb, const Request& request) {
  for (const auto& [name, value] : request.arguments) {
    const Parameter* const parameter = verb.parameter(name);
    if (parameter != nullptr && parameter->personal)
      return fmt::format("{} is for a person to say, not for a node or a client", text::quoted(name));
  }
  return {};
}

}  // namespace

std::string why_refused(Face face, const Request& request, const Granted& granted) {
  const Verb* const known = verb(request.verb);
  const bool trusted = face == Face::person || face == Face::program;
  if (trusted || known == nullptr) return {};
  if (face == Face::node && (granted.listed == nullptr || !granted.listed->allow(request.verb)))
    return fmt::format("no node of this bus may command {}: its [bus.NAME.commands] does not list it",
                       text::quoted(request.verb));
  if (face == Face::gateway && known->effect == Effect::changes && !granted.changes)
    return fmt::format(
        "{} changes something, and on a real bus a client may only read and ask: allow it with --commands "
        "(berth gateway) or --gateway-commands (berth up)",
        text::quoted(request.verb));
  return personal_argument(*known, request);
}

}  // namespace berth::command
