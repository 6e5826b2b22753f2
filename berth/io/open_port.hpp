/// Opens the port named in a machine file or on a command line; it knows every kind.
///
///     auto port = io::open_port(loop, *can::parse_port("socketcan:can0"), {.bit_rate = 125'000});
///     if (!port) print(port.error());     // what, which port, what to do
///
/// A later loss (cable, adapter, server) is not an error of the port: its status goes down (`up` false), the listener
/// is called, and the port tries to come back by itself; `Status::lost` counts frames that never arrived.
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
  /// bit/s; 0 = keep the interface's rate. A different rate is set if the system allows it; else the error says how to
  /// set it.
  std::uint32_t bit_rate = 0;
  /// Never sends, and does not acknowledge if the controller can be set so; `send` returns `Queued::listen_only`.
  bool listen_only = false;
  /// The name of the bus: for `plant:` ports, where one address has several buses.
  std::string bus{};
};

/// Waits at most a few seconds for a device or server to answer. `sim` ports are refused: they have no world here.
/// The port lives in the loop's executor; destroy it before the loop.
[[nodiscard]] tl::expected<std::unique_ptr<can::Port>, std::string> open_port(Loop& loop, const can::PortSpec& spec,
                                                                              const PortOptions& options);

}  // namespace berth::io
