#include "berth/manager/node_id_report.hpp"

#include <algorithm>

#include "berth/base/bytes.hpp"

namespace berth::manager {
namespace {

std::uint64_t row(std::uint8_t low, std::uint32_t serial) noexcept { return std::uint64_t{serial} << 32U | low; }

}  // namespace

NodeIdReport::NodeIdReport(od::Values& values, std::function<bool(NodeId)> forget) : forget_(std::move(forget)) {
  values.attach(*this, object);
}

void NodeIdReport::tell(NodeId node, NodeIdTrouble trouble, std::uint32_t serial) noexcept {
  told_[node.value()] = row(static_cast<std::uint8_t>(trouble), serial);
  const unsigned place = node.value() - 1U;
  const std::uint64_t bit = std::uint64_t{1} << place % 64;
  std::uint64_t& mask = told_[troubled + place / 64];
  const bool plain = trouble == NodeIdTrouble::none || trouble == NodeIdTrouble::nobody;
  mask = plain ? mask & ~bit : mask | bit;
}

void NodeIdReport::tell_surplus(std::span<const Identity> devices) noexcept {
  const auto count = static_cast<std::uint8_t>(std::min<std::size_t>(devices.size(), 0xFF));
  told_[surplus] = devices.empty() ? 0 : row(count, devices.front().address.serial);
}

od::AbortCode NodeIdReport::reading(const od::Values&, ObjectRef ref, std::span<const std::uint8_t>& value) noexcept {
  if (ref.sub == 0) return od::AbortCode::none;
  store_le(shown_.data(), told(ref.sub));
  value = shown_;
  return od::AbortCode::none;
}

od::AbortCode NodeIdReport::writing(const od::Values&, ObjectRef ref, std::span<const std::uint8_t> value) noexcept {
  const auto node = NodeId::make(ref.sub);
  if (!node || load_le<std::uint64_t>(value.data()) != 0) return od::AbortCode::invalid_value;
  return forget_(*node) ? od::AbortCode::none : od::AbortCode::device_state;
}

}  // namespace berth::manager
