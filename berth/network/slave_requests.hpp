/// Requests of any SDO client to the configuration manager, by an object with a sub-index for each slave and 80h for
/// all: 1F25h (`ConfigurationRequests`) and 5F0Ah (`ConfigurationUploads`).
#pragma once

#include <algorithm>

#include "berth/network/network_boot.hpp"
#include "berth/od/abort_code.hpp"
#include "berth/od/cia302.hpp"

namespace berth::network {

/// True if, as far as the slave's boot-up shows, a request would disturb nothing else.
[[nodiscard]] inline bool is_settled(const NetworkBoot& network, NodeId node) noexcept {
  const auto* const status = network.find(node);
  return status != nullptr && status->phase != SlavePhase::booting && status->phase != SlavePhase::idle;
}

/// The answer to a client that wrote `value`, which should be `signature`. `begin`: tries to begin one slave's request.
/// 0800 0020: not the signature. 0800 0022: this device is not the master, or the slave's request was not begun; for
/// all: none was begun. 0609 0030: not assigned.
template <class Begin>
od::AbortCode request_of_slaves(const NetworkBoot& network, std::uint8_t sub, std::uint32_t value,
                                std::uint32_t signature, Begin begin) {
  using od::AbortCode;
  const bool all = sub == od::cia302::all_nodes;
  if (!all && (sub < 1 || sub > 127)) return AbortCode::no_sub_index;
  if (value != signature) return AbortCode::not_stored;
  if (network.phase() == NetworkBoot::Phase::off) return AbortCode::device_state;
  const auto& slaves = network.plan().slaves;
  if (all) return std::ranges::count_if(slaves, begin) > 0 ? AbortCode::none : AbortCode::device_state;
  const auto slave = std::ranges::find(slaves, NodeId(sub), &NetworkSlave::node);
  if (slave == slaves.end()) return AbortCode::invalid_value;
  return begin(*slave) ? AbortCode::none : AbortCode::device_state;
}

}  // namespace berth::network
