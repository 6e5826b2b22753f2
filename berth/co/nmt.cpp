#include "berth/co/nmt.hpp"

#include "berth/co/cob_id.hpp"

namespace berth::co {

const char* name(NmtCommand command) noexcept {
  switch (command) {
    case NmtCommand::start: return "start";
    case NmtCommand::stop: return "stop";
    case NmtCommand::enter_pre_operational: return "enter pre-operational";
    case NmtCommand::reset_node: return "reset node";
    case NmtCommand::reset_communication: return "reset communication";
  }
  return "unknown";
}

std::optional<NmtCommand> nmt_command(std::uint8_t specifier) noexcept {
  switch (specifier) {
    case 0x01:
    case 0x02:
    case 0x80:
    case 0x81:
    case 0x82: return static_cast<NmtCommand>(specifier);
    default: return std::nullopt;
  }
}

can::Frame to_frame(const NmtRequest& request) noexcept {
  return can::Frame::base(nmt_command_id, {static_cast<std::uint8_t>(request.command), request.target.node});
}

std::optional<NmtRequest> parse_nmt(const can::Frame& frame) noexcept {
  if (frame.key() != nmt_command_id || frame.remote || frame.fd || frame.size != 2 || frame.data[1] > 127)
    return std::nullopt;
  const auto command = nmt_command(frame.data[0]);
  if (!command) return std::nullopt;
  return NmtRequest{*command, frame.data[1] == 0 ? NmtTarget::all() : NmtTarget(NodeId(frame.data[1]))};
}

}  // namespace berth::co
