#include "berth/operate/role_port.hpp"

#include "berth/manager/flying_negotiation.hpp"

namespace berth::operate {

void RolePort::open(bool open) noexcept {
  if (open_ == open) return;
  open_ = open;
  told_.post();
}

bool RolePort::usable() const noexcept {
  const auto status = inner_->status();
  return status.up && !status.listen_only && !status.bus_off;
}

can::Queued RolePort::send(const can::Frame& frame, std::uint32_t tag) noexcept {
  const auto key = frame.key();
  const bool agrees = key >= manager::flying_master_ids.first && key <= manager::flying_master_ids.last;
  return open_ || agrees ? inner_->send(frame, tag) : can::Queued::listen_only;
}

void RolePort::listen(can::Listener* listener, std::span<const can::IdRange> accept) noexcept {
  listener_ = listener;
  inner_->listen(listener == nullptr ? nullptr : this, accept);
}

can::Status RolePort::status() const noexcept {
  can::Status status = inner_->status();
  status.listen_only = status.listen_only || !open_;
  return status;
}

void RolePort::received(const can::Frame& frame, rt::Time at) noexcept {
  if (listener_ != nullptr) listener_->received(frame, at);
}

void RolePort::sent(std::uint32_t tag, rt::Time at) noexcept {
  if (listener_ != nullptr) listener_->sent(tag, at);
}

void RolePort::changed(const can::Status&, rt::Time at) noexcept {
  if (on_change_) on_change_();
  if (listener_ != nullptr) listener_->changed(status(), at);
}

void RolePort::tell() noexcept {
  if (listener_ != nullptr) listener_->changed(status(), executor_->now());
}

}  // namespace berth::operate
