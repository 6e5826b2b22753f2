#include "berth/serve/gateway_309_permits.hpp"

#include <fmt/format.h>

#include "berth/command/permission.hpp"
#include "berth/serve/gateway_309_net.hpp"

namespace berth::serve {

bool for_all_nodes_309(Verb309 verb) noexcept {
  using enum Verb309;
  return verb == start || verb == stop || verb == preop || verb == reset_node || verb == reset_comm;
}

bool is_lss_309(Verb309 verb) noexcept { return verb >= Verb309::lss_switch_global && verb <= Verb309::lss_allnodes; }

namespace {

/// Changes a device, or sends what devices act on. LSS questions leave everything as it is.
bool changes(Verb309 verb) noexcept {
  using enum Verb309;
  switch (verb) {
    case lss_inquire_address:
    case lss_get_node:
    case lss_identity:
    case lss_identify_non_configured: return false;
    case write:
    case set_tpdo:
    case write_pdo: return true;
    default: return for_all_nodes_309(verb) || is_lss_309(verb);
  }
}

}  // namespace

command::Request Permits309::request_for(const Net309& net, std::string verb) const {
  command::Request request;
  request.verb = std::move(verb);
  request.arguments["bus"] = net.network.bus().name;
  return request;
}

bool Permits309::may_send(const Net309& net, bool commands) const {
  const auto use = commands ? command::Use::command : command::Use::send;
  const auto network = command::network_for(*house_->session, net.network.bus().name, use);
  if (!network) tell(network.error());
  return network.has_value();
}

bool Permits309::allowed(const Request309& request, const Net309& net) const {
  const bool refused = house_->session->careful() && !house_->commands && changes(request.verb);
  if (refused) {
    tell(
        fmt::format("bus {}: a client wanted to command devices; on a real bus it may only read and ask. Nothing was "
                    "sent. Allow it with --commands (berth gateway) or --gateway-commands (berth up)",
                    net.network.bus().name));
  }
  return !refused;
}

bool Permits309::undisturbing(const command::Request& wanted) const {
  command::Request request = wanted;
  if (house_->confirmed) request.arguments["yes"] = "1";
  command::Reply reply;
  const bool goes = command::confirmed(*house_->session, request, reply);
  if (!goes) tell(reply.error);
  return goes;
}

void Permits309::tell(const std::string& text) const {
  if (house_->tell) house_->tell(text);
}

}  // namespace berth::serve
