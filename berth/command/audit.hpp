/// The audit log: every request that changes something, with who, when, what and the answer, in the store's history
/// (`berth history --audit`). A request is written down before it is carried out, and its answer after it: what a crash
/// interrupts stands there without an answer. It is as safe from a crash as the store.
///
///     Audit audit(session, "control socket", request);   // nothing for a request that only reads and asks
///     co_await execute(session, request, reply);
///     audit.answered(reply);
#pragma once

#include <string>
#include <string_view>

#include "berth/command/reply.hpp"
#include "berth/tree/session.hpp"

namespace berth::command {

/// The event of its lines in the history.
inline constexpr std::string_view audit_event = "audit";

/// Carrying it out changes something: by the table, and by arguments that say so. What the table does not have is the
/// process's own ("sim"), and changes the simulated plant, but for its list of devices.
[[nodiscard]] bool changes(const Request& request);
/// "sdo write node=5 object=1017h value=500": for people, at most some 200 bytes, in one line.
[[nodiscard]] std::string words_of(const Request& request);
/// "done", "no", "wrong usage", "failed".
[[nodiscard]] const char* word_of_status(int status) noexcept;

/// A line by itself.
void audit(tree::Session& session, std::string_view who, std::string_view what, std::string_view answer);

class Audit {
 public:
  /// The session must stay.
  Audit(tree::Session& session, std::string_view who, const Request& request);
  /// Not answered: it was broken off.
  ~Audit();
  Audit(const Audit&) = delete;
  Audit& operator=(const Audit&) = delete;
  void answered(const Reply& reply);

 private:
  tree::Session* session_;
  std::string who_;
  std::string what_;  // empty: nothing is written (any more)
};

}  // namespace berth::command
