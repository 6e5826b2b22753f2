#include "berth/live/other_clients.hpp"

#include "berth/co/cob_id.hpp"

namespace berth::live {
namespace {

std::size_t node_of(const can::Frame& request) noexcept { return request.key() & 0x7FU; }

}  // namespace

void OtherClients::asks(const can::Frame& request, rt::Time at) noexcept {
  const std::size_t node = node_of(request);
  until_.at(node) = at + pause;
  if (known_[node]) return;
  known_.set(node);
  if (told_) told_(NodeId(static_cast<std::uint8_t>(node)), request);
}

bool OtherClients::owns_channel_of(const can::Frame& frame, rt::Time now) const noexcept {
  if (frame.remote || !co::all_sdo_requests.contains(frame.key())) return false;
  return now < until_.at(node_of(frame));
}

}  // namespace berth::live
