#include "berth/command/permission.hpp"

#include <fmt/format.h>

#include "berth/text/quantity.hpp"

namespace berth::command {

using operate::Network;
using tree::Session;

tl::expected<Network*, std::string> network_for(Session& session, const std::string& bus, Use use) {
  Network* const network = session.network(bus);
  if (network == nullptr && session.tree().bus(bus) != nullptr) {
    return tl::unexpected(fmt::format(
        "Berth has no port on bus {} (port = \"gateway\"): only SDO reaches its nodes, and NMT by the gateway's master",
        text::quoted(bus)));
  }
  if (network == nullptr) {
    std::string names;
    for (const auto& b : session.machine().buses) names += (names.empty() ? "" : ", ") + b.name;
    return tl::unexpected(bus.empty() ? fmt::format("the machine has several buses; give --bus, one of {}", names)
                                      : fmt::format("the machine has no bus {}; it has {}", text::quoted(bus), names));
  }
  const design::Role role = network->bus().role;
  if (role == design::Role::observer && use != Use::look) {
    return tl::unexpected(
        fmt::format("bus {} is only observed (role = \"observer\"): Berth sends no frame there", network->bus().name));
  }
  if (role == design::Role::commissioner && use == Use::command) {
    return tl::unexpected(
        fmt::format("bus {} is only commissioned (role = \"commissioner\"): Berth sends no NMT start "
                    "or reset there",
                    network->bus().name));
  }
  return network;
}

Network* network_of_slot(Session& session, const std::string& bus, const std::string& slot, std::string& name) {
  const std::string wanted = bus.empty() ? slot : bus + "/" + slot;
  auto meant = session.machine().slots_named({}, wanted);
  const auto number = text::parse_ranges(wanted, 1, 127);
  if (meant.empty() && number && number->size() == 1) {
    for (const auto& s : session.machine().slots) {
      if (s.spec.id.value() == number->front()) meant.push_back(&s);
    }
  }
  if (meant.size() != 1) return nullptr;
  name = meant.front()->spec.name.name;
  return session.network(meant.front()->spec.name.bus);
}

tl::expected<std::vector<Network*>, std::string> networks_for(Session& session, const std::string& bus, Use use) {
  std::vector<Network*> networks;
  for (const auto& b : session.machine().buses) {
    if (!bus.empty() && b.name != bus) continue;
    const auto network = network_for(session, b.name, use);
    if (!network) return tl::unexpected(network.error());
    networks.push_back(*network);
  }
  if (!networks.empty()) return networks;
  return tl::unexpected(network_for(session, bus, use).error());
}

}  // namespace berth::command
