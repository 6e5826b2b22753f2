#include "execute.hpp"

#include "berth/rt/scope.hpp"

namespace berth::cli {
namespace {

rt::Task<void> run(operate::Session& session, const operate::CommandRequest& request, operate::CommandReply& reply,
                   bool& over) {
  co_await operate::execute(session, request, reply);
  over = true;
}

}  // namespace

bool execute_in(Rig& rig, const operate::CommandRequest& request, operate::CommandReply& reply, rt::Duration limit) {
  bool over = false;
  rt::Scope scope(rig.driver().executor());
  scope.spawn(run(rig.session(), request, reply, over));
  wait_until(
      rig.driver(), rig.interrupt(), [&] { return over || rig.guards().dry_run_over(); }, limit);
  return over;
}

}  // namespace berth::cli
