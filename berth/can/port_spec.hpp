/// The text that names a port, in machine files and on the command line.
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <string_view>

namespace berth::can {

enum class PortKind : std::uint8_t {
  sim,         ///< "sim": a simulated bus, the plant file's bus of the same name
  socketcan,   ///< "socketcan:can0"
  slcan,       ///< "slcan:/dev/ttyACM0"
  socketcand,  ///< "socketcand://host:29536/can0"
  plant,       ///< "plant:/run/plant.sock": the bus of the same name of a `berth plant` in another process
};

struct PortSpec {
  PortKind kind = PortKind::sim;
  std::string address;  ///< the text after the kind: "can0", "/dev/ttyACM0", "host:29536/can0"; empty for `sim`
  friend bool operator==(const PortSpec&, const PortSpec&) = default;
};
[[nodiscard]] std::string to_string(const PortSpec& port);  ///< as in the file
[[nodiscard]] std::optional<PortSpec> parse_port(std::string_view text);

}  // namespace berth::can
