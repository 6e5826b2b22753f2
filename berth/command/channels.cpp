// sdo connect, sdo release, sdo channels: the SDO manager of a bus (CiA 302-5; docs/sdo-manager.md). It is Berth's own
// or another device's; Berth writes and reads the latter's 1F00h, 1F01h and 1F10h.
#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <nlohmann/json.hpp>

#include "berth/base/bytes.hpp"
#include "berth/command/can_id_text.hpp"
#include "berth/command/objects.hpp"
#include "berth/command/permission.hpp"
#include "berth/command/reply.hpp"
#include "berth/command/run.hpp"
#include "berth/od/cia302.hpp"
#include "berth/text/quantity.hpp"

namespace berth::command {
namespace {

using manager::SdoConnection;
using manager::SdoManager;

using od::cia302::connection_state;
using od::cia302::release_sdo;
using od::cia302::request_sdo;
constexpr std::uint32_t longest_lease_s = 0xFFFF;

/// The request of a command.
struct ChannelWish {
  Network* network = nullptr;
  NodeId client;
  NodeId server;
  std::uint32_t lease_s = 0;  ///< 0: the manager's default
  NodeId manager;             ///< another manager's node-ID; unconfigured: Berth's own manager
};

Checked<NodeId> party(const design::Machine& machine, const std::string& word, std::string& bus) {
  const auto node = find_node(machine, bus, word);
  if (!node) return tl::unexpected(node.error());
  if (!node->gateways.empty()) return tl::unexpected(std::string("a channel is between two nodes of one bus"));
  if (!node->bus.empty()) bus = node->bus;
  return node->node;
}

Checked<ChannelWish> read_channel_wish(Session& session, const Request& request) {
  Arguments arguments(request);
  ChannelWish wish;
  std::string bus = arguments.text("bus");
  const bool of_two = request.verb != "sdo channels";
  const std::string client = of_two ? arguments.required("client") : std::string();
  const std::string server = of_two ? arguments.required("server") : std::string();
  if (arguments.has("lease")) wish.lease_s = arguments.number("lease", 1, longest_lease_s);
  if (arguments.has("request")) {
    wish.manager = NodeId(static_cast<std::uint8_t>(arguments.number("request", 1, 127)));
  }
  if (!arguments.good()) return tl::unexpected(arguments.problem());
  if (of_two) {
    const auto one = party(session.machine(), client, bus);
    if (!one) return tl::unexpected(one.error());
    const auto other = party(session.machine(), server, bus);
    if (!other) return tl::unexpected(other.error());
    if (*one == *other) return tl::unexpected(std::string("client and server are one node"));
    wish.client = *one;
    wish.server = *other;
  }
  const auto network = network_for(session, bus, Use::send);
  if (!network) return tl::unexpected(network.error());
  wish.network = *network;
  return wish;
}

std::string index_text(std::uint16_t index) { return fmt::format("{:04X}h", index); }

Json channel_head(const ChannelWish& wish) {
  Json json;
  json["bus"] = wish.network->bus().name;
  json["client"] = wish.client.value();
  json["server"] = wish.server.value();
  return json;
}

Json channel_json(const SdoConnection& c, double left_s) {
  return {{"client", c.client.value()},
          {"server", c.server.value()},
          {"client_object", index_text(c.client_object)},
          {"server_object", index_text(c.server_object)},
          {"request", can_id_text(c.ids.request)},
          {"response", can_id_text(c.ids.response)},
          {"lease_s", left_s}};
}

std::string channel_line(const SdoConnection& c, const std::string& until) {
  return fmt::format("{:>3} -> {:>3}  {} of the client, {} of the server, {:03X}h and {:03X}h, {}", c.client.value(),
                     c.server.value(), index_text(c.client_object), index_text(c.server_object), c.ids.request,
                     c.ids.response, until);
}

std::string channel_line(const SdoConnection& c, double left_s) {
  return channel_line(c, fmt::format("{:.0f} s left", left_s));
}

// The channels of the machine file: no SDO manager connects or releases them.
Json planned_channels(const design::Bus& bus, std::vector<std::string>& lines) {
  Json all = Json::array();
  for (const auto& each : bus.channels) {
    const SdoConnection planned{
        each.client, each.server, each.client_object, each.server_object, {each.request, each.request + 1}};
    Json json = channel_json(planned, 0);
    json.erase("lease_s");
    all.push_back(std::move(json));
    lines.push_back(channel_line(planned, "planned"));
  }
  return all;
}

double lease_left(Network& network, const SdoConnection& c) {
  return std::chrono::duration<double>(c.until - network.services().executor.now()).count();
}

const char* const no_manager =
    "Berth is not the SDO manager of this bus: it only observes it, or another master is active";
const char* const nothing_watches =
    "nothing releases it when its lease ends: keep `berth up` running, or use `berth sdo release`";

// ---- another manager ------------------------------------------------------------------------------------------------

using ChannelState = manager::SdoRequests::State;

rt::Task<void> ask_another(Session& session, const ChannelWish& wish, bool connects, Reply& reply) {
  const NodeArgument at{wish.network->bus().name, wish.manager, nullptr, {}};
  std::optional<co::NodeAccess> direct;
  const co::SdoOptions how = wish.network->services().sdo.options();
  co::SdoAccess& objects = objects_of(session, *wish.network, at, how, direct);
  constexpr unsigned server_at = 8;
  constexpr unsigned lease_at = 16;
  const std::uint32_t word =
      wish.client.value() | std::uint32_t{wish.server.value()} << server_at | wish.lease_s << lease_at;
  const std::uint16_t object = connects ? request_sdo : release_sdo;
  const std::string where = fmt::format("the SDO manager at node {} ({})", at.text(), index_text(object));
  const auto asked = co_await objects.write_u32(object, 0, word);
  if (!asked)
    co_return fail_with(reply, asked.error(), where, "a node that is not an SDO manager, or not active, refuses");
  const rt::Time limit = wish.network->services().executor.now() + 10 * wish.network->bus().timing.sdo_timeout;
  std::uint32_t state = 0;
  do {
    co_await rt::sleep_for(std::chrono::milliseconds(20));
    const std::uint8_t sub = wish.client.value();
    const auto now = co_await objects.read_u32(connection_state, sub);
    if (!now) co_return fail_with(reply, now.error(), where);
    state = *now;
  } while (static_cast<ChannelState>(state & 0xFFU) == ChannelState::under_way &&
           wish.network->services().executor.now() < limit);
  const auto ended = static_cast<ChannelState>(state & 0xFFU);
  const bool good = ended == (connects ? ChannelState::connected : ChannelState::released);
  if (!good) {
    co_return refuse(reply, 1, where + (ended == ChannelState::under_way ? ": it has not ended yet" : ": it failed"),
                     "one of the two nodes is absent, or has no free channel object");
  }
  Json json = channel_head(wish);
  json["manager"] = wish.manager.value();
  const auto of_client = static_cast<std::uint16_t>(state >> lease_at);
  if (connects) json["client_object"] = index_text(of_client);
  give(reply, json,
       {connects ? fmt::format("{} -> {}: its CAN-IDs are in {} of the client", wish.client.value(),
                               wish.server.value(), index_text(of_client))
                 : fmt::format("{} -> {}: released", wish.client.value(), wish.server.value())});
}

}  // namespace

rt::Task<void> sdo_connect(Session& session, const Request& request, Reply& reply) {
  const auto wish = read_channel_wish(session, request);
  if (!wish) co_return refuse(reply, 2, wish.error());
  const bool connects = true;
  if (wish->manager.configured()) co_return co_await ask_another(session, *wish, connects, reply);
  SdoManager* const manager = wish->network->services().channels->manager_for_request();
  if (manager == nullptr) co_return refuse(reply, 1, no_manager, "name another manager by --request NODE-ID");
  const std::chrono::seconds lease(wish->lease_s);
  const auto made = co_await manager->connect(wish->client, wish->server, lease);
  if (!made) {
    co_return fail_with(reply, made.error(),
                        fmt::format("a channel of node {} to node {}", wish->client.value(), wish->server.value()),
                        "the client needs a free object 1280h to 12FFh, the server one of 1201h to 127Fh");
  }
  const double left = lease_left(*wish->network, *made);
  Json json = channel_json(*made, left);
  json["bus"] = wish->network->bus().name;
  std::vector<std::string> lines{channel_line(*made, left)};
  if (!session.started()) lines.emplace_back(nothing_watches);
  give(reply, json, std::move(lines));
}

rt::Task<void> sdo_release(Session& session, const Request& request, Reply& reply) {
  const auto wish = read_channel_wish(session, request);
  if (!wish) co_return refuse(reply, 2, wish.error());
  const bool connects = false;
  if (wish->manager.configured()) co_return co_await ask_another(session, *wish, connects, reply);
  SdoManager* const manager = wish->network->services().channels->manager_for_request();
  if (manager == nullptr) co_return refuse(reply, 1, no_manager, "name another manager by --request NODE-ID");
  const auto& planned = wish->network->bus().channels;
  const bool stands =
      std::ranges::any_of(planned, [&](const auto& c) { return c.client == wish->client && c.server == wish->server; });
  if (stands) {
    co_return refuse(reply, 1,
                     fmt::format("{} -> {} is in the machine file", wish->client.value(), wish->server.value()),
                     "remove its [[channel]] there; the devices keep what they saved until they are configured anew");
  }
  const auto done = co_await manager->disconnect(wish->client, wish->server);
  if (!done) {
    co_return fail_with(reply, done.error(),
                        fmt::format("the channel of node {} to node {}", wish->client.value(), wish->server.value()),
                        "`berth sdo channels` lists them");
  }
  give(reply, channel_head(*wish), {fmt::format("{} -> {}: released", wish->client.value(), wish->server.value())});
}

rt::Task<void> sdo_channels(Session& session, const Request& request, Reply& reply) {
  const auto wish = read_channel_wish(session, request);
  if (!wish) co_return refuse(reply, 2, wish.error());
  SdoManager* const manager = wish->network->services().channels->manager_for_request();
  if (manager == nullptr) co_return refuse(reply, 1, no_manager);
  co_await manager->recover();
  Json json;
  json["bus"] = wish->network->bus().name;
  json["channels"] = Json::array();
  std::vector<std::string> lines;
  json["planned"] = planned_channels(wish->network->bus(), lines);
  for (const auto& each : manager->connections().all()) {
    const double left = lease_left(*wish->network, each);
    json["channels"].push_back(channel_json(each, left));
    lines.push_back(channel_line(each, left));
  }
  json["unread"] = Json::array();
  for (std::uint8_t id = 1; id < 128; ++id) {
    if (!manager->unread(NodeId(id))) continue;
    json["unread"].push_back(id);
    lines.push_back(fmt::format("node {} did not answer: its channels are not known", id));
  }
  if (lines.empty()) lines.emplace_back("no channels");
  give(reply, json, std::move(lines));
}

}  // namespace berth::command
