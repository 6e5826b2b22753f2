// How a device and the negotiation of its node-ID (paper 2), or its claim, act on each other.
#include "berth/device/device.hpp"

namespace berth::device {

void Device::make_negotiation(NvMemory* memory) {
  if (options_.claim) {
    const nodeid::ClaimOptions options{.address = options_.address, .seed = options_.address.serial};
    claiming_ = std::make_unique<Claiming>(*dispatcher_, static_cast<Claiming::Owner&>(*this), options);
  }
  if (options_.negotiation == NegotiationMode::off) return;
  auto options = options_.negotiator;
  options.address = options_.address;
  options.literal = options_.negotiation == NegotiationMode::literal;
  negotiation_ = std::make_unique<Negotiation>(*dispatcher_, static_cast<Negotiation::Owner&>(*this), memory, options);
}

// SX.6: a master that talks to this device by another scheme shall not be raced.
void Device::note_other_schemes(bool answers) noexcept {
  if (!negotiation_) return;
  if (answers || (options_.lss.on && lss_->state() == lss::State::configuration)) negotiation_->others_at_work();
}

void Device::negotiated(NodeId id) noexcept {
  lss_->set_pending(id);
  lss_->reset_communication();
  reset_values(od::Area::communication);
  nmt_.initialised(id);
  tell();
}

void Device::negotiation_lost(NodeId id, nodeid::IdLoss why) noexcept {
  errors_.raise(co::emcy_code::id_collision, co::error_register::communication,
                {id.value(), static_cast<std::uint8_t>(why)});
  lss_->set_pending(NodeId());
  lss_->reset_communication();
  nmt_.apply(co::NmtCommand::reset_communication);
}

void Device::claim_lost(NodeId id) noexcept { negotiation_lost(id, nodeid::IdLoss::none); }

void Device::negotiation_kept(NodeId) noexcept { errors_.clear(co::emcy_code::id_collision); }

}  // namespace berth::device
