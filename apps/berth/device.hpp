/// `berth device`: devices of a plant file on a real port.
#pragma once

#include <cstdint>
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

struct DeviceOptions {
  std::vector<std::string> ports;  ///< "PORT" or "BUS=PORT"
  std::vector<std::string> names;  ///< devices; empty: all that are plugged in
  std::optional<text::Duration> duration;
  std::uint32_t bit_rate = 0;
};

/// Adds the command; `action` becomes what it does.
void add_device(CLI::App& app, Options& options, std::function<int()>& action);
int run_device(const Options& options, const DeviceOptions& device);

}  // namespace berth::cli
