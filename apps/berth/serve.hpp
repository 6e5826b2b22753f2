/// `berth serve`: buses offered to other programs.
#pragma once

#include <functional>
#include <optional>
#include <string>
#include <vector>

#include "berth/text/quantity.hpp"
#include "options.hpp"

namespace CLI {
class App;
}

namespace berth::cli {

struct ServeOptions {
  std::string plant;               ///< plant file; empty: real ports
  std::vector<std::string> ports;  ///< "NAME=PORT" or "PORT"
  std::string listen = "127.0.0.1:29536";
  std::optional<text::Duration> duration;
  std::uint32_t bit_rate = 0;
  bool listen_only = false;
};

/// Adds the command; `action` becomes what it does.
void add_serve(CLI::App& app, Options& options, std::function<int()>& action);
int run_serve(const Options& options, const ServeOptions& serve);

}  // namespace berth::cli
