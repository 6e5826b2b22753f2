#include "berth/command/execute.hpp"

#include <fmt/format.h>

#include "berth/command/confirm.hpp"
#include "berth/command/run.hpp"
#include "berth/command/verbs.hpp"
#include "berth/text/quantity.hpp"

namespace berth::command {

rt::Task<void> execute(Session& session, const Request& request, Reply& reply, Turn turn) {
  auto progress = std::move(reply.progress);
  reply = Reply{};
  reply.progress = std::move(progress);
  const Verb* const wanted = verb(request.verb);
  if (wanted == nullptr) {
    co_return refuse(reply, 2, fmt::format("there is no command {}", text::quoted(request.verb)));
  }
  if (!confirmed(session, request, reply)) co_return;
  const bool holds = turn == Turn::held && wanted->run == lss_command;
  if (holds) co_return co_await lss_service(session, request, reply);
  co_await wanted->run(session, request, reply);
}

}  // namespace berth::command
