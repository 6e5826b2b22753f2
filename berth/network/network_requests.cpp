#include "berth/network/network_requests.hpp"

#include <algorithm>
#include <array>
#include <optional>

namespace berth::network {
namespace {

using co::NmtCommand;
using co::NmtTarget;
using od::AbortCode;

constexpr std::uint8_t without_master = 0x80;  // bit 7 of a request: not to the master

struct RequestValue {
  std::uint8_t value;
  NmtCommand command;
};
constexpr std::array request_values{RequestValue{0x04, NmtCommand::stop}, RequestValue{0x05, NmtCommand::start},
                                    RequestValue{0x06, NmtCommand::reset_node},
                                    RequestValue{0x07, NmtCommand::reset_communication},
                                    RequestValue{0x7F, NmtCommand::enter_pre_operational}};

std::optional<NmtCommand> requested(std::uint8_t value) noexcept {
  const auto* const it = std::ranges::find(request_values, value, &RequestValue::value);
  return it == request_values.end() ? std::nullopt : std::optional(it->command);
}

// 84h to 87h, and 8Fh for pre-operational: 7Fh with bit 7 set would be FFh, which is not a request.
std::optional<NmtCommand> requested_of_others(std::uint8_t value) noexcept {
  if (value == 0x8F) return NmtCommand::enter_pre_operational;
  const bool in_range = value >= 0x84 && value <= 0x87;
  return in_range ? requested(static_cast<std::uint8_t>(value & ~without_master)) : std::nullopt;
}

bool is_node(std::uint8_t sub) noexcept { return sub >= 1 && sub <= 127; }

}  // namespace

std::optional<RequestedNmt> requested_nmt(std::uint8_t value) noexcept {
  const auto others = requested_of_others(value);
  const auto command = others ? others : requested(value);
  return command ? std::optional(RequestedNmt{*command, others.has_value()}) : std::nullopt;
}

std::uint8_t request_value(NmtCommand command) noexcept {
  return std::ranges::find(request_values, command, &RequestValue::command)->value;
}

AbortCode NetworkRequests::nmt(std::uint8_t sub, std::uint8_t value, NodeId requester) {
  if (!is_node(sub) && sub != all_nodes) return AbortCode::no_sub_index;
  if (network_->phase() == NetworkBoot::Phase::off) return AbortCode::device_state;
  const auto wanted = requested_nmt(value);
  if (!wanted || (wanted->others && sub != all_nodes)) return AbortCode::invalid_value;
  const NmtCommand command = wanted->command;
  const NodeId own = network_->plan().own;
  if (sub == all_nodes && (!wanted->others || !requester.configured() || requester == own)) {
    network_->command(command, NmtTarget::all(), !wanted->others);
  } else if (sub == all_nodes) {
    for (const auto& slave : network_->plan().slaves) {
      if (slave.node != requester) network_->command(command, slave.node);
    }
  } else if (NodeId(sub) == own || network_->find(NodeId(sub)) != nullptr) {
    network_->command(command, NodeId(sub));
  } else {
    return AbortCode::invalid_value;
  }
  return AbortCode::none;
}

od::Answer<std::uint8_t> NetworkRequests::state(std::uint8_t sub) const noexcept {
  constexpr std::uint8_t unknown = 0x00;
  constexpr std::uint8_t missing = 0x01;
  if (sub == all_nodes) return od::refuse(AbortCode::write_only);
  if (!is_node(sub)) return od::refuse(AbortCode::no_sub_index);
  if (network_->phase() == NetworkBoot::Phase::off) return unknown;
  if (NodeId(sub) == network_->plan().own) return static_cast<std::uint8_t>(network_->own_state());
  const auto* const slave = network_->find(NodeId(sub));
  if (slave == nullptr) return unknown;
  if (slave->state) return static_cast<std::uint8_t>(*slave->state);
  const bool silent = slave->result.status == manager::BootStatus::b && slave->phase == SlavePhase::failed;
  return silent || slave->phase == SlavePhase::awaited || slave->phase == SlavePhase::booting ? missing : unknown;
}

AbortCode NetworkRequests::guarding(std::uint8_t sub, std::uint8_t value) {
  if (!is_node(sub) && sub != all_nodes) return AbortCode::no_sub_index;
  if (network_->phase() == NetworkBoot::Phase::off) return AbortCode::device_state;
  if (value > 1) return AbortCode::invalid_value;
  if (sub == all_nodes) {
    for (const auto& slave : network_->plan().slaves) static_cast<void>(network_->supervise(slave.node, value == 1));
    return AbortCode::none;
  }
  const auto done = network_->supervise(NodeId(sub), value == 1);
  if (done) return AbortCode::none;
  return done.error().code == Errc::not_found ? AbortCode::invalid_value : AbortCode::device_state;
}

od::Answer<std::uint8_t> NetworkRequests::guarding(std::uint8_t sub) const noexcept {
  if (sub == all_nodes) return od::refuse(AbortCode::write_only);
  if (!is_node(sub)) return od::refuse(AbortCode::no_sub_index);
  const auto* const slave = network_->find(NodeId(sub));
  return static_cast<std::uint8_t>(slave != nullptr && slave->supervised ? 1 : 0);
}

}  // namespace berth::network
