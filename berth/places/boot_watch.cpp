#include "berth/places/boot_watch.hpp"

namespace berth::places {

BootWatch::BootWatch(can::Dispatcher& dispatcher) {
  dispatcher.add({0x081, 0x0FF}, *this);
  dispatcher.add({0x581, 0x5FF}, *this);
  dispatcher.add({0x701, 0x77F}, *this);
}

void BootWatch::received(const can::Frame& frame, rt::Time at) noexcept {
  if (frame.remote) return;
  Node& node = nodes_[frame.id & 0x7FU];
  if (frame.id >= 0x701) {
    error_control(node, frame, at);
  } else if (frame.size == 8) {
    node.voice = at;
  }
}

void BootWatch::error_control(Node& node, const can::Frame& frame, rt::Time at) noexcept {
  if (frame.size != 1) return;
  node.heard = at;
  node.state = static_cast<NmtState>(frame.data[0] & 0x7FU);
  if (frame.data[0] != 0) {
    ++node.beats;
    return;
  }
  ++node.boot_ups;
  node.boot_up = at;
  if (waiter_ != nullptr && waiter_->id_.value() == (frame.id & 0x7FU)) {
    Wait* const waiter = waiter_;
    waiter_ = nullptr;
    waiter->cancel();
    waiter->finish();
  }
}

BootWatch::Wait::~Wait() {
  if (watch_->waiter_ == this) watch_->waiter_ = nullptr;
}

bool BootWatch::Wait::start() noexcept {
  if (watch_->booted_since(id_, since_) || deadline_ <= executor().now()) return false;
  watch_->waiter_ = this;
  executor().at(deadline_, *this);
  return true;
}

void BootWatch::Wait::run() noexcept {
  if (watch_->waiter_ == this) watch_->waiter_ = nullptr;
  finish();
}

}  // namespace berth::places
