#include "berth/co/sync.hpp"

#include "berth/base/bytes.hpp"
#include "berth/co/emcy.hpp"

namespace berth::co {
namespace {

constexpr ObjectRef sync_object{0x1005, 0};
constexpr ObjectRef period_object{0x1006, 0};
constexpr ObjectRef window_object{0x1007, 0};
constexpr ObjectRef overflow_object{0x1019, 0};
constexpr std::uint8_t least_overflow = 2, most_overflow = 240;

constexpr bool produces(CobId id) noexcept { return (id.raw() & CobId::second_bit) != 0; }

}  // namespace

Sync::Sync(can::Dispatcher& dispatcher, od::Values& values, ServiceOwner& owner, Pdos* pdos)
    : dispatcher_(&dispatcher), values_(&values), owner_(&owner), pdos_(pdos) {
  for (const ObjectRef object : {sync_object, period_object, window_object, overflow_object}) {
    if (values.description().find(object.index) != nullptr) values.attach(*this, object.index);
  }
}

void Sync::start() noexcept {
  stop();
  running_ = true;
  counter_ = 0;
  count_ = 0;
  apply();
}

void Sync::stop() noexcept {
  running_ = false;
  cancel();
  set_missing(false, dispatcher_->executor().now());
  dispatcher_->remove(*this);
  if (pending()) dispatcher_->withdraw(*this);
  wrong_length(false);
}

bool Sync::producer() const noexcept {
  return produces(CobId(values_->get_or<std::uint32_t>(sync_object, sync_id))) &&
         values_->get_or<std::uint32_t>(period_object, 0) != 0;
}

// Reads all objects; the period begins now.
void Sync::apply() noexcept {
  cob_id_ = CobId(values_->get_or<std::uint32_t>(sync_object, sync_id));
  read_window();
  overflow_ = values_->get_or<std::uint8_t>(overflow_object, 0);
  if (overflow_ < least_overflow || overflow_ > most_overflow) overflow_ = 0;
  dispatcher_->remove(*this);
  cancel();
  if (pending()) dispatcher_->withdraw(*this);
  period_ = owner_->in_world(std::chrono::microseconds(values_->get_or<std::uint32_t>(period_object, 0)));
  produces_ = producer();
  set_missing(false, dispatcher_->executor().now());
  if (!cob_id_.allowed()) return;  // the default value is faulty
  dispatcher_->add(can::only(cob_id_.key()), *this);
  if (!produces_) return;
  next_ = dispatcher_->executor().now() + period_;
  dispatcher_->executor().at(next_, *this);
}

void Sync::read_window() noexcept {
  window_ = owner_->in_world(std::chrono::microseconds(values_->get_or<std::uint32_t>(window_object, 0)));
}

void Sync::run() noexcept {
  if (!produces_) return set_missing(true, dispatcher_->executor().now());
  produce();
}

void Sync::produce() noexcept {
  // The period counts from the time when the frame was due, so that late jobs do not make it drift.
  next_ += period_;
  dispatcher_->executor().at(next_, *this);
  can::Frame frame;
  frame.id = cob_id_.id();
  frame.extended = cob_id_.extended();
  if (overflow_ != 0) {
    frame.size = 1;
    frame.data[0] = next_counter();
  }
  (void)dispatcher_->send(frame, *this);
}

std::uint8_t Sync::next_counter() const noexcept {
  return counter_ >= overflow_ ? std::uint8_t{1} : static_cast<std::uint8_t>(counter_ + 1);
}

void Sync::sent(rt::Time at) noexcept {
  if (overflow_ != 0) counter_ = next_counter();
  synchronise(overflow_ != 0 ? counter_ : std::uint8_t{0}, at);
}

void Sync::received(const can::Frame& frame, rt::Time at) noexcept {
  if (frame.remote || frame.fd) return;
  const unsigned expected = overflow_ == 0 ? 0 : 1;
  wrong_length(frame.size != expected, frame.size);
  if (frame.size == expected) synchronise(expected == 0 ? std::uint8_t{0} : frame.data[0], at);
}

void Sync::synchronise(std::uint8_t counter, rt::Time at) noexcept {
  ++count_;
  if (!produces_ && period_ > rt::Duration::zero()) supervise(at);
  if (pdos_ != nullptr) pdos_->sync(counter, at, window_);
  if (observer_ != nullptr) observer_->synchronised(counter, at);
}

void Sync::supervise(rt::Time at) noexcept {
  dispatcher_->executor().at(at + period_ * 3 / 2, *this);
  set_missing(false, at);
}

void Sync::set_missing(bool missing, rt::Time at) noexcept {
  if (std::exchange(missing_, missing) != missing && observer_ != nullptr) observer_->sync_missing(missing, at);
}

void Sync::wrong_length(bool on, std::uint8_t length) noexcept {
  if (std::exchange(wrong_length_, on) == on) return;
  if (!on) return owner_->clear_error(emcy_code::sync_length);
  const auto expected = static_cast<std::uint8_t>(overflow_ == 0 ? 0 : 1);
  owner_->raise_error(emcy_code::sync_length, error_register::communication, {length, expected});
}

// --- Objects ---------------------------------------------------------------------------------------------------------

od::AbortCode Sync::writing(const od::Values&, ObjectRef ref, std::span<const std::uint8_t> value) noexcept {
  if (ref == sync_object && value.size() == 4) return writing_cob_id(load_le<std::uint32_t>(value.data()));
  if (ref == overflow_object && value.size() == 1) return writing_overflow(value[0]);
  return od::AbortCode::none;
}

od::AbortCode Sync::writing_cob_id(std::uint32_t value) const noexcept {
  const CobId before(values_->get_or<std::uint32_t>(sync_object, sync_id));
  const CobId after(value);
  if (produces(before) && !before.same_identifier(after)) return od::AbortCode::invalid_value;
  return after.allowed() ? od::AbortCode::none : od::AbortCode::invalid_value;
}

od::AbortCode Sync::writing_overflow(std::uint8_t value) const noexcept {
  if (value != 0 && (value < least_overflow || value > most_overflow)) return od::AbortCode::invalid_value;
  const bool frozen = values_->get_or<std::uint32_t>(period_object, 0) != 0;
  const bool changes = values_->get_or<std::uint8_t>(overflow_object, 0) != value;
  return frozen && changes ? od::AbortCode::device_state : od::AbortCode::none;
}

void Sync::written(od::Values&, ObjectRef ref) noexcept {
  if (!running_) return;
  if (ref == window_object) return read_window();
  const bool was_producer = produces(cob_id_);
  if (ref == overflow_object) counter_ = 0;
  apply();
  if (!was_producer && produces(cob_id_)) counter_ = 0;
}

}  // namespace berth::co
