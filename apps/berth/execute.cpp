#include "execute.hpp"

#include "berth/command/execute.hpp"
#include "berth/command/verbs.hpp"
#include "berth/rt/scope.hpp"

namespace berth::cli {
namespace {

rt::Task<void> carry_out(tree::Session& session, const command::Request& request, command::Reply& reply, bool& over) {
  co_await command::execute(session, request, reply);
  over = true;
}

}  // namespace

bool execute_in(MachineRun& run, const command::Request& request, command::Reply& reply, rt::Duration limit,
                const std::function<bool()>& goes_on) {
  bool over = false;
  rt::Scope scope(run.driver().executor());
  scope.spawn(carry_out(run.session(), request, reply, over));
  wait_until(
      run.driver(), run.interrupt(), [&] { return over || run.guards().dry_run_over() || !goes_on(); }, limit);
  return over;
}

}  // namespace berth::cli
