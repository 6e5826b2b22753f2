#include "berth/co/time_stamp.hpp"

#include "berth/base/bytes.hpp"

namespace berth::co {
namespace {

constexpr ObjectRef time_object{0x1012, 0};
constexpr std::uint32_t reserved_bits = 0xF000'0000;  // of the milliseconds
constexpr std::int64_t seconds_a_day = 86'400;
constexpr std::int64_t epoch_days = 5113;  // 1970-01-01 to 1984-01-01

}  // namespace

std::optional<TimeOfDay> TimeOfDay::from_unix(std::int64_t seconds, std::uint32_t milliseconds) noexcept {
  const std::int64_t since = seconds - epoch_days * seconds_a_day;
  if (since < 0 || since / seconds_a_day > 0xFFFF || milliseconds > 999) return std::nullopt;
  return TimeOfDay{static_cast<std::uint32_t>(since % seconds_a_day) * 1000 + milliseconds,
                   static_cast<std::uint16_t>(since / seconds_a_day)};
}

std::int64_t TimeOfDay::unix_seconds() const noexcept {
  return (epoch_days + days) * seconds_a_day + milliseconds / 1000;
}

std::array<std::uint8_t, 6> TimeOfDay::encode() const noexcept {
  std::array<std::uint8_t, 6> bytes{};
  store_le(bytes.data(), milliseconds & ~reserved_bits);
  store_le(bytes.data() + 4, days);
  return bytes;
}

std::optional<TimeOfDay> TimeOfDay::decode(std::span<const std::uint8_t> bytes) noexcept {
  if (bytes.size() != 6) return std::nullopt;
  const TimeOfDay time{load_le<std::uint32_t>(bytes.data()) & ~reserved_bits, load_le<std::uint16_t>(bytes.data() + 4)};
  return time.milliseconds < milliseconds_a_day ? std::optional(time) : std::nullopt;
}

TimeStamp::TimeStamp(can::Dispatcher& dispatcher, od::Values& values) : dispatcher_(&dispatcher), values_(&values) {
  if (values.description().find(time_object) != nullptr) values.attach(*this, time_object.index);
}

bool TimeStamp::consumer() const noexcept { return (raw_ & CobId::invalid_bit) != 0; }
bool TimeStamp::producer() const noexcept { return (raw_ & CobId::second_bit) != 0; }

void TimeStamp::start() noexcept {
  running_ = true;
  apply();
}

void TimeStamp::stop() noexcept {
  running_ = false;
  raw_ = 0;
  dispatcher_->remove(*this);
}

void TimeStamp::apply() noexcept {
  raw_ = values_->get_or<std::uint32_t>(time_object, 0);
  if (!CobId(raw_).allowed()) raw_ = 0;
  dispatcher_->remove(*this);
  if (consumer()) dispatcher_->add(can::only(CobId(raw_).key()), *this);
}

can::Queued TimeStamp::send(const TimeOfDay& time) noexcept {
  if (!running_ || !producer()) return can::Queued::closed;
  const CobId id(raw_);
  const auto bytes = time.encode();
  return dispatcher_->send(id.extended() ? can::Frame::ext(id.id(), bytes) : can::Frame::base(id.id(), bytes));
}

void TimeStamp::received(const can::Frame& frame, rt::Time at) noexcept {
  if (frame.remote || frame.fd || observer_ == nullptr) return;
  if (const auto time = TimeOfDay::decode(frame.bytes())) observer_->time_of_day(*time, at);
}

od::AbortCode TimeStamp::writing(const od::Values&, ObjectRef, std::span<const std::uint8_t> value) noexcept {
  if (value.size() != 4) return od::AbortCode::none;
  const CobId before(values_->get_or<std::uint32_t>(time_object, 0));
  const CobId after(load_le<std::uint32_t>(value.data()));
  const bool in_use = (before.raw() & (CobId::invalid_bit | CobId::second_bit)) != 0;
  if (in_use && !before.same_identifier(after)) return od::AbortCode::invalid_value;
  return after.allowed() ? od::AbortCode::none : od::AbortCode::invalid_value;
}

void TimeStamp::written(od::Values&, ObjectRef) noexcept {
  if (running_) apply();
}

}  // namespace berth::co
