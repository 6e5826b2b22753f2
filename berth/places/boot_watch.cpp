#include "berth/places/boot_watch.hpp"

#include <algorithm>
#include <chrono>

namespace berth::places {

namespace {
// Toggled in answers to node guarding (CiA 301 §7.2.8.3.2.1); 0 in heartbeats. Distinguishes them: a slow device's
// answers come at the interval of the requests, as regularly as heartbeats.
constexpr std::uint8_t toggle_bit = 0x80;
}  // namespace

BootWatch::BootWatch(can::Dispatcher& dispatcher, co::SdoClient* sdo) : sdo_(sdo) {
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
    const bool is_answer = (frame.data[0] & toggle_bit) != 0;
    if (is_answer) {
      node.beat.reset();
      node.gaps = {};
      return;
    }
    if (node.beat) node.gaps = {at - *node.beat, node.gaps[0]};
    node.beat = at;
    return;
  }
  node.beat.reset();
  node.gaps = {};
  ++node.boot_ups;
  node.boot_up = at;
  if (sdo_ != nullptr) sdo_->booted(NodeId(static_cast<std::uint8_t>(frame.id & 0x7FU)));
  for (Wait* waiter = waiters_; waiter != nullptr;) {
    Wait* const next = waiter->next_;
    if (waiter->is_over()) {
      waiter->leave();
      waiter->cancel();
      waiter->finish();
    }
    waiter = next;
  }
}

// Two devices under one node-ID alternate with their heartbeats, rarely at equal intervals.
std::optional<rt::Duration> BootWatch::steady(NodeId id) const noexcept {
  const auto& [last, before] = at(id).gaps;
  const rt::Duration mean = (last + before) / 2;
  // A heartbeat may have to wait for another node's frame, which takes up to 13.5 ms at 10 kbit/s.
  constexpr rt::Duration waits = std::chrono::milliseconds(27);
  const rt::Duration unequal = std::min(mean / 4, std::max(mean / 8, waits));
  const bool equal = before.count() > 0 && last < before + unequal && before < last + unequal;
  return equal ? std::optional(mean) : std::nullopt;
}

BootWatch::Wait::~Wait() { leave(); }

void BootWatch::Wait::leave() noexcept {
  for (Wait** place = &watch_->waiters_; *place != nullptr; place = &(*place)->next_) {
    if (*place != this) continue;
    *place = next_;
    return;
  }
}

bool BootWatch::Wait::is_over() const noexcept {
  const bool other = other_.id.configured() && watch_->booted_since(other_.id, other_.since);
  return other || watch_->booted_since(id_, since_);
}

bool BootWatch::Wait::start() noexcept {
  if (is_over() || deadline_ <= executor().now()) return false;
  next_ = watch_->waiters_;
  watch_->waiters_ = this;
  executor().at(deadline_, *this);
  return true;
}

void BootWatch::Wait::run() noexcept {
  leave();
  finish();
}

}  // namespace berth::places
