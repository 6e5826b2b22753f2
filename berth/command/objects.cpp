#include "berth/command/objects.hpp"

#include <fmt/format.h>

#include <algorithm>

#include "berth/base/words.hpp"
#include "berth/command/network_variables.hpp"
#include "berth/command/permission.hpp"
#include "berth/decode/standard_objects.hpp"
#include "berth/od/names.hpp"
#include "berth/od/notation.hpp"
#include "berth/text/quantity.hpp"

namespace berth::command {
namespace {

// ---- nodes ----

std::string path_of(const design::Slot& slot) { return slot.spec.name.bus + "/" + slot.spec.name.name; }

// What begins as a path and is none.
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

// "3/5": node 5 beneath gateway 3; by Berth's own port where that bus, or one on the way, has one.
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

NodeArgument node_argument(Arguments& arguments, const design::Machine& machine) {
  const std::string word = arguments.required("node");
  if (word.empty()) return {};
  auto found = find_node(machine, arguments.text("bus"), word);
  if (found) return std::move(*found);
  arguments.wrong(found.error());
  return {arguments.text("bus"), NodeId(1), nullptr};
}

Checked<operate::Network*> node_network(tree::Session& session, const NodeArgument& node, Place place) {
  const auto network = network_for(session, node.bus, Use::send);
  if (network && !node.gateways.empty()) {
    if (place == Place::beneath_too) return network;
    return tl::unexpected(
        fmt::format("node {} is beneath a gateway of bus {}, and Berth has no port there: this needs more than SDO",
                    node.text(), (*network)->bus().name));
  }
  if (network && node.node == (*network)->bus().master) {
    return tl::unexpected(
        fmt::format("node-ID {} is Berth's own on bus {}", node.node.value(), (*network)->bus().name));
  }
  return network;
}

co::SdoAccess& objects_of(tree::Session& session, operate::Network& network, const NodeArgument& node,
                          const co::SdoOptions& options, std::optional<co::NodeAccess>& direct) {
  if (!node.gateways.empty()) return session.tree().routes(network).access({node.gateways, node.node});
  return direct.emplace(network.services().sdo, node.node, options);
}

// ---- objects ----

KnownObject known_object(const od::Description* description, ObjectRef ref) {
  KnownObject object;
  object.ref = ref;
  if (description != nullptr) {
    object.described = description->find(ref);
    object.name = od::full_name(*description, ref);
  }
  if (object.described != nullptr) {
    object.type = object.described->type;
    object.limits = description->limits(*object.described);
    object.meaning = description->meaning(ref);
    return object;
  }
  auto standard = decode::standard_object(ref);
  object.type = standard.type;
  if (object.name.empty()) object.name = od::full_name(decode::standard_names(), ref);
  if (object.name.empty()) object.name = std::move(standard.name);
  return object;
}

Checked<KnownObject> find_object(const od::Description* description, const std::string& word) {
  const auto ref = od::find_object(description != nullptr ? *description : decode::standard_names(), word);
  if (ref) return known_object(description, *ref);
  const bool advice = ref.error().kind == od::NoObject::Kind::other && !ref.error().why.ends_with('?');
  return tl::unexpected(ref.error().why +
                        (advice ? "; `berth sdo dump NODE` lists the objects, and an index is written 1018h:04" : ""));
}

Checked<KnownObject> find_object(const design::Machine& machine, const NodeArgument& node, const std::string& word) {
  auto object = find_object(node.description.get(), word);
  if (object) return object;
  auto variable = network_variable(machine, node, word);
  return variable ? Checked<KnownObject>(std::move(*variable)) : object;
}

std::vector<std::string> lines_of(const std::string& text) {
  std::vector<std::string> lines;
  std::size_t at = 0;
  while (at <= text.size()) {
    const auto end = std::min(text.find('\n', at), text.size());
    lines.push_back(text.substr(at, end - at));
    at = end + 1;
  }
  return lines;
}

namespace {

void give_sub_index(Arguments& arguments, ObjectArguments& into) {
  if (!arguments.has("sub") || into.objects.size() != 1) {
    if (arguments.has("sub")) arguments.wrong("a sub-index by itself belongs to a single object");
    return;
  }
  const auto sub = od::read_sub_index(arguments.text("sub"));
  if (!sub) return arguments.wrong(sub.error());
  KnownObject& object = into.objects.front();
  const auto written = od::read_object(arguments.text("object"));
  if ((written && written->sub) || object.ref.sub != 0) {
    return arguments.wrong(fmt::format("{} has a sub-index already, and {} is another",
                                       text::quoted(arguments.text("object")), text::quoted(arguments.text("sub"))));
  }
  object = known_object(into.node.description.get(), {object.ref.index, *sub});
}

void give_type(Arguments& arguments, ObjectArguments& into) {
  const std::string type = arguments.text("type");
  if (type.empty()) return;
  const auto known = od::data_type(type);
  if (!known) {
    return arguments.wrong(
        fmt::format("{} is not a data type; use one of b i8 i16 i24 i32 i40 i48 i56 i64 u8 u16 u24 u32 u40 u48 u56 u64 "
                    "r32 r64 t td vs os us d, or CiA 301's names such as UNSIGNED32",
                    text::quoted(type)));
  }
  for (KnownObject& object : into.objects) {
    object.type = *known;
    object.type_given = true;
  }
}

}  // namespace

ObjectArguments object_arguments(Arguments& arguments, const design::Machine& machine) {
  ObjectArguments wanted;
  wanted.node = node_argument(arguments, machine);
  const std::string words = arguments.required("object");
  if (!arguments.good()) return wanted;
  for (const auto& word : lines_of(words)) {
    auto object = find_object(machine, wanted.node, word);
    if (!object) {
      arguments.wrong(object.error());
      return wanted;
    }
    wanted.objects.push_back(std::move(*object));
  }
  give_sub_index(arguments, wanted);
  give_type(arguments, wanted);
  return wanted;
}

}  // namespace berth::command
