// A node-ID that is an object: how devices without LSS are often told theirs (paper 4, S4.2). Written, kept in
// non-volatile memory (with a signature in another object where the maker wants one) and in use after a reset.
#include <algorithm>

#include "berth/base/bytes.hpp"
#include "berth/device/device.hpp"

namespace berth::device {

od::AbortCode Device::writing_node_id(ObjectRef ref, std::span<const std::uint8_t> value) noexcept {
  const auto& signature = options_.node_id_signature;
  const bool is_id = options_.node_id_object == ref;
  const bool signs = signature && signature->object == ref;
  if ((!is_id && !signs) || value.empty()) return od::AbortCode::none;
  if (storing()) return od::AbortCode::device_state;
  if (signs) {
    std::uint64_t given = 0;
    for (std::size_t i = 0; i < std::min<std::size_t>(value.size(), 8); ++i) {
      given |= std::uint64_t{value[i]} << (8 * i);
    }
    if (given != signature->value) return od::AbortCode::not_stored;
    const auto id = NodeId::make(values_.get_or<std::uint8_t>(*options_.node_id_object, NodeId::unconfigured_value));
    return id && id->configured() ? keep_node_id(ref, *id) : od::AbortCode::not_stored;
  }
  const auto id = NodeId::make(value[0]);
  const bool rest = std::ranges::any_of(value.subspan(1), [](auto byte) { return byte != 0; });
  if (!id || !id->configured() || rest) return od::AbortCode::invalid_value;
  return signature ? od::AbortCode::none : keep_node_id(ref, *id);
}

// Answered when it is in memory: what uses the node-ID from the next reset on has it for good.
od::AbortCode Device::keep_node_id(ObjectRef ref, NodeId id) noexcept {
  lss::Settings settings = lss_->pending();
  settings.node_id = id;
  if (store(settings)) return od::AbortCode::hardware;  // answered at once: it was refused
  lss_->set_pending(id);
  storing_ = ref;
  keeps_node_id_ = true;
  return od::AbortCode::pending;
}

void Device::node_id_kept(bool ok) noexcept {
  keeps_node_id_ = false;
  if (ok) values_.set(*options_.node_id_object, lss_->pending().node_id.value());
  sdo_.complete(storing_, ok ? od::AbortCode::none : od::AbortCode::hardware);
}

}  // namespace berth::device
