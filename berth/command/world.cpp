// world: only the process that simulates the machine controls its time. That process (apps/berth) answers these
// requests before they get here.
#include "berth/command/arguments.hpp"
#include "berth/command/reply.hpp"
#include "berth/command/run.hpp"

namespace berth::command {

rt::Task<void> world_command(Session& session, const Request& request, Reply& reply) {
  const Arguments arguments(request);
  if (!arguments.good()) co_return refuse(reply, 2, arguments.problem());
  refuse(reply, 1,
         "no simulated world of " + session.machine().name +
             " runs here in real time: `berth up MACHINE --sim PLANT --pace` runs one, and `berth world` asks that");
}

}  // namespace berth::command
