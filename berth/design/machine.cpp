#include "berth/design/machine.hpp"

#include <algorithm>
#include <array>

namespace berth::design {

const char* name(Role role) noexcept {
  switch (role) {
    case Role::master: return "master";
    case Role::commissioner: return "commissioner";
    case Role::observer: return "observer";
  }
  return "master";
}

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

const Bus* Machine::bus(std::string_view bus_name) const noexcept {
  const auto it = std::ranges::find(buses, bus_name, &Bus::name);
  return it == buses.end() ? nullptr : &*it;
}

const Slot* Machine::slot(std::string_view slot_name) const noexcept {
  const auto it = std::ranges::find_if(slots, [&](const Slot& s) { return s.spec.name.name == slot_name; });
  return it == slots.end() ? nullptr : &*it;
}

const Slot* Machine::slot(std::string_view bus_name, NodeId id) const noexcept {
  const auto it =
      std::ranges::find_if(slots, [&](const Slot& s) { return s.spec.name.bus == bus_name && s.spec.id == id; });
  return it == slots.end() ? nullptr : &*it;
}

std::vector<places::SlotSpec> Machine::specs(std::string_view bus_name) const {
  std::vector<places::SlotSpec> out;
  for (const auto& s : slots) {
    if (s.spec.name.bus == bus_name) out.push_back(s.spec);
  }
  return out;
}

bool is_canopen_bitrate(std::uint32_t bitrate) noexcept {
  constexpr std::array<std::uint32_t, 8> rates{10'000, 20'000, 50'000, 125'000, 250'000, 500'000, 800'000, 1'000'000};
  return std::ranges::find(rates, bitrate) != rates.end();
}

}  // namespace berth::design
