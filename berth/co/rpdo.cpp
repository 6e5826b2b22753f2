// Receiving: lengths, SYNC, deadlines and the errors that come of them.
#include "berth/co/emcy.hpp"
#include "berth/co/pdo.hpp"
#include "berth/co/pdo_parts.hpp"

namespace berth::co {

void Pdos::Rpdo::received(const can::Frame& frame, rt::Time at) noexcept {
  if (frame.size != quick_size || frame.remote || frame.fd) return set->received(*this, frame, at);
  mapping.unpack(set->base_, frame.data.data());
  if (set->observer_ != nullptr) set->observer_->received(number, at);
}

void Pdos::received(Rpdo& pdo, const can::Frame& frame, rt::Time at) noexcept {
  if (frame.remote || frame.fd) return;
  if (pdo.mode != PdoMode::mapped) return received_mpdo(pdo, frame, at);
  const unsigned size = pdo.mapping.size();
  if (frame.size < size) return fault(pdo, Fault::too_short, true, frame.size);
  if (pdo.faults != 0 || frame.size > size) {
    fault(pdo, Fault::too_short, false);
    fault(pdo, Fault::timeout, false);
    fault(pdo, Fault::too_long, frame.size > size, frame.size);
  }
  if (pdo.deadline != 0) supervise(pdo, at);
  if (!synchronous(pdo.type)) return store(pdo, frame.data.data(), at);
  if (at > window_end_) return;
  std::memcpy(pdo.data.data(), frame.data.data(), pdo.data.size());
  pdo.waiting = true;
}

void Pdos::store(Rpdo& pdo, const std::uint8_t* data, rt::Time at) noexcept {
  pdo.mapping.unpack(base_, data);
  if (observer_ != nullptr) observer_->received(pdo.number, at);
}

void Pdos::supervise(Rpdo& pdo, rt::Time at) noexcept {
  pdo.due = at + owner_->in_world(std::chrono::milliseconds(pdo.deadline));
  arm(pdo.due);
}

void Pdos::set_deadline(Rpdo& pdo, std::uint16_t milliseconds) noexcept {
  pdo.deadline = milliseconds;
  pdo.choose_way();
  if (milliseconds == 0) fault(pdo, Fault::timeout, false);
  if (std::exchange(pdo.due, rt::never) != rt::never && milliseconds != 0) supervise(pdo, now());
}

void Pdos::fault(Rpdo& pdo, Fault fault, bool on, std::uint8_t length) noexcept {
  const auto low = static_cast<std::uint8_t>(pdo.number);
  const auto high = static_cast<std::uint8_t>(pdo.number >> 8);
  set_fault(pdo, fault, on, {low, high, length, static_cast<std::uint8_t>(pdo.mapping.size())});
}

// One emergency for all RPDOs with the same error.
void Pdos::set_fault(Rpdo& pdo, Fault fault, bool on, const std::array<std::uint8_t, 5>& info) noexcept {
  static constexpr std::array<std::uint16_t, faults> codes{emcy_code::pdo_length, emcy_code::pdo_too_long,
                                                           emcy_code::rpdo_timeout, emcy_code::mpdo_destination};
  const auto which = static_cast<std::size_t>(fault);
  const auto bit = static_cast<std::uint8_t>(1U << which);
  if (((pdo.faults & bit) != 0) == on) return;
  pdo.faults ^= bit;
  pdo.choose_way();
  if (on) {
    if (fault_counts_[which]++ == 0) owner_->raise_error(codes[which], error_register::communication, info);
  } else {
    if (--fault_counts_[which] == 0) owner_->clear_error(codes[which]);
  }
}

}  // namespace berth::co
