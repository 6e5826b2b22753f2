#include "berth/co/rpdo.hpp"

#include "berth/co/mpdo.hpp"

namespace berth::co {

void Rpdo::set_up(PdoContext& context, std::uint16_t number, std::span<PdoField> room) noexcept {
  context_ = &context;
  number_ = number;
  mapping_ = PdoMapping(room);
}

// Event-driven, without deadline and without errors: a frame of the right size needs no further check.
void Rpdo::choose_way() noexcept {
  const bool quick = active_ && mode_ == PdoMode::mapped && !synchronous(type_) && deadline_ == 0 && faults_ == 0;
  quick_size_ = quick ? static_cast<std::uint8_t>(mapping_.size()) : no_size;
}

void Rpdo::end() noexcept {
  for (std::size_t i = 0; i < pdo_faults; ++i) fault(static_cast<PdoFault>(i), false);
  if (active_) context_->dispatcher->remove(*this);
  active_ = waiting_ = false;
  choose_way();
  due_ = rt::never;
}

void Rpdo::configure() noexcept {
  end();
  const PdoRecords records(*context_->values, PdoKind::rpdo, number_);
  type_ = records.type();
  deadline_ = records.time(pdo_sub::timer);
  if (!records.usable()) return;
  mode_ = records.mode();
  if (mode_ == PdoMode::mapped) {
    const od::AbortCode code = records.resolve(records.mapped(), mapping_);
    if (code != od::AbortCode::none || mapping_.empty()) return;
  }
  active_ = true;
  choose_way();
  context_->dispatcher->add(can::only(records.cob_id().key()), *this);
}

void Rpdo::received(const can::Frame& frame, rt::Time at) noexcept {
  if (frame.size != quick_size_ || frame.remote || frame.fd) [[unlikely]]
    return received_slow(frame, at);
  mapping_.unpack(context_->base, frame.data.data());
  if (context_->observer != nullptr) context_->observer->received(number_, at);
}

void Rpdo::received_slow(const can::Frame& frame, rt::Time at) noexcept {
  if (frame.remote || frame.fd) return;
  if (mode_ != PdoMode::mapped) return received_mpdo(frame, at);
  const unsigned size = mapping_.size();
  if (frame.size < size) return fault(PdoFault::too_short, true, frame.size);
  if (faults_ != 0 || frame.size > size) {
    fault(PdoFault::too_short, false);
    fault(PdoFault::timeout, false);
    fault(PdoFault::too_long, frame.size > size, frame.size);
  }
  if (deadline_ != 0) supervise(at);
  if (!synchronous(type_)) return store(frame.data.data(), at);
  if (at > context_->window_end) return;
  std::memcpy(data_.data(), frame.data.data(), data_.size());
  waiting_ = true;
}

void Rpdo::received_mpdo(const can::Frame& frame, rt::Time at) noexcept {
  if (frame.size < mpdo::size) return fault(PdoFault::too_short, true, frame.size);
  fault(PdoFault::too_short, false);
  fault(PdoFault::timeout, false);
  if (deadline_ != 0) supervise(at);
  const auto heard = mpdo::Heard::of(frame);
  if (heard.destination != (mode_ == PdoMode::dam)) return;
  auto& context = *context_;
  if (!heard.destination) return mpdo::dispatch(*context.values, heard, context.observer, at);
  if (heard.node != 0 && heard.node != context.node.value()) return;
  const bool stored = mpdo::write(*context.values, heard);
  set_fault(PdoFault::unavailable, !stored,
            {static_cast<std::uint8_t>(number_), static_cast<std::uint8_t>(number_ >> 8), frame.data[1], frame.data[2],
             frame.data[3]});
  if (stored && context.observer != nullptr) context.observer->received_mpdo(heard.object, at);
}

void Rpdo::store(const std::uint8_t* data, rt::Time at) noexcept {
  mapping_.unpack(context_->base, data);
  if (context_->observer != nullptr) context_->observer->received(number_, at);
}

void Rpdo::sync(rt::Time at) noexcept {
  if (std::exchange(waiting_, false)) store(data_.data(), at);
}

void Rpdo::supervise(rt::Time at) noexcept {
  due_ = at + context_->owner->in_world(std::chrono::milliseconds(deadline_));
  context_->arm(due_);
}

void Rpdo::run(rt::Time now) noexcept {
  if (due_ > now) return;
  due_ = rt::never;
  fault(PdoFault::timeout, true);
  if (context_->observer != nullptr) context_->observer->silent(number_, now);
}

void Rpdo::set_deadline(std::uint16_t milliseconds) noexcept {
  deadline_ = milliseconds;
  choose_way();
  if (milliseconds == 0) fault(PdoFault::timeout, false);
  if (std::exchange(due_, rt::never) != rt::never && milliseconds != 0) supervise(context_->now());
}

void Rpdo::fault(PdoFault fault, bool on, std::uint8_t length) noexcept {
  const auto low = static_cast<std::uint8_t>(number_);
  const auto high = static_cast<std::uint8_t>(number_ >> 8);
  set_fault(fault, on, {low, high, length, static_cast<std::uint8_t>(mapping_.size())});
}

void Rpdo::set_fault(PdoFault fault, bool on, const std::array<std::uint8_t, 5>& info) noexcept {
  const auto bit = static_cast<std::uint8_t>(1U << static_cast<unsigned>(fault));
  if (((faults_ & bit) != 0) == on) return;
  faults_ ^= bit;
  choose_way();
  if (on) {
    context_->faults.begin(fault, info);
  } else {
    context_->faults.end(fault);
  }
}

}  // namespace berth::co
