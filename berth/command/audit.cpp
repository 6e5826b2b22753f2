#include "berth/command/audit.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <utility>

#include "berth/command/verbs.hpp"

namespace berth::command {
namespace {

constexpr std::size_t longest_words = 200;

// One field of a line; tabs separate the fields.
std::string field(std::string_view text) {
  std::string out(text.substr(0, longest_words));
  if (text.size() > longest_words) out += "…";
  std::ranges::replace_if(
      out, [](char c) { return c >= 0 && c < ' '; }, ' ');
  return out;
}

}  // namespace

bool changes(const Request& request) {
  const Verb* const known = verb(request.verb);
  if (known != nullptr) {
    const auto makes_it = [&](const Parameter& parameter) {
      return parameter.changes && request.arguments.contains(std::string(parameter.name));
    };
    return known->effect() == Effect::changes || std::ranges::any_of(known->parameters, makes_it);
  }
  const auto action = request.arguments.find("action");
  return action == request.arguments.end() || action->second != "devices";
}

std::string words_of(const Request& request) {
  std::string words = request.verb;
  constexpr std::size_t longest_value = 100;  // so that what follows a long value can be read, too
  for (const auto& [name, value] : request.arguments) {
    words += fmt::format(" {}={}{}", name, std::string_view(value).substr(0, longest_value),
                         value.size() > longest_value ? "…" : "");
  }
  return field(words);
}

const char* word_of_status(int status) noexcept {
  switch (status) {
    case 0: return "done";
    case 1: return "no";
    case 2: return "wrong usage";
    default: return "failed";
  }
}

void audit(tree::Session& session, std::string_view who, std::string_view what, std::string_view answer) {
  places::HistoryEntry line;
  line.event = audit_event;
  line.reason = fmt::format("{}\t{}\t{}", field(who), field(what), field(answer));
  line.on = {session.machine().name, session.machine().buses.front().name};
  const auto written = session.store().note(line);
  if (written) return;
  session.tell(line.on.bus, operate::EventKind::error,
               fmt::format("the audit log has no line of {}: {}", what, places::words_of(written.error())));
}

Audit::Audit(tree::Session& session, std::string_view who, const Request& request)
    : session_(&session), who_(who), what_(changes(request) ? words_of(request) : std::string()) {
  if (!what_.empty()) audit(*session_, who_, what_, "begun");
}

Audit::~Audit() {
  if (!what_.empty()) audit(*session_, who_, what_, "broken off");
}

void Audit::answered(const Reply& reply) {
  if (what_.empty()) return;
  const std::string first = reply.error.substr(0, reply.error.find('\n'));
  audit(*session_, who_, what_,
        first.empty() ? word_of_status(reply.status) : fmt::format("{}: {}", word_of_status(reply.status), first));
  what_.clear();
}

}  // namespace berth::command
