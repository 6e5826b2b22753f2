// `berth demo`: paper 1's five slaves, from blank to operational, then its replacement story (S1.49 to S1.51).
#include "demo_data.hpp"
#include "up.hpp"

namespace berth::cli {

int run_demo(const Options& options) {
  if (!options.machine.empty() || !options.sim.empty()) {
    return tell(failure(Exit::usage, "the demo's machine is built in; for your own: berth up MACHINE --sim PLANT"),
                options.json);
  }
  return bring_up(options, {"demo machine", "demo plant", demo_machine, demo_plant});
}

}  // namespace berth::cli
