#include "berth/device/claiming.hpp"

namespace berth::device {

void Claiming::power_off() noexcept {
  resetting();
  claimed_ = NodeId();
}

void Claiming::resetting() noexcept {
  slave_.stop();
  dispatcher_->remove(*this);
}

void Claiming::ready(NodeId id) {
  dispatcher_->remove(*this);
  dispatcher_->add(research::claims, *this);
  dispatcher_->add(research::claim_requests, *this);
  if (id.configured()) {
    slave_.settle(id, id != claimed_);
  } else {
    slave_.start();
  }
}

void Claiming::claimed(NodeId id) noexcept {
  claimed_ = id;
  owner_->claimed(id);
}

}  // namespace berth::device
