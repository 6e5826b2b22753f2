#include "berth/research/and_slave.hpp"

#include <utility>

namespace berth::research {

void AndSlave::power_on() noexcept {
  state_ = nodeid::Identification::unknown;
  last_ = false;
}

std::optional<can::Frame> AndSlave::handle(const can::Frame& frame) noexcept {
  const auto request = decode_and_request(frame);
  if (!request) return std::nullopt;
  using Kind = AndRequest::Kind;
  if (request->kind == Kind::inquire) {
    if (!last_ || state_ != nodeid::Identification::identified) return std::nullopt;
    return and_address(lss_address_, request->phase);
  }
  last_ = false;  // an inquiry follows the DIS
  switch (request->kind) {
    case Kind::switch_global: state_ = request->target; return std::nullopt;
    case Kind::switch_selective:
      if (request->address == address_) state_ = request->target;
      return std::nullopt;
    case Kind::identify:
      if (state_ == nodeid::Identification::identified || address_.prefix(request->phase) != request->address) break;
      return and_ius(address_.nibble(request->phase));
    case Kind::direct:
      if (state_ == nodeid::Identification::identified || request->address != address_) break;
      state_ = nodeid::Identification::identified;
      last_ = true;
      return and_dis(address_.nibble(11));
    case Kind::inquire: break;
  }
  return std::nullopt;
}

}  // namespace berth::research
