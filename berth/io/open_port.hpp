/// Opens the port that a machine file or a command line names: one place that knows every kind.
///
///     auto port = io::open_port(loop, *can::parse_port("socketcan:can0"), {.bit_rate = 125'000});
///     if (!port) print(port.error());     // what, which port, what to do
///
/// What is lost later (cable, adapter, server) is no error of the port: its status goes down (`up` false), the listener
/// is told, and the port tries to come back by itself; `Status::lost` counts frames that never arrived.
#pragma once

#include <cstdint>
#include <memory>
#include <string>
#include <tl/expected.hpp>

#include "berth/can/port.hpp"
#include "berth/can/port_spec.hpp"
#include "berth/io/loop.hpp"

namespace berth::io {

struct PortOptions {
  /// bit/s; 0 = as the interface stands. Another rate than the interface's is set when the system allows it, else it is
  /// an error that says how to set it.
  std::uint32_t bit_rate = 0;
  /// Never sends, not even acknowledges, where the controller can do so; `send` says `Queued::listen_only`.
  bool listen_only = false;
  /// The name of the bus: for `plant:` ports, which have several behind one address.
  std::string bus{};
};

/// Waits at most a few seconds for a device or server to answer. `sim` ports are refused: they have no world here.
/// The port lives in the loop's executor; destroy it before the loop.
[[nodiscard]] tl::expected<std::unique_ptr<can::Port>, std::string> open_port(Loop& loop, const can::PortSpec& spec,
                                                                              const PortOptions& options);

}  // namespace berth::io
