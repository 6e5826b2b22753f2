#include "berth/can/port_spec.hpp"

namespace berth::can {

std::optional<PortSpec> parse_port(std::string_view text) {
  if (text == "sim") return PortSpec{};
  const auto rest = [&](std::string_view prefix) { return std::string(text.substr(prefix.size())); };
  PortSpec port;
  if (text.starts_with("socketcan:")) {
    port = {PortKind::socketcan, rest("socketcan:")};
  } else if (text.starts_with("slcan:")) {
    port = {PortKind::slcan, rest("slcan:")};
  } else if (text.starts_with("plant:")) {
    port = {PortKind::plant, rest("plant:")};
  } else if (text.starts_with("socketcand://")) {
    port = {PortKind::socketcand, rest("socketcand://")};
    const auto slash = port.address.find('/');
    if (slash == 0 || slash == std::string::npos || slash + 1 == port.address.size()) return std::nullopt;
  }
  if (port.address.empty()) return std::nullopt;
  return port;
}

std::string to_string(const PortSpec& port) {
  switch (port.kind) {
    case PortKind::sim: return "sim";
    case PortKind::socketcan: return "socketcan:" + port.address;
    case PortKind::slcan: return "slcan:" + port.address;
    case PortKind::socketcand: return "socketcand://" + port.address;
    case PortKind::plant: return "plant:" + port.address;
  }
  return "sim";
}

}  // namespace berth::can
