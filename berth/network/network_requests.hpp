/// Request NMT (1F82h) and request guarding (1F83h) of CiA 302-2: requests of any node to the NMT master, as values and
/// abort codes of the objects. Sub-index 1 to 127 is a node-ID, 128 (80h) all nodes.
///
///     NetworkRequests requests(network);
///     const od::AbortCode code = requests.nmt(5, 0x06);   // reset node 5
///
/// Refused with: 0609 0011 another sub-index; 0800 0022 this device is not the active NMT master, or the slave has no
/// error control to start; 0609 0030 an invalid value, or a node that is not assigned (1F81h).
#pragma once

#include <cstdint>
#include <optional>

#include "berth/network/network_boot.hpp"
#include "berth/od/abort_code.hpp"
#include "berth/od/cia302.hpp"

namespace berth::network {

/// The meaning of a value written to 1F82h.
struct RequestedNmt {
  co::NmtCommand command;
  bool others = false;  ///< 84h to 87h and 8Fh: all nodes except the master and the requester
};
[[nodiscard]] std::optional<RequestedNmt> requested_nmt(std::uint8_t value) noexcept;
/// The value for a command in 1F82h; `NetworkRequests::all_nodes` is the sub-index for all.
[[nodiscard]] std::uint8_t request_value(co::NmtCommand command) noexcept;

class NetworkRequests {
 public:
  static constexpr std::uint8_t all_nodes = od::cia302::all_nodes;

  /// `network` must stay.
  explicit NetworkRequests(NetworkBoot& network) noexcept : network_(&network) {}

  /// 1F82h written: 04h stop, 05h start, 06h reset node, 07h reset communication, 7Fh enter pre-operational. 84h, 85h,
  /// 86h, 87h and 8Fh are the same for all nodes except the master and the requester, and only for `all_nodes`. With a
  /// `requester`, each other assigned slave then gets the command; without one (an SDO server does not know its
  /// client), one command goes to all nodes. 04h to 7Fh to all also apply to the master.
  od::AbortCode nmt(std::uint8_t sub, std::uint8_t value, NodeId requester = {});
  /// 1F82h read: 04h, 05h, 7Fh; 01h an assigned slave that is missing; 00h unknown, or not assigned. 0601 0001 for
  /// `all_nodes`.
  [[nodiscard]] od::Answer<std::uint8_t> state(std::uint8_t sub) const noexcept;
  /// 1F83h written: 1 starts the error control of a slave, 0 ends it. For all: for those that have one.
  od::AbortCode guarding(std::uint8_t sub, std::uint8_t value);
  /// 1F83h read: 1 while it is supervised. 0601 0001 for `all_nodes`.
  [[nodiscard]] od::Answer<std::uint8_t> guarding(std::uint8_t sub) const noexcept;

 private:
  NetworkBoot* network_;
};

}  // namespace berth::network
