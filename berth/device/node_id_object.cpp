#include "berth/device/node_id_object.hpp"

#include <algorithm>

namespace berth::device {

NodeIdObject::NodeIdObject(od::Values& values, co::SdoServers& sdo, const Options& options, LssSlave& lss,
                           const StoredObjects& stored)
    : values_(&values), sdo_(&sdo), options_(&options), lss_(&lss), stored_(&stored) {
  const auto id = options.node_id_object->object.index;
  values.attach(*this, id);
  const auto& signature = options.node_id_object->signature;
  if (signature && signature->object.index != id) values.attach(*this, signature->object.index);
}

void NodeIdObject::show() noexcept { values_->set(options_->node_id_object->object, lss_->active().node_id.value()); }

od::AbortCode NodeIdObject::writing(const od::Values&, ObjectRef ref, std::span<const std::uint8_t> value) noexcept {
  const auto& signature = options_->node_id_object->signature;
  const bool is_id = options_->node_id_object->object == ref;
  const bool signs = signature && signature->object == ref;
  if ((!is_id && !signs) || value.empty()) return od::AbortCode::none;
  if (stored_->storing()) return od::AbortCode::device_state;
  if (signs) return sign(ref, value);
  const auto id = NodeId::make(value[0]);
  const bool rest = std::ranges::any_of(value.subspan(1), [](auto byte) { return byte != 0; });
  if (!id || !id->configured() || rest) return od::AbortCode::invalid_value;
  return signature ? od::AbortCode::none : keep(ref, *id);
}

od::AbortCode NodeIdObject::sign(ObjectRef ref, std::span<const std::uint8_t> value) noexcept {
  std::uint64_t given = 0;
  for (std::size_t i = 0; i < std::min<std::size_t>(value.size(), 8); ++i) given |= std::uint64_t{value[i]} << (8 * i);
  if (given != options_->node_id_object->signature->value) return od::AbortCode::not_stored;
  const auto id =
      NodeId::make(values_->get_or<std::uint8_t>(options_->node_id_object->object, NodeId::unconfigured_value));
  return id && id->configured() ? keep(ref, *id) : od::AbortCode::not_stored;
}

// The answer comes when the node-ID is in memory: a node-ID that is used after the next reset is then kept for good.
od::AbortCode NodeIdObject::keep(ObjectRef ref, NodeId id) noexcept {
  if (!lss_->keep(id, static_cast<NvMemory::Done&>(*this))) return od::AbortCode::hardware;
  awaited_ = ref;
  return od::AbortCode::pending;
}

void NodeIdObject::written(bool ok) noexcept {
  if (ok) values_->set(options_->node_id_object->object, lss_->pending().node_id.value());
  sdo_->complete(awaited_, ok ? od::AbortCode::none : od::AbortCode::hardware);
}

}  // namespace berth::device
