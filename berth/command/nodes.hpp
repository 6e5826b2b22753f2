/// Finds the node that a request means: a node-ID, a slot's name, or a path through gateways.
#pragma once

#include <memory>
#include <string>
#include <vector>

#include "berth/command/checked.hpp"
#include "berth/design/machine.hpp"
#include "berth/multilevel/path.hpp"
#include "berth/od/description.hpp"

namespace berth::command {

/// A node as a request names it.
struct NodeArgument {
  std::string bus;  ///< from the request, else that of the slot; empty: the machine's only one
  NodeId node;
  std::shared_ptr<const od::Description> description;  ///< null: not known
  std::vector<multilevel::Hop> gateways = {};          ///< between that bus and the node, topmost first

  /// "5", "3/5".
  [[nodiscard]] std::string text() const { return multilevel::to_string(multilevel::Path{gateways, node}); }
  /// The same of a node beneath gateways; else empty.
  [[nodiscard]] std::string path() const { return gateways.empty() ? std::string() : text(); }
};
/// `word`: "5", "left", "line/left", "3/5" (node 5 beneath gateway 3), "3.2/5" (on its second bus beneath); slots'
/// names in either case. A slot of a bus without a port is beneath the gateways that lead there. Errors and ambiguities
/// are for users, with the possible choices.
[[nodiscard]] Checked<NodeArgument> find_node(const design::Machine& machine, const std::string& bus,
                                              const std::string& word);
/// The machine's bus with this node, with or without a port of Berth's; null: none.
[[nodiscard]] const design::Bus* bus_of(const design::Machine& machine, const NodeArgument& node);
/// The same, or the reason for users why there is none.
[[nodiscard]] Checked<const design::Bus*> known_bus_of(const design::Machine& machine, const NodeArgument& node);

}  // namespace berth::command
