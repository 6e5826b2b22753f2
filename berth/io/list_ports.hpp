/// CAN interfaces and serial adapters plugged into this computer, from sysfs. Nothing is opened.
#pragma once

#include <cstdint>
#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "berth/can/port_spec.hpp"

namespace berth::io {

/// A device on USB.
struct UsbIdentity {
  std::string vendor;   ///< "16d0"
  std::string product;  ///< "117e"
  std::string maker;    ///< as the device reports it, or empty; so are the next two
  std::string name;
  std::string serial;
  friend bool operator==(const UsbIdentity&, const UsbIdentity&) = default;
};

struct PortSeen {
  can::PortSpec port;
  std::optional<UsbIdentity> usb{};
  // For a CAN interface:
  std::string driver{};        ///< "can", "vcan"; empty if the kernel does not report it
  std::uint32_t bit_rate = 0;  ///< bit/s; 0: not set, or it has none
  std::string state{};         ///< "down", "up", "active", "passive", "bus-off", ...
};

/// CAN interfaces by name, then serial adapters on USB by name. `sys`: the place of sysfs. With another place, for
/// tests, the kernel is not asked for bit rates and states.
[[nodiscard]] std::vector<PortSeen> list_ports(const std::filesystem::path& sys = "/sys");

}  // namespace berth::io
