#include "berth/multilevel/metered_port.hpp"

#include <algorithm>

namespace berth::multilevel {

namespace {
constexpr std::uint32_t own_tag = 0x8000'0000;  // a dispatcher counts its own from 1 upwards
}

void MeteredPort::watch(std::uint32_t key, PortMeter& meter) {
  std::erase_if(watched_, [key](const Watched& each) { return each.key == key; });
  watched_.push_back({key, &meter});
  under_way_.reserve(64);
}

void MeteredPort::forget(const PortMeter& meter) noexcept {
  std::erase_if(watched_, [&meter](const Watched& each) { return each.meter == &meter; });
}

PortMeter* MeteredPort::meter(std::uint32_t key) const noexcept {
  const auto found = std::ranges::find(watched_, key, &Watched::key);
  return found == watched_.end() ? nullptr : found->meter;
}

can::Queued MeteredPort::send(const can::Frame& frame, std::uint32_t tag) noexcept {
  PortMeter* const told = meter(frame.key());
  if (told == nullptr) return beneath_->send(frame, tag);
  const bool own = tag == 0;
  if (own) tag = own_tag | (++next_ & ~own_tag);
  const auto queued = beneath_->send(frame, tag);
  if (queued != can::Queued::yes) return queued;
  under_way_.push_back({tag, frame.key(), own});
  told->submitted(frame.key(), executor_->now());
  return queued;
}

void MeteredPort::withdraw(std::uint32_t tag) noexcept {
  std::erase_if(under_way_, [tag](const UnderWay& each) { return each.tag == tag; });
  beneath_->withdraw(tag);
}

void MeteredPort::listen(can::Listener* listener, std::span<const can::IdRange> accept) noexcept {
  listener_ = listener;
  beneath_->listen(listener == nullptr ? nullptr : this, accept);
}

bool MeteredPort::restart(std::uint32_t bit_rate) noexcept {
  under_way_.clear();
  return beneath_->restart(bit_rate);
}

void MeteredPort::received(const can::Frame& frame, rt::Time at) noexcept {
  if (listener_ != nullptr) listener_->received(frame, at);
}

void MeteredPort::sent(std::uint32_t tag, rt::Time at) noexcept {
  const auto found = std::ranges::find(under_way_, tag, &UnderWay::tag);
  const bool known = found != under_way_.end();
  const UnderWay frame = known ? *found : UnderWay{tag, 0, false};
  if (known) under_way_.erase(found);
  if (!frame.own && listener_ != nullptr) listener_->sent(tag, at);
  if (!known) return;
  if (PortMeter* const told = meter(frame.key)) told->on_the_wire(frame.key, at);
}

void MeteredPort::changed(const can::Status& status, rt::Time at) noexcept {
  if (listener_ != nullptr) listener_->changed(status, at);
}

}  // namespace berth::multilevel
