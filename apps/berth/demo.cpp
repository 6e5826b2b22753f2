// `berth demo`: paper 1's five slaves, from blank to operational, then its replacement story (S1.49 to S1.51).
#include "demo_data.hpp"
#include "up.hpp"
#include "verbs.hpp"

namespace berth::cli {

namespace {

int run_demo(const Options& options) {
  if (!options.machine.empty() || !options.sim.empty()) {
    return tell(failure(Exit::usage, "the demo's machine is built in; for your own: berth up MACHINE --sim PLANT"),
                options.json);
  }
  return bring_up(options, {"demo machine", "demo plant", demo_machine, demo_plant});
}

}  // namespace

void add_demo(Verb& berth, Options& options) {
  const Verb demo = berth.add("demo", "the built-in machine: from blank devices to operational, then a replacement",
                              [&options] { return run_demo(options); });
  machine_words(demo, options);
  drive_words(demo, options);
}

}  // namespace berth::cli
