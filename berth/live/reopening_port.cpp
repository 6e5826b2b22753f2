#include "berth/live/reopening_port.hpp"

namespace berth::live {

ReopeningPort::ReopeningPort(rt::Executor& executor, std::unique_ptr<can::Port> port, Open open, rt::Duration pause)
    : executor_(&executor), port_(std::move(port)), open_(std::move(open)), pause_(pause) {}

ReopeningPort::~ReopeningPort() {
  if (port_) port_->listen(nullptr, {});
}

can::Queued ReopeningPort::send(const can::Frame& frame, std::uint32_t tag) noexcept {
  return port_ ? port_->send(frame, tag) : can::Queued::closed;
}

void ReopeningPort::withdraw(std::uint32_t tag) noexcept {
  if (port_) port_->withdraw(tag);
}

void ReopeningPort::listen(can::Listener* listener, std::span<const can::IdRange> accept) noexcept {
  listener_ = listener;
  accept_.assign(accept.begin(), accept.end());
  if (port_) port_->listen(this, accept_);
}

can::Status ReopeningPort::status() const noexcept { return counted(port_ ? port_->status() : can::Status{}); }

can::Status ReopeningPort::counted(can::Status status) const noexcept {
  status.errors += errors_before_;
  status.lost += lost_before_;
  return status;
}

bool ReopeningPort::restart(std::uint32_t bit_rate) noexcept { return port_ && port_->restart(bit_rate); }

// In a job of its own: the old port must not be destroyed inside one of its calls.
void ReopeningPort::run() noexcept {
  if (port_ && port_->status().up) return;
  if (port_) {
    port_->listen(nullptr, {});
    const auto last = status();
    errors_before_ = last.errors;
    lost_before_ = last.lost;
  }
  port_.reset();
  port_ = open_();
  if (!port_ || !port_->status().up) return executor_->after(pause_, *this);
  port_->listen(this, accept_);
  if (listener_ != nullptr) listener_->changed(status(), executor_->now());
}

void ReopeningPort::received(const can::Frame& frame, rt::Time at) noexcept {
  if (listener_ != nullptr) listener_->received(frame, at);
}

void ReopeningPort::sent(std::uint32_t tag, rt::Time at) noexcept {
  if (listener_ != nullptr) listener_->sent(tag, at);
}

void ReopeningPort::changed(const can::Status& status, rt::Time at) noexcept {
  if (!status.up && !timed()) executor_->after(pause_, *this);
  if (listener_ != nullptr) listener_->changed(counted(status), at);
}

void ReopeningPort::error(const can::Frame& report, rt::Time at) noexcept {
  if (listener_ != nullptr) listener_->error(report, at);
}

}  // namespace berth::live
