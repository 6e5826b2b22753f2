#include "berth/command/permission.hpp"

#include <fmt/format.h>

#include "berth/base/words.hpp"
#include "berth/command/nodes.hpp"
#include "berth/text/printable.hpp"
#include "berth/text/quantity.hpp"
#include "berth/tree/way.hpp"

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
  // The port would refuse every frame, and a binding cleared meanwhile would be lost.
  const std::string& shut_by = network->services().shut_by;
  if (use != Use::look && !shut_by.empty())
    return tl::unexpected(fmt::format("bus {}: {}; Berth sends nothing there", network->bus().name, shut_by));
  return network;
}

namespace {

std::vector<const design::Slot*> slots_meant(const design::Machine& machine, const std::string& wanted) {
  auto meant = machine.slots_named({}, wanted);
  const auto number = text::parse_ranges(wanted, 1, 127);
  if (!meant.empty() || !number || number->size() != 1) return meant;
  for (const auto& s : machine.slots) {
    if (s.spec.id.value() == number->front()) meant.push_back(&s);
  }
  return meant;
}

}  // namespace

tl::expected<OwnSlot, std::string> own_slot(Session& session, const std::string& bus, const std::string& slot,
                                            std::string_view beneath) {
  const design::Machine& machine = session.machine();
  const std::string wanted = bus.empty() ? slot : bus + "/" + slot;
  const auto meant = slots_meant(machine, wanted);
  if (meant.empty()) {
    const auto node = find_node(machine, bus, slot);
    return tl::unexpected(node ? fmt::format("the machine has no slot {}", text::quoted(wanted)) : node.error());
  }
  if (meant.size() > 1) {
    std::vector<std::string> each;
    for (const auto* const s : meant) each.push_back(s->spec.name.bus + "/" + s->spec.name.name);
    return tl::unexpected(fmt::format("{} can be {}; name it with its bus", text::quoted(wanted), some_of(each)));
  }
  const auto& name = meant.front()->spec.name;
  if (Network* const network = session.network(name.bus)) return OwnSlot{network, name.name};
  const auto way = tree::way_to(machine, name.bus);
  return tl::unexpected(fmt::format("slot {} is beneath gateway {} of bus {}, and Berth has no port there; {}",
                                    name.name, way.gateways.empty() ? 0 : way.gateways.front().gateway.value(), way.bus,
                                    beneath));
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
