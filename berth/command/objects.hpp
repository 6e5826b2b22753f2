/// Which node and which objects a request means. A node is a node-ID or a slot's name; an object is an index
/// (berth/od/notation.hpp) or its name (berth/od/names.hpp) in the description of the node's device: `eds =` of its
/// slot, else CiA 301's names. What a machine does not know cannot be named, and everything can be given by number.
#pragma once

#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "berth/can/frame.hpp"
#include "berth/co/nmt.hpp"
#include "berth/co/sdo_access.hpp"
#include "berth/command/arguments.hpp"
#include "berth/command/known_object.hpp"
#include "berth/command/nodes.hpp"
#include "berth/tree/session.hpp"

namespace berth::command {

/// The request's "bus" and "node". What is wrong is kept by `arguments`.
[[nodiscard]] NodeArgument node_argument(Arguments& arguments, const design::Machine& machine);

enum class Place : std::uint8_t {
  on_the_bus,   ///< what is asked takes more than SDO
  beneath_too,  ///< SDO is enough: a node beneath gateways will do
};
/// The network that it is on, or that leads to it, to be sent to; or for people why there is none, it is Berth's own
/// device, or it is beneath a gateway and should not.
[[nodiscard]] Checked<operate::Network*> node_network(tree::Session& session, const NodeArgument& node,
                                                      Place place = Place::on_the_bus);
/// Its objects, wherever it is. It stays as long as `direct`; `options` are for a node on the bus itself.
[[nodiscard]] co::SdoAccess& objects_of(tree::Session& session, operate::Network& network, const NodeArgument& node,
                                        const co::SdoOptions& options, std::optional<co::NodeAccess>& direct);

/// The object of a node of a machine, or a network variable by its name (network_variables.hpp).
[[nodiscard]] Checked<KnownObject> find_object(const design::Machine& machine, const NodeArgument& node,
                                               const std::string& word);
/// What an SDO command is about.
struct ObjectArguments {
  NodeArgument node;
  std::vector<KnownObject> objects;  ///< one at least, unless something is wrong
};
/// "node", "object" (one a line), "sub" (of a single object), "type".
[[nodiscard]] ObjectArguments object_arguments(Arguments& arguments, const design::Machine& machine);

/// What `sdo write` is about: a value for each object.
struct WriteArguments {
  ObjectArguments to;
  std::vector<std::vector<std::uint8_t>> values;
};
/// The same, and "value": of several objects one a line.
[[nodiscard]] WriteArguments write_arguments(Arguments& arguments, const design::Machine& machine);

/// "frame": one a line, as candump writes them.
[[nodiscard]] std::vector<can::Frame> frame_arguments(Arguments& arguments);
/// What stands one a line in an argument.
[[nodiscard]] std::vector<std::string> lines_of(const std::string& text);

/// What an NMT command is about.
struct NmtArguments {
  std::string bus;
  co::NmtCommand command = co::NmtCommand::start;
  co::NmtTarget target;
  std::string word;
  NodeId requested_of;  ///< the NMT master that is asked for it; unconfigured: Berth sends the command itself
  std::vector<multilevel::Hop> gateways = {};  ///< to the bus of that master, which is asked through them

  /// 1F82h of that master (CiA 302-2): its sub-index and value.
  [[nodiscard]] std::uint8_t request_sub() const noexcept;
  [[nodiscard]] std::uint8_t request_value() const noexcept;
};
/// "command", "node", which may be "all", and "request".
/// Empty: the word is an NMT command: start, stop, preop, reset-node, reset-comm, or what these lead to ("operational",
/// "stopped", "pre-operational", "reset", "reset-communication"). Else what is wrong, and what to write.
[[nodiscard]] std::string no_nmt_command(const std::string& word);
[[nodiscard]] NmtArguments nmt_arguments(Arguments& arguments, const design::Machine& machine);

}  // namespace berth::command
