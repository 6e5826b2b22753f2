#include "node_words.hpp"

#include <fmt/format.h>

#include "berth/command/objects.hpp"
#include "berth/tree/beneath.hpp"
#include "options.hpp"

namespace berth::cli {

tl::expected<MeantNode, Failure> meant_node(const design::Machine& machine, const std::string& bus,
                                            const std::string& word) {
  const auto found = command::find_node(machine, bus, word);
  if (!found) return tl::unexpected(failure(Exit::usage, found.error()));
  const auto on = command::known_bus_of(machine, *found);
  if (!on) return tl::unexpected(failure(Exit::usage, on.error()));
  return MeantNode{*on, found->node, machine.slot((*on)->name, found->node), found->gateways, found->text()};
}

tl::expected<std::vector<MeantNode>, Failure> meant_nodes(const design::Machine& machine, const std::string& bus,
                                                          const std::vector<std::string>& words) {
  std::vector<MeantNode> all;
  for (const auto& word : words) {
    auto one = meant_node(machine, bus, word);
    if (!one) return tl::unexpected(one.error());
    all.push_back(std::move(*one));
  }
  return all;
}

Failure no_port(const design::Bus& bus, const std::string& why, const std::string& fix) {
  return failure(Exit::usage, fmt::format("bus {} is beneath gateway {} of bus {}, and Berth has no port there (port = "
                                          "\"gateway\"): {}; {}",
                                          bus.name, bus.gateway->slot.value(), bus.gateway->bus, why, fix));
}

std::string nodes_of(const design::Machine& machine, const design::Bus& bus) {
  std::string text;
  for (const auto& hop : tree::way_to(machine, bus.name).gateways) text += multilevel::to_string(hop) + "/";
  return text + "N";
}

Failure no_such_bus(const design::Machine& machine, const std::string& bus) {
  std::string names;
  for (const auto* const each : machine.all_buses()) names += (names.empty() ? "" : ", ") + each->name;
  return failure(Exit::usage, fmt::format("{}: there is no bus \"{}\"; use {}", machine.file, bus, names));
}

}  // namespace berth::cli
