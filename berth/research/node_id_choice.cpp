#include "berth/research/node_id_choice.hpp"

#include "berth/research/negotiation_frames.hpp"

namespace berth::research {

NodeId NodeIdChoice::preferred() const noexcept {
  if (last_.configured()) return last_;
  if (options_->configured.configured()) return options_->configured;
  std::uint32_t hash = 2166136261U;  // FNV-1a over the bytes in sending order
  for (unsigned i = 0; i < identity_bytes; ++i) hash = (hash ^ identity_byte(options_->address, i)) * 16777619U;
  return NodeId(static_cast<std::uint8_t>(1 + hash % 127));
}

NodeId NodeIdChoice::choose(rt::Time now) const noexcept {
  const unsigned first = preferred().value();
  for (unsigned i = 0; i < 127; ++i) {
    const NodeId id(static_cast<std::uint8_t>(1 + (first - 1 + i) % 127));
    const bool avoided = id == avoid_ && now < avoided_until_;
    if (!used_.test(id.value()) && !avoided) return id;
  }
  return {};
}

}  // namespace berth::research
