#include "berth/serve/cia309_permits.hpp"

#include <fmt/format.h>

#include "berth/command/permission.hpp"
#include "berth/command/rights.hpp"
#include "berth/serve/cia309_net.hpp"

namespace berth::serve::cia309 {

bool is_for_all_nodes(Verb verb) noexcept {
  using enum Verb;
  return verb == start || verb == stop || verb == preop || verb == reset_node || verb == reset_comm;
}

bool is_lss(Verb verb) noexcept { return verb >= Verb::lss_switch_global && verb <= Verb::lss_allnodes; }

std::string_view verb_of(Verb verb) noexcept {
  using enum Verb;
  switch (verb) {
    case read: return "sdo read";
    case write: return "sdo write";
    case set_tpdo:
    case write_pdo: return "send";
    case lss_inquire_address:
    case lss_get_node: return "lss inquire";
    case lss_identity: return "lss identify";
    case lss_identify_non_configured: return "lss identify-unconfigured";
    case lss_switch_global: return "lss global";
    case lss_set_node:
    case lss_allnodes: return "lss set-node-id";
    case lss_conf_bitrate: return "lss bit-timing";
    case lss_activate_bitrate: return "lss activate";
    case lss_store: return "lss store";
    // A search leaves the device found in LSS configuration.
    case lss_switch_selective:
    case lss_fastscan:
    case lss_slowscan: return "lss select";
    default: return is_for_all_nodes(verb) ? "nmt" : "";
  }
}

bool Permits::may_send(const Net& net, bool commands) const {
  const auto use = commands ? command::Use::command : command::Use::send;
  const auto network = command::network_for(*house_->session, net.network.bus().name, use);
  if (!network) tell(network.error());
  return network.has_value();
}

bool Permits::allowed(const Request& request, const Net& net) const {
  const bool may_change = house_->commands || !house_->session->careful();
  const std::string verb(verb_of(request.verb));
  const auto refused = command::why_refused(command::Face::gateway, {verb, {}}, {.changes = may_change});
  if (!refused.empty())
    tell(fmt::format("bus {}: a client asked for it; nothing was sent: {}", net.network.bus().name, refused));
  return refused.empty();
}

void Permits::tell(const std::string& text) const {
  if (house_->tell) house_->tell(text);
}

}  // namespace berth::serve::cia309
