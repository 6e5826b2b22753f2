/// The audit log: every request that changes something, with its sender, time, content and answer, in the store's
/// history (`berth history --audit`). A request is written before it is carried out, and its answer after it: a request
/// that a crash interrupted has no answer. The log survives a crash like the store.
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

/// Whether carrying it out changes something: by the table of verbs, and by arguments that say so. A verb that is not
/// in the table is the process's own: "fleet" asks; "sim" changes the simulated plant, except for its list of devices.
[[nodiscard]] bool changes(const Request& request);
/// "sdo write node=5 object=1017h value=500": for users, at most about 200 bytes, in one line.
[[nodiscard]] std::string words_of(const Request& request);
/// "done", "no", "wrong usage", "failed".
[[nodiscard]] const char* word_of_status(int status) noexcept;

/// Writes a single line.
void audit(tree::Session& session, std::string_view who, std::string_view what, std::string_view answer);

class Audit {
 public:
  /// The session must outlive this.
  Audit(tree::Session& session, std::string_view who, const Request& request);
  /// If not answered: it was interrupted.
  ~Audit();
  Audit(const Audit&) = delete;
  Audit& operator=(const Audit&) = delete;
  void answered(const Reply& reply);

 private:
  tree::Session* session_;
  std::string who_;
  std::string what_;  // empty: nothing (more) is written
};

}  // namespace berth::command
