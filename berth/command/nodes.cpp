#include "berth/command/nodes.hpp"

#include <fmt/format.h>

#include "berth/base/words.hpp"
#include "berth/od/data_type.hpp"
#include "berth/text/quantity.hpp"
#include "berth/tree/way.hpp"

namespace berth::command {
namespace {

std::string path_of(const design::Slot& slot) { return slot.spec.name.bus + "/" + slot.spec.name.name; }

// Text that looks like a path.
bool like_a_path(std::string_view word) {
  return word.find('/') != std::string_view::npos && word.find_first_not_of("0123456789./") == std::string_view::npos;
}

std::string no_slot(const design::Machine& machine, const std::string& word) {
  if (like_a_path(word)) {
    return fmt::format(
        "node {} is not a path; write node-IDs from 1 to 127, gateways first: 3/5, or 3.2/5 on the second of up to 8 "
        "buses beneath gateway 3",
        text::quoted(word));
  }
  if (machine.slots.empty()) {
    return fmt::format("node {} is not a node-ID from 1 to 127, and there is no machine file whose slots have names",
                       text::quoted(word));
  }
  std::vector<std::string_view> names;
  std::vector<std::string> shown;
  for (const auto& slot : machine.slots) {
    names.emplace_back(slot.spec.name.name);
    shown.push_back(slot.spec.name.name);
  }
  const auto meant = text::closest(word, names);
  if (!meant.empty()) {
    return fmt::format("node {} is not a node-ID from 1 to 127 and no slot; did you mean {}?", text::quoted(word),
                       meant);
  }
  return fmt::format("node {} is not a node-ID from 1 to 127 and no slot; the slots are {}", text::quoted(word),
                     some_of(shown));
}

// "3/5" is node 5 beneath gateway 3. If Berth has a port on that bus, or on one on the way, the way begins there.
NodeArgument by_path(const design::Machine& machine, const std::string& bus, const multilevel::Path& path) {
  const auto* const top = bus.empty() ? machine.top() : machine.bus(bus);
  const auto* const on = top == nullptr ? nullptr : tree::bus_at(machine, {top->name, path.gateways});
  if (on == nullptr) return {bus, path.node, nullptr, path.gateways};
  const auto* const slot = machine.slot(on->name, path.node);
  auto way = tree::way_to(machine, on->name);
  return {way.bus, path.node, slot == nullptr ? nullptr : slot->description, std::move(way.gateways)};
}

}  // namespace

Checked<NodeArgument> find_node(const design::Machine& machine, const std::string& bus, const std::string& word) {
  const auto slots = machine.slots_named(bus, word);
  const auto number = od::parse_number(word);
  const bool is_id =
      number && !number->negative && !number->node_id && number->magnitude >= 1 && number->magnitude <= 127;
  const NodeId id = is_id ? NodeId(static_cast<std::uint8_t>(number->magnitude)) : NodeId();
  std::vector<std::string> meanings;
  for (const auto* const slot : slots) {
    meanings.push_back(fmt::format("{} (node-ID {})", path_of(*slot), slot->spec.id.value()));
  }
  const bool slot_of_that_id = slots.size() == 1 && slots.front()->spec.id == id;
  if (is_id && !slots.empty() && !slot_of_that_id) meanings.push_back(fmt::format("node-ID {}", id.value()));
  if (meanings.size() > 1) {
    return tl::unexpected(
        fmt::format("node {} can be {}; name it with its bus", text::quoted(word), some_of(meanings)));
  }
  if (!slots.empty()) {
    const auto& spec = slots.front()->spec;
    auto way = tree::way_to(machine, spec.name.bus);
    return NodeArgument{way.bus, spec.id, machine.description(spec.name.bus, spec.id), std::move(way.gateways)};
  }
  const auto* const line = machine.bus(bus);
  if (is_id && line != nullptr && !line->own_port) {
    auto way = tree::way_to(machine, bus);
    return NodeArgument{way.bus, id, machine.description(bus, id), std::move(way.gateways)};
  }
  if (is_id) {
    const std::string on = bus.empty() && machine.buses.size() == 1 ? machine.buses.front().name : bus;
    return NodeArgument{bus, id, machine.description(on, id)};
  }
  if (const auto path = multilevel::parse_path(word)) return by_path(machine, bus, *path);
  return tl::unexpected(no_slot(machine, word));
}

const design::Bus* bus_of(const design::Machine& machine, const NodeArgument& node) {
  const bool only = node.bus.empty() && machine.buses.size() == 1;
  return tree::bus_at(machine, {only ? machine.buses.front().name : node.bus, node.gateways});
}

Checked<const design::Bus*> known_bus_of(const design::Machine& machine, const NodeArgument& node) {
  if (const auto* const bus = bus_of(machine, node)) return bus;
  std::vector<std::string> names;
  for (const auto* const bus : machine.all_buses()) names.push_back(bus->name);
  if (node.bus.empty() && machine.buses.size() != 1) {
    return tl::unexpected(
        fmt::format("node {}: on which bus? Name its bus; the buses are {}", node.text(), some_of(names)));
  }
  return tl::unexpected(
      fmt::format("node {}: no bus of the machine is there; the buses are {} (gateway = {{ bus, slot }} "
                  "of a [bus.NAME] says beneath which gateway it is)",
                  node.text(), some_of(names)));
}

}  // namespace berth::command
