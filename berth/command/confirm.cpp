#include "berth/command/confirm.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <nlohmann/json.hpp>

#include "berth/base/counted.hpp"
#include "berth/command/audit.hpp"
#include "berth/command/objects.hpp"
#include "berth/command/permission.hpp"
#include "berth/command/reply.hpp"
#include "berth/command/run.hpp"

namespace berth::command {
namespace {

bool is_operational(Network& network, NodeId id) {
  const auto slots = network.report();
  const auto slot = std::ranges::find(slots, id, &SlotReport::id);
  if (slot != slots.end() && slot->state == places::SlotState::operational) return true;
  const auto heard = network.services().boots.heard(id);
  const auto fresh = network.services().executor.now() -
                     std::max<rt::Duration>(4 * network.bus().timing.heartbeat_timeout, std::chrono::seconds(10));
  return heard && *heard >= fresh && network.services().boots.state(id) == NmtState::operational;
}

std::vector<NodeId> operational_of(Network& network, co::NmtTarget target) {
  std::vector<NodeId> nodes;
  for (std::uint8_t id = 1; id < 128; ++id) {
    const NodeId node(id);
    if (node != network.bus().master && target.includes(node) && is_operational(network, node)) nodes.push_back(node);
  }
  return nodes;
}

/// Which devices a command disturbs, and how.
struct Disturbed {
  Network* network = nullptr;
  std::vector<NodeId> nodes{};
  std::string how{};
  const tree::Beneath* beneath = nullptr;  ///< the bus of the nodes, if Berth has no port on it
};

// Nodes of this bus, or of the bus beneath that these gateways lead to. On a bus beneath, only slots show which nodes
// are operational: a node without a slot may be operational unnoticed.
Disturbed disturbed_at(Session& session, Network& network, const std::vector<multilevel::Hop>& gateways,
                       co::NmtTarget target, std::string how) {
  if (gateways.empty()) return {&network, operational_of(network, target), std::move(how)};
  Disturbed disturbed{&network, {}, std::move(how)};
  const tree::Way way{network.bus().name, gateways};
  const auto beneath = std::ranges::find(session.tree().buses(), way, &tree::Beneath::way);
  if (beneath == session.tree().buses().end()) {
    disturbed.nodes.push_back(gateways.back().gateway);
    return disturbed;
  }
  disturbed.beneath = beneath->get();
  for (const auto& slot : (*beneath)->report()) {
    if (target.includes(slot.id) && slot.state == places::SlotState::operational) disturbed.nodes.push_back(slot.id);
  }
  return disturbed;
}

Disturbed by_nmt(Session& session, const Request& request) {
  Arguments arguments(request);
  const auto wanted = nmt_arguments(arguments, session.machine());
  const auto network = network_for(session, wanted.bus, Use::look);
  const bool resets =
      wanted.command == co::NmtCommand::reset_node || wanted.command == co::NmtCommand::reset_communication;
  if (!arguments.good() || !network || !resets) return {};
  return disturbed_at(session, **network, wanted.gateways, wanted.target,
                      "boots and leaves operational: its outputs go to their fault values");
}

Disturbed by_sdo(Session& session, const Request& request) {
  Arguments arguments(request);
  const auto wanted = object_arguments(arguments, session.machine());
  const auto network = network_for(session, wanted.node.bus, Use::look);
  constexpr std::uint16_t store_parameters = 0x1010;
  constexpr std::uint16_t restore_defaults = 0x1011;
  const bool stores = std::ranges::any_of(wanted.objects, [](const KnownObject& object) {
    return object.ref.index == store_parameters || object.ref.index == restore_defaults;
  });
  if (!arguments.good() || !network || !stores) return {};
  return disturbed_at(session, **network, wanted.node.gateways, wanted.node.node,
                      "writes its memory while it works; some devices receive nothing while they write");
}

Disturbed by_lss(Session& session, const Request& request) {
  std::string problem;
  const auto wanted = lss_arguments(request, problem);
  const auto network = network_for(session, wanted.bus, Use::look);
  const std::string& service = wanted.service;
  if (!problem.empty() || !network || service == "find" || service.starts_with("identify")) return {};
  // Without an address, the service asks the device that is in configuration state already.
  const bool harmless =
      (service == "global" && wanted.state == lss::State::waiting) || (service == "inquire" && !wanted.device);
  if (harmless) return {};
  const std::string how = "is configured by LSS while it works; some devices stop then";
  if (!wanted.device) return {*network, operational_of(**network, co::NmtTarget::all()), how};
  const auto slots = (*network)->report();
  const auto slot = std::ranges::find(slots, wanted.device, &SlotReport::device);
  if (slot == slots.end()) return {};
  return {*network, operational_of(**network, co::NmtTarget(slot->id)), how};
}

// The effect of a frame that the user writes is unknown.
Disturbed by_frame(Session& session, const Request& request) {
  const auto bus = request.arguments.find("bus");
  const auto network = network_for(session, bus == request.arguments.end() ? "" : bus->second, Use::look);
  if (!network) return {};
  return {*network, operational_of(**network, co::NmtTarget::all()), "may be disturbed by the frame"};
}

Disturbed by_memory(Session& session, const Request& request) {
  Arguments arguments(request);
  const auto node = node_argument(arguments, session.machine());
  const auto network = network_for(session, node.bus, Use::look);
  if (!arguments.good() || !network) return {};
  return disturbed_at(session, **network, node.gateways, node.node,
                      "writes its memory while it works; some devices receive nothing while they write");
}

Disturbed by_program(Session& session, const Request& request) {
  if (request.verb == "program status") return {};
  auto disturbed = by_memory(session, request);
  disturbed.how = "stops its program, and may restart: its outputs go to their fault values";
  return disturbed;
}

// A doctor that asks disturbs devices; one that only listens does not.
Disturbed by_doctor(Session& session, const Request& request) {
  Arguments arguments(request);
  const std::string bus = arguments.text("bus");
  if (!arguments.good() || !changes(request)) return {};
  if (arguments.has("conformance")) {
    const auto node = find_node(session.machine(), bus, arguments.text("conformance"));
    const auto network = node ? network_for(session, node->bus, Use::look) : tl::unexpected(std::string());
    if (!node || !network) return {};
    return disturbed_at(session, **network, node->gateways, node->node,
                        "gets hundreds of SDO requests, some of which it must refuse");
  }
  const auto networks = networks_for(session, bus, Use::look);
  if (!networks) return {};
  for (Network* const network : *networks) {
    const auto nodes = operational_of(*network, co::NmtTarget::all());
    if (!nodes.empty()) return {network, nodes, "is selected by LSS while it works; some devices stop then"};
  }
  return {};
}

Disturbed by_boot(Session& session, const Request& request) {
  const auto bus = request.arguments.find("bus");
  const auto networks = networks_for(session, bus == request.arguments.end() ? "" : bus->second, Use::look);
  if (!networks) return {};
  for (Network* const network : *networks) {
    const auto nodes = operational_of(*network, co::NmtTarget::all());
    if (!nodes.empty()) return {network, nodes, "resets its communication and leaves operational"};
  }
  return {};
}

Disturbed disturbed_by(Session& session, const Request& request) {
  if (request.verb == "nmt") return by_nmt(session, request);
  if (request.verb == "boot") return by_boot(session, request);
  if (request.verb == "sdo write") return by_sdo(session, request);
  if (request.verb == "store" || request.verb == "restore") return by_memory(session, request);
  if (request.verb.starts_with("program ")) return by_program(session, request);
  if (request.verb == "backup restore") {
    auto disturbed = by_memory(session, request);
    disturbed.how = "gets other parameters while it works, and stores them";
    return disturbed;
  }
  if (request.verb == "doctor") return by_doctor(session, request);
  if (request.verb == "send") return by_frame(session, request);
  if (request.verb.starts_with("lss ") && request.verb != "lss move-bit-rate") return by_lss(session, request);
  return {};
}

void unconfirmed(Reply& reply, Json json, const std::string& text) {
  json["result"] = "unconfirmed";
  json["what"] = text;
  give(reply, json, {});
  reply.status = 1;
  reply.error = error_line(text);
}

std::string whom(const std::vector<SlotReport>& slots, const std::vector<NodeId>& nodes) {
  std::string text;
  for (const auto id : nodes) {
    const auto slot = std::ranges::find(slots, id, &SlotReport::id);
    const std::string name = slot == slots.end() ? "" : fmt::format(" ({})", slot->name);
    text += fmt::format("{}{}{}", text.empty() ? "" : ", ", id.value(), name);
  }
  return text;
}

// Every device of these buses loses its node-ID, and all bindings are lost: so a simulated bus needs a confirmation,
// too.
bool confirmed_from_scratch(Session& session, const Request& request, Reply& reply) {
  if (request.arguments.contains("yes")) return true;
  Arguments arguments(request);
  const auto networks = networks_for(session, arguments.text("bus"), Use::look);
  if (!arguments.good() || !networks) return true;  // the command itself says what is wrong
  std::size_t bound = 0;
  for (const Network* const network : *networks) {
    const auto slots = network->report();
    bound += static_cast<std::size_t>(std::ranges::count_if(slots, [](const auto& s) { return s.device.has_value(); }));
  }
  unconfirmed(reply, {{"bound", bound}},
              fmt::format("all devices stop, and every node-ID that LSS can change is taken from them; {} bound now; "
                          "nothing was sent; confirm it with --yes",
                          counted(bound, "slot")));
  return false;
}

}  // namespace

bool confirmed(Session& session, const Request& request, Reply& reply) {
  if (request.verb == "bind" && request.arguments.contains("from-scratch")) {
    return confirmed_from_scratch(session, request, reply);
  }
  const bool has_own = request.verb == "bind" || request.verb == "lss move-bit-rate";
  if (has_own) return true;
  const bool yes = request.arguments.contains("yes");
  if (yes || !session.careful()) return true;
  const auto disturbed = disturbed_by(session, request);
  if (disturbed.nodes.empty()) return true;
  const auto* const beneath = disturbed.beneath;
  const std::string nodes = whom(beneath != nullptr ? beneath->report() : disturbed.network->report(), disturbed.nodes);
  const std::string& bus = beneath != nullptr ? beneath->bus().name : disturbed.network->bus().name;
  const std::string text = fmt::format("bus {}: node {} is operational and {}; nothing was sent; confirm it with --yes",
                                       bus, nodes, disturbed.how);
  Json json;
  json["bus"] = bus;
  json["operational"] = Json::array();
  for (const auto id : disturbed.nodes) json["operational"].push_back(id.value());
  unconfirmed(reply, std::move(json), text);
  return false;
}

}  // namespace berth::command
