#include "berth/serve/cia309_permits.hpp"

#include <fmt/format.h>

#include "berth/command/permission.hpp"
#include "berth/serve/cia309_net.hpp"

namespace berth::serve::cia309 {

bool is_for_all_nodes(Verb verb) noexcept {
  using enum Verb;
  return verb == start || verb == stop || verb == preop || verb == reset_node || verb == reset_comm;
}

bool is_lss(Verb verb) noexcept { return verb >= Verb::lss_switch_global && verb <= Verb::lss_allnodes; }

namespace {

/// Changes a device, or sends what devices act on. LSS questions leave everything as it is.
bool changes(Verb verb) noexcept {
  using enum Verb;
  switch (verb) {
    case lss_inquire_address:
    case lss_get_node:
    case lss_identity:
    case lss_identify_non_configured: return false;
    case write:
    case set_tpdo:
    case write_pdo: return true;
    default: return is_for_all_nodes(verb) || is_lss(verb);
  }
}

}  // namespace

command::Request Permits::request_for(const Net& net, std::string verb) const {
  command::Request request;
  request.verb = std::move(verb);
  request.arguments["bus"] = net.network.bus().name;
  return request;
}

bool Permits::may_send(const Net& net, bool commands) const {
  const auto use = commands ? command::Use::command : command::Use::send;
  const auto network = command::network_for(*house_->session, net.network.bus().name, use);
  if (!network) tell(network.error());
  return network.has_value();
}

bool Permits::allowed(const Request& request, const Net& net) const {
  const bool refused = house_->session->careful() && !house_->commands && changes(request.verb);
  if (refused) {
    tell(
        fmt::format("bus {}: a client wanted to command devices; on a real bus it may only read and ask. Nothing was "
                    "sent. Allow it with --commands (berth gateway) or --gateway-commands (berth up)",
                    net.network.bus().name));
  }
  return !refused;
}

bool Permits::undisturbing(const command::Request& wanted) const {
  command::Request request = wanted;
  if (house_->confirmed) request.arguments["yes"] = "1";
  command::Reply reply;
  const bool goes = command::confirmed(*house_->session, request, reply);
  if (!goes) tell(reply.error);
  return goes;
}

void Permits::tell(const std::string& text) const {
  if (house_->tell) house_->tell(text);
}

}  // namespace berth::serve::cia309
