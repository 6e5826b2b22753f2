/// `--real-time PRIORITY` of the commands that run for long on a real bus.
#pragma once

#include <functional>

#include "options.hpp"

namespace CLI {
class App;
}

namespace berth::cli {

/// Adds the flag to those commands of `app` that are there by now; with it, `action` first gets the priority and locks
/// the memory, or ends with status 3 and what the system wants for it.
void add_real_time(CLI::App& app, const Options& options, std::function<int()>& action);

}  // namespace berth::cli
