#include "berth/io/deliveries.hpp"

#include "berth/can/ranges.hpp"

namespace berth::io {

void Deliveries::listen(can::Listener* listener, std::span<const can::IdRange> accept) {
  if (listener != listener_) events_.clear();
  listener_ = listener;
  accept_ = listener != nullptr ? can::normalised(accept) : std::vector<can::IdRange>{};
}

void Deliveries::received(const can::Frame& frame, rt::Time at) noexcept {
  if (listener_ != nullptr) add(What::received, at).frame = frame;
}

void Deliveries::sent(std::uint32_t tag, rt::Time at) noexcept {
  if (listener_ != nullptr) add(What::sent, at).tag = tag;
}

void Deliveries::changed(const can::Status& status, rt::Time at) noexcept {
  if (listener_ != nullptr) add(What::changed, at).status = status;
}

void Deliveries::error(const can::Frame& report, rt::Time at) noexcept {
  if (listener_ != nullptr) add(What::error, at).frame = report;
}

Deliveries::Event& Deliveries::add(What what, rt::Time at) noexcept {
  const bool first = events_.empty();
  Event& event = events_.push();
  event.what = what;
  event.at = at;
  if (first) wait_for_next();
  return event;
}

// Delivered just after its time, so that a comparison shows that it was heard later than it was on the wire.
void Deliveries::wait_for_next() noexcept {
  const rt::Time at = events_.front().at;
  if (at > executor_->now()) {
    executor_->at(at + rt::Duration{1}, *this);
  } else {
    executor_->post(*this);
  }
}

void Deliveries::run() noexcept {
  while (!events_.empty()) {
    if (events_.front().at > executor_->now()) return wait_for_next();
    const Event event = events_.front();  // a copy: the listener may add events
    events_.pop();
    if (listener_ == nullptr) continue;
    if (event.what == What::received && !can::contains(accept_, event.frame.key())) continue;
    if (!events_.empty()) wait_for_next();
    switch (event.what) {
      case What::received: return listener_->received(event.frame, event.at);
      case What::sent: return listener_->sent(event.tag, event.at);
      case What::changed: return listener_->changed(event.status, event.at);
      case What::error: return listener_->error(event.frame, event.at);
    }
  }
}

}  // namespace berth::io
