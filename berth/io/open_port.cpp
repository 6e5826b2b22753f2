#include "berth/io/open_port.hpp"

#include "berth/io/plant_port.hpp"
#include "berth/io/slcan_port.hpp"
#include "berth/io/socketcan_port.hpp"
#include "berth/io/socketcand_port.hpp"

namespace berth::io {

using Opened = tl::expected<std::unique_ptr<can::Port>, std::string>;

Opened open_port(Loop& loop, const can::PortSpec& spec, const PortOptions& options) {
  switch (spec.kind) {
    case can::PortKind::plant: {
      auto port = PlantPort::connect(loop, spec.address, options.bus);
      if (!port) return tl::unexpected(std::move(port.error()));
      return Opened(std::move(*port));
    }
    case can::PortKind::socketcan: {
      auto port = SocketCanPort::open(loop, spec.address, options);
      if (!port) return tl::unexpected("socketcan:" + port.error());
      return Opened(std::move(*port));
    }
    case can::PortKind::socketcand: {
      auto port = SocketcandPort::connect(loop, spec.address,
                                          {.bit_rate = options.bit_rate, .listen_only = options.listen_only});
      if (!port) return tl::unexpected(std::move(port.error()));
      return Opened(std::move(*port));
    }
    case can::PortKind::slcan: {
      auto port =
          SlcanPort::open(loop, spec.address, {.bit_rate = options.bit_rate, .listen_only = options.listen_only});
      if (!port) return tl::unexpected(std::move(port.error()));
      return Opened(std::move(*port));
    }
    case can::PortKind::sim: break;
  }
  return tl::unexpected(can::to_string(spec) +
                        ": the bus is simulated, and no process that simulates it was found; start `berth up` with "
                        "--sim, or `berth plant`");
}

}  // namespace berth::io
