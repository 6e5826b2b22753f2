#include "berth/multilevel/sdo_gateway.hpp"

#include "berth/base/bytes.hpp"
#include "berth/multilevel/sdo_session.hpp"
#include "berth/od/cia301.hpp"

namespace berth::multilevel {

SdoGateway::SdoGateway(od::Values& upper, co::SdoClient& beneath, rt::Executor& executor,
                       const SdoGatewayOptions& options)
    : upper_(&upper),
      beneath_(&beneath),
      executor_(&executor),
      options_(options),
      objects_(SdoGatewayObjects::of(options.port)) {
  if (!upper.attach(*this, objects_.data)) return;
  upper.attach(*this, objects_.node.index, objects_.command.index);
  for (std::size_t channel = 0; channel < sessions_.size(); ++channel) {
    const bool serves =
        channel == 0 || upper.description().find(static_cast<std::uint16_t>(od::cia301::default_server + channel));
    if (serves) sessions_[channel] = std::make_unique<SdoSession>(*this, static_cast<std::uint8_t>(channel));
  }
}

SdoGateway::~SdoGateway() {
  if (own_values_ != nullptr) own_values_->channels().tell(nullptr);
}

void SdoGateway::set_own(NodeId own, od::Values& values) noexcept {
  own_ = own;
  own_values_ = &values;
  values.channels().tell(this);
}

void SdoGateway::completed(ObjectRef object, od::AbortCode code) noexcept {
  for (auto& each : sessions_) {
    if (each) each->completed(object, code);
  }
}

void SdoGateway::set_client(co::SdoClient& beneath) noexcept {
  reset();
  beneath_ = &beneath;
}

void SdoGateway::reset() noexcept {
  for (auto& each : sessions_) {
    if (each) each->reset();
  }
}

std::size_t SdoGateway::busy() const noexcept {
  std::size_t count = 0;
  for (const auto& each : sessions_) count += each && each->busy() ? 1 : 0;
  return count;
}

SdoSession* SdoGateway::session() noexcept {
  const auto& mine = sessions_[upper_->channels().now() % sessions_.size()];
  return mine ? mine.get() : sessions_[0].get();
}

od::Stream& SdoGateway::of(std::uint8_t channel) noexcept {
  const auto& mine = sessions_[channel % sessions_.size()];
  return mine ? *mine : *sessions_[0];
}

od::AbortCode SdoGateway::reading(const od::Values&, ObjectRef ref, std::span<const std::uint8_t>& value) noexcept {
  if (ref == objects_.node) value = session()->shown(false);
  if (ref == objects_.command) value = session()->shown(true);
  return od::AbortCode::none;
}

od::AbortCode SdoGateway::writing(const od::Values&, ObjectRef ref, std::span<const std::uint8_t> value) noexcept {
  if (ref == objects_.node) return session()->select(value[0]);
  if (ref == objects_.command) return session()->command(load_le<std::uint32_t>(value.data()));
  return od::AbortCode::none;
}

void SdoGateway::abandoned(od::Values&, ObjectRef) noexcept { session()->cancel(); }

}  // namespace berth::multilevel
