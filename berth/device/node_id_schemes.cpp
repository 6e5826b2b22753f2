#include "berth/device/node_id_schemes.hpp"

namespace berth::device {

NodeIdSchemes::NodeIdSchemes(can::Dispatcher& dispatcher, const Options& options, NvMemory* memory, const Host& host,
                             LssSlave& lss, Errors& errors, Owner& owner)
    : dispatcher_(&dispatcher),
      options_(&options),
      host_(&host),
      lss_(&lss),
      errors_(&errors),
      owner_(&owner),
      methods_({.address = options.address,
                .rand = options.rand,
                .rand_resume = options.rand_resume,
                .and_protocol = options.and_protocol}) {
  if (options.claim) {
    const research::ClaimOptions how{.address = options.address, .seed = options.address.serial};
    claiming_ = std::make_unique<Claiming>(dispatcher, static_cast<Claiming::Owner&>(*this), how);
  }
  if (options.negotiation == NegotiationMode::off) return;
  auto how = options.negotiator;
  how.address = options.address;
  how.literal = options.negotiation == NegotiationMode::literal;
  negotiation_ = std::make_unique<Negotiation>(dispatcher, static_cast<Negotiation::Owner&>(*this), memory, how);
}

void NodeIdSchemes::power_on() noexcept {
  methods_.power_on(options_->address);
  if (negotiation_) negotiation_->power_on(options_->address);
  if (claiming_) claiming_->power_on(options_->address);
}

void NodeIdSchemes::power_off() noexcept {
  dispatcher_->remove(*this);
  if (negotiation_) negotiation_->power_off();
  if (claiming_) claiming_->power_off();
  methods_.power_on(lss_->address());
}

void NodeIdSchemes::resetting() noexcept {
  dispatcher_->remove(*this);
  if (negotiation_) negotiation_->resetting();
  if (claiming_) claiming_->resetting();
}

void NodeIdSchemes::listen() {
  dispatcher_->remove(*this);
  methods_.listen(*dispatcher_, *this);
}

void NodeIdSchemes::ready(NodeId id) {
  if (negotiation_) negotiation_->ready(id);
  if (claiming_) claiming_->ready(id);
}

void NodeIdSchemes::received(const can::Frame& frame, rt::Time) noexcept {
  const auto answer = methods_.handle(frame, lss_->configures());
  master_heard(answer.has_value());
  if (answer && !lss_->silent()) dispatcher_->send(*answer);
}

void NodeIdSchemes::master_heard(bool answered) noexcept {
  if (!negotiation_) return;
  if (answered || lss_->configures()) negotiation_->others_at_work();
}

void NodeIdSchemes::doubled() noexcept {
  if (negotiation_) negotiation_->doubled();
}

void NodeIdSchemes::negotiated(NodeId id) noexcept {
  lss_->assign(id);
  owner_->node_id_given(id);
}

void NodeIdSchemes::negotiation_lost(NodeId id, research::IdLoss why) noexcept {
  errors_->raise(co::emcy_code::id_collision, co::error_register::communication,
                 {id.value(), static_cast<std::uint8_t>(why)});
  lss_->assign(NodeId());
  owner_->node_id_lost();
}

void NodeIdSchemes::negotiation_kept(NodeId) noexcept { errors_->clear(co::emcy_code::id_collision); }

}  // namespace berth::device
