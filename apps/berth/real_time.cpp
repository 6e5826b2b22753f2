#include "real_time.hpp"

#include <CLI/CLI.hpp>
#include <memory>

#include "berth/io/realtime.hpp"
#include "output.hpp"

namespace berth::cli {

void add_real_time(CLI::App& app, const Options& options, std::function<int()>& action) {
  const auto priority = std::make_shared<int>(0);
  for (const char* const name : {"up", "device", "serve"}) {
    app.get_subcommand(name)
        ->add_option("--real-time", *priority, "run with this SCHED_FIFO priority, memory locked")
        ->check(CLI::Range(1, 99))
        ->option_text("PRIORITY");
  }
  app.final_callback([&options, &action, priority] {
    if (*priority == 0) return;
    action = [&options, priority, then = action] {
      const auto done = io::go_real_time({.priority = *priority, .lock_memory = true});
      return done ? then() : tell(failure(Exit::failed, done.error()), options.json);
    };
  });
}

}  // namespace berth::cli
