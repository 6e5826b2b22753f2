// `berth studio`: shows a machine in the browser, like `berth up --studio`. With only `--port`: the devices of one bus,
// without a machine file and without the main job.
#include <fmt/format.h>

#include "drive.hpp"
#include "machine_file.hpp"
#include "studio_host.hpp"
#include "up.hpp"
#include "verbs.hpp"

namespace berth::cli {
namespace {

// One bus without a machine: Berth sends only the page's requests, and only reads until the user unlocks it there.
int run_bench(const Options& options) {
  if (const auto no = studio_refused(options)) return tell(*no, options.json);
  auto made = MachineRun::make(options, {});
  if (!made) return tell(made.error(), options.json);
  MachineRun& run = **made;
  if (const auto clear = run.strangers().listen_first(); !clear) return tell(clear.error(), options.json);
  const auto served = serve_bench(run, options);
  if (!served) return tell(served.error(), options.json);
  return run.record().finish(Exit::done);
}

int run_studio(const Options& wanted) {
  Options options = wanted;
  if (options.offers.studio.where.empty()) options.offers.studio.where = "true";
  const bool bench = options.machine.empty() && !options.ports.empty();
  if (bench && options.sim.plant.empty()) return run_bench(options);
  options.sim.pace = true;
  return run_up(options);
}

}  // namespace

void add_studio(Verb& berth, Options& options) {
  const Verb studio = berth.add("studio", "a machine in the browser, or the devices of one bus",
                                [&options] { return run_studio(options); });
  machine_words(studio, options, {.sends = false});
  machine_word(studio, options);
  studio
      .word("--listen", options.offers.studio.where,
            "where (default 127.0.0.1, the first free port from 8302); for other computers with --certificate")
      .shown("HOST:PORT");
  studio_door_words(studio, options, "--");
  studio.word("--control", options.control, "socket for other commands (default: by the machine's name)")
      .shown("SOCKET");
  studio.word("--bitrate", options.bit_rate, "bit/s, for --port without a machine file")
      .from_to(10'000, 1'000'000)
      .shown("BIT/S");
  studio.word("--eds", options.eds, "descriptions of devices without a slot: FILE for all, NODE=FILE for one")
      .one_each()
      .shown("[NODE=]FILE");
  beside_master_flag(studio, options);
  studio.footer(
      "Examples:\n  berth studio machine.toml --sim plant.toml\n  berth studio machine.toml\n"
      "  berth studio --port can0 --eds drive.eds\n"
      "It prints the address to open, and ends with Ctrl-C. A simulated machine runs in\nreal time. With --port and no "
      "machine file nothing is brought up: Berth\nreads and asks. What changes a device is refused until you\nunlock "
      "the bus in the page.");
}

}  // namespace berth::cli
