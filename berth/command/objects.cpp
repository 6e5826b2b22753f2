#include "berth/command/objects.hpp"

#include <fmt/format.h>

#include <algorithm>

#include "berth/command/network_variables.hpp"
#include "berth/command/permission.hpp"
#include "berth/od/notation.hpp"
#include "berth/text/quantity.hpp"

namespace berth::command {
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
