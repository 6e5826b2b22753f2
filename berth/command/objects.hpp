/// Finds the node and the objects that a request means. A node is a node-ID or a slot's name; an object is an index
/// (berth/od/notation.hpp) or its name (berth/od/names.hpp) in the description of the node's device: `eds =` of its
/// slot, else CiA 301's names. Unknown objects have no names, but everything can be given by number.
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

/// The request's "bus" and "node". `arguments` keeps an error.
[[nodiscard]] NodeArgument node_argument(Arguments& arguments, const design::Machine& machine);

enum class Place : std::uint8_t {
  on_the_bus,   ///< the request needs more than SDO
  beneath_too,  ///< SDO is enough: a node beneath gateways is allowed
};
/// The network to send to: the node's own, or the one that leads to it. Or the reason for users: there is none, the
/// node is Berth's own device, or it is beneath a gateway where that is not allowed.
[[nodiscard]] Checked<operate::Network*> node_network(tree::Session& session, const NodeArgument& node,
                                                      Place place = Place::on_the_bus);
/// Its objects, wherever it is. Valid as long as `direct`; `options` are for a node on the bus itself.
[[nodiscard]] co::SdoAccess& objects_of(tree::Session& session, operate::Network& network, const NodeArgument& node,
                                        const co::SdoOptions& options, std::optional<co::NodeAccess>& direct);

/// The object of a node of a machine, or a network variable by its name (network_variables.hpp).
[[nodiscard]] Checked<KnownObject> find_object(const design::Machine& machine, const NodeArgument& node,
                                               const std::string& word);
/// The objects of an SDO command.
struct ObjectArguments {
  NodeArgument node;
  std::vector<KnownObject> objects;  ///< at least one, unless there is an error
};
/// "node", "object" (one per line), "sub" (of a single object), "type".
[[nodiscard]] ObjectArguments object_arguments(Arguments& arguments, const design::Machine& machine);

/// The arguments of `sdo write`: a value for each object.
struct WriteArguments {
  ObjectArguments to;
  std::vector<std::vector<std::uint8_t>> values;
};
/// The same, and "value": for several objects one per line.
[[nodiscard]] WriteArguments write_arguments(Arguments& arguments, const design::Machine& machine);

/// "frame": one per line, as candump writes them.
[[nodiscard]] std::vector<can::Frame> frame_arguments(Arguments& arguments);
/// The lines of an argument.
[[nodiscard]] std::vector<std::string> lines_of(const std::string& text);

/// The arguments of an NMT command.
struct NmtArguments {
  std::string bus;
  co::NmtCommand command = co::NmtCommand::start;
  co::NmtTarget target;
  std::string word;
  NodeId requested_of;  ///< the NMT master that is asked; unconfigured: Berth sends the command itself
  std::vector<multilevel::Hop> gateways = {};  ///< to the bus of that master, which is asked through them

  /// 1F82h of that master (CiA 302-2): its sub-index and value.
  [[nodiscard]] std::uint8_t request_sub() const noexcept;
  [[nodiscard]] std::uint8_t request_value() const noexcept;
};
/// "command", "node", which may be "all", and "request".
/// Empty: the word is an NMT command: start, stop, preop, reset-node, reset-comm, or the resulting state
/// ("operational", "stopped", "pre-operational", "reset", "reset-communication"). Else the error, and what to write.
[[nodiscard]] std::string no_nmt_command(const std::string& word);
[[nodiscard]] NmtArguments nmt_arguments(Arguments& arguments, const design::Machine& machine);

}  // namespace berth::command
