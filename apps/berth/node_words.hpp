/// Nodes of a machine as verbs that work on its files accept them: `berth analyze --node 3/5`.
#pragma once

#include <string>
#include <tl/expected.hpp>
#include <vector>

#include "berth/design/machine.hpp"
#include "berth/multilevel/path.hpp"
#include "output.hpp"

namespace berth::cli {

struct MeantNode {
  const design::Bus* bus = nullptr;  ///< its bus, in the machine
  NodeId node;
  const design::Slot* slot = nullptr;  ///< null: it has none
  std::vector<multilevel::Hop> gateways = {};
  std::string text;  ///< "5", "3/5"
};
/// `word`: "5", "left motor", "left/left motor", "3/5", "3.2/5". `bus`: from `--bus`, may be empty.
[[nodiscard]] tl::expected<MeantNode, Failure> meant_node(const design::Machine& machine, const std::string& bus,
                                                          const std::string& word);
[[nodiscard]] tl::expected<std::vector<MeantNode>, Failure> meant_nodes(const design::Machine& machine,
                                                                        const std::string& bus,
                                                                        const std::vector<std::string>& words);

/// Berth has no port on this bus beneath a gateway. `why` one is needed, and how to fix it.
[[nodiscard]] Failure no_port(const design::Bus& bus, const std::string& why, const std::string& fix);
/// "5/13/N": the form of names of nodes on a bus.
[[nodiscard]] std::string nodes_of(const design::Machine& machine, const design::Bus& bus);

/// There is no such bus; lists those that exist.
[[nodiscard]] Failure no_such_bus(const design::Machine& machine, const std::string& bus);

}  // namespace berth::cli
