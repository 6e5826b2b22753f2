#include "berth/command/rights.hpp"

#include <fmt/format.h>

#include <algorithm>

#include "berth/command/audit.hpp"
#include "berth/command/verbs.hpp"
#include "berth/text/quantity.hpp"

namespace berth::command {
namespace {

// A personal argument of any verb, even if the requested verb does not take it.
bool is_personal(std::string_view name) {
  return std::ranges::any_of(verbs(), [&](const Verb& each) {
    const Parameter* const parameter = each.parameter(name);
    return parameter != nullptr && parameter->personal;
  });
}

// Finds a personal argument: a file of this computer, or "yes". The studio's pages may send "yes": there the user
// confirms what the page shows.
std::string personal_argument(Face face, const Request& request) {
  for (const auto& [name, value] : request.arguments) {
    if (!is_personal(name) || (face == Face::studio && name == "yes")) continue;
    return face == Face::studio
               ? fmt::format(
                     "{} works only on the command line: it names a file of this computer, or forgets all bindings",
                     text::quoted(name))
               : fmt::format("only a user can command {}, not a {}", text::quoted(name),
                             face == Face::mqtt ? "host at the broker" : "node");
  }
  return {};
}

bool is_listed(std::string_view verb, const Granted& granted) {
  return granted.listed != nullptr && granted.listed->allow(verb);
}

}  // namespace

Role role_needed(const Request& request) {
  const Verb* const known = verb(request.verb);
  const Role least = changes(request) ? Role::operate : Role::view;
  return known != nullptr ? std::max(known->role, least) : least;
}

std::string why_role_refused(std::string_view what, Role needed, Role has) {
  if (has >= needed) return {};
  return fmt::format(
      "{} needs the role {}, and this token is for {}: open the address of that role (the person who started Studio "
      "has it)",
      text::quoted(what), name(needed), name(has));
}

std::string why_refused(Face face, const Request& request, const Granted& granted) {
  const Verb* const known = verb(request.verb);
  const bool trusted = face == Face::person || face == Face::program;
  if (face == Face::studio) {
    auto no = why_role_refused(request.verb, role_needed(request), granted.role);
    if (!no.empty()) return no;
  }
  if (trusted || known == nullptr) return {};
  if (face == Face::node && (granted.listed == nullptr || !granted.listed->allow(request.verb)))
    return fmt::format("no node of bus {} may command {}: [bus.{}.commands] does not list it",
                       text::quoted(granted.bus), text::quoted(request.verb), granted.bus);
  if (face == Face::mqtt && !is_listed(request.verb, granted))
    return fmt::format("no host may command {} by MQTT: `commands` of [mqtt] does not list it",
                       text::quoted(request.verb));
  if (face == Face::gateway && changes(request) && !granted.changes)
    return fmt::format(
        "{} changes something, and on a real bus a client may only read and ask: allow it with --commands "
        "(berth gateway) or --gateway-commands (berth up)",
        text::quoted(request.verb));
  if (face == Face::studio && !granted.changes && changes(request))
    return fmt::format("{} changes something, and real buses are read-only until a user unlocks them for a time",
                       text::quoted(request.verb));
  return personal_argument(face, request);
}

}  // namespace berth::command
