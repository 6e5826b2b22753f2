// Transmitting: when a TPDO is sampled, and when it may go to the port.
#include "berth/co/pdo.hpp"
#include "berth/co/pdo_parts.hpp"
#include "berth/co/retry_parts.hpp"

namespace berth::co {
namespace {

// A frame that the port has had for so long is taken to be lost: a port that was restarted forgets its queue.
constexpr auto lost_after = std::chrono::seconds(1);

can::Frame empty_frame(std::uint32_t key, unsigned size) noexcept {
  can::Frame frame;
  frame.id = key & ~can::extended_flag;
  frame.extended = (key & can::extended_flag) != 0;
  frame.size = static_cast<std::uint8_t>(size);
  return frame;
}

}  // namespace

bool Pdos::event(unsigned number) noexcept {
  Tpdo* const pdo = find(tpdos(), number);
  if (pdo == nullptr) return false;
  if (!pdo->quick) return fire(*pdo);
  can::Frame frame = empty_frame(pdo->key, pdo->mapping.size());
  pdo->mapping.pack(base_, frame.data.data());
  const can::Queued queued = dispatcher_->send(frame);
  pdo->waiting = false;
  if (queued != can::Queued::yes) failed(*pdo, queued);
  return true;
}

bool Pdos::changed(ObjectRef object) noexcept {
  if (!running_) return false;
  const od::SubObject* const sub = values_->description().find(object);
  if (sub == nullptr) return false;
  bool any = false;
  for (Tpdo& pdo : tpdos()) {
    if (!pdo.active) continue;
    if (pdo.mode == PdoMode::sam) {
      any |= scan(pdo, object);
    } else if (pdo.mapping.contains(sub->offset)) {
      any |= fire(pdo);
    }
  }
  return any;
}

bool Pdos::fire(Tpdo& pdo) noexcept {
  if (!pdo.active || pdo.mode != PdoMode::mapped) return false;
  if (event_driven(pdo.type)) {
    attempt(pdo);
    return true;
  }
  if (pdo.type != 0) return false;
  pdo.event = true;
  return true;
}

void Pdos::attempt(Tpdo& pdo) noexcept {
  if (pdo.inhibit != 0 && !may_go(pdo)) return;
  can::Frame frame = empty_frame(pdo.key, pdo.mapping.size());
  if (pdo.stamped) stamp();
  pdo.mapping.pack(base_, frame.data.data());
  const can::Queued queued = submit(pdo, frame);
  if (queued != can::Queued::yes) return failed(pdo, queued);
  pdo.waiting = false;
  if (pdo.event_time != 0) restart_event_timer(pdo);
}

// Not while the PDO before it waits in the port, and not within the inhibit time after that.
bool Pdos::may_go(Tpdo& pdo) noexcept {
  if (pdo.free_at <= now()) return true;
  pdo.waiting = true;
  arm(pdo.free_at);
  return false;
}

can::Queued Pdos::submit(Tpdo& pdo, const can::Frame& frame) noexcept {
  if (pdo.inhibit == 0) return dispatcher_->send(frame);
  const can::Queued queued = dispatcher_->send(frame, pdo);
  if (queued == can::Queued::yes) pdo.free_at = now() + lost_after;  // until `sent` knows better
  return queued;
}

void Pdos::failed(Tpdo& pdo, can::Queued why) noexcept {
  pdo.waiting = true;
  pdo.free_at = now() + (why == can::Queued::full ? full_retry : dead_port_retry);
  arm(pdo.free_at);
}

void Pdos::sent(Tpdo& pdo, rt::Time at) noexcept {
  if (pdo.inhibit != 0) {
    pdo.free_at = at + owner_->in_world(std::chrono::microseconds(100) * pdo.inhibit);
    if (pdo.waiting) arm(pdo.free_at);
    return;
  }
  for (Tpdo& each : tpdos()) {  // there is room in the port again
    if (each.waiting && synchronous(each.type)) return send_sample(each);
  }
}

void Pdos::retry(Tpdo& pdo) noexcept {
  if (pdo.mode == PdoMode::sam) {
    send_scanned(pdo);
  } else if (event_driven(pdo.type)) {
    attempt(pdo);
  } else {
    send_sample(pdo);
  }
}

void Pdos::restart_event_timer(Tpdo& pdo) noexcept {
  pdo.due = rt::never;
  if (pdo.event_time == 0 || pdo.mode != PdoMode::mapped) return;
  pdo.due = now() + owner_->in_world(std::chrono::milliseconds(pdo.event_time));
  arm(pdo.due);
}

void Pdos::set_event_time(Tpdo& pdo, std::uint16_t milliseconds) noexcept {
  if (!pdo.active || !event_driven(pdo.type)) return;
  pdo.event_time = milliseconds;
  pdo.choose_way();
  restart_event_timer(pdo);
}

// 1013h is a value like any other; a device that transmits it does so with the time of sampling.
void Pdos::stamp() noexcept {
  const auto since = std::chrono::duration_cast<std::chrono::microseconds>(now().time_since_epoch()).count();
  values_->set({0x1013, 0}, static_cast<std::uint32_t>(since));
}

// --- SYNC ------------------------------------------------------------------------------------------------------------

void Pdos::sync(std::uint8_t counter, rt::Time at, rt::Duration window) noexcept {
  if (!running_) return;
  window_end_ = window > rt::Duration::zero() ? at + window : rt::never;
  for (Rpdo& pdo : rpdos()) {
    if (std::exchange(pdo.waiting, false)) store(pdo, pdo.data.data(), at);
  }
  for (Tpdo& pdo : tpdos()) {
    if (pdo.active) sync(pdo, counter);
  }
  arm(window_end_);
}

void Pdos::sync(Tpdo& pdo, std::uint8_t counter) noexcept {
  if (pdo.type == rtr_sampled_at_sync) return sample(pdo);
  if (!synchronous(pdo.type)) return;
  if (pdo.start_at != 0 && counter != 0) {
    if (pdo.start_at != counter) return;
    pdo.start_at = 0;
  }
  if (pdo.type == 0) {
    if (!pdo.event) return;
    pdo.event = false;
  } else {
    if (++pdo.syncs < pdo.type) return;
    pdo.syncs = 0;
  }
  sample(pdo);
  send_sample(pdo);
}

void Pdos::sample(Tpdo& pdo) noexcept {
  if (pdo.stamped) stamp();
  pdo.mapping.pack(base_, pdo.data.data());
  pdo.sampled = true;
}

// With a confirmation, so that it can be taken back when the window closes.
void Pdos::send_sample(Tpdo& pdo) noexcept {
  can::Frame frame = empty_frame(pdo.key, pdo.mapping.size());
  std::memcpy(frame.data.data(), pdo.data.data(), pdo.data.size());
  const can::Queued queued = dispatcher_->send(frame, pdo);
  if (queued != can::Queued::yes) return failed(pdo, queued);
  pdo.waiting = false;
}

void Pdos::close_window() noexcept {
  for (Tpdo& pdo : tpdos()) {
    if (!synchronous(pdo.type)) continue;
    pdo.waiting = false;
    if (pdo.pending()) dispatcher_->withdraw(pdo);
  }
}

void Pdos::requested(std::uint32_t key) noexcept {
  for (Tpdo& pdo : tpdos()) {
    if (!pdo.active || !pdo.answers || pdo.key != key || pdo.mode != PdoMode::mapped) continue;
    if (event_driven(pdo.type)) {
      attempt(pdo);
    } else if (!synchronous(pdo.type)) {
      if (pdo.type == rtr_only || !pdo.sampled) sample(pdo);
      send_sample(pdo);
    }
  }
}

}  // namespace berth::co
