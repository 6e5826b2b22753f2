#include "berth/plant/odd_answers.hpp"

#include "berth/base/bytes.hpp"

namespace berth::plant {
namespace {

constexpr std::uint16_t identity_object = 0x1018;
constexpr ObjectRef heartbeat_time{0x1017, 0};
constexpr rt::Duration until_reset = std::chrono::milliseconds(50);  // the answer to the write is sent by then

}  // namespace

OddAnswers::OddAnswers(const PlantOddities& plan, device::Device& device, rt::Executor& executor)
    : plan_(plan), device_(&device), executor_(&executor) {
  const bool tells = plan.changing != 0 || plan.sdo_serial || plan.identity_only_pre_operational;
  if (tells) device.values().attach(*this, identity_object);
  if (plan.resets == ResetsAtHeartbeat::never) return;
  device.values().attach(*this, heartbeat_time.index);
  if (plan.resets != ResetsAtHeartbeat::keeps) return;
  device.on().parameters = [this] {
    if (kept_) device_->values().set(heartbeat_time, *kept_);
  };
}

od::AbortCode OddAnswers::reading(const od::Values&, ObjectRef ref, std::span<const std::uint8_t>& value) noexcept {
  if (ref.index != identity_object) return od::AbortCode::none;
  const bool refuses = plan_.identity_only_pre_operational && device_->state() != NmtState::pre_operational;
  if (refuses) return od::AbortCode::device_state;
  if (ref.sub < 1 || ref.sub > 4 || value.size() != shown_.size()) return od::AbortCode::none;
  const unsigned part = ref.sub - 1U;
  std::uint32_t shown = load_le<std::uint32_t>(value.data());
  if (part == 3 && plan_.sdo_serial) shown = *plan_.sdo_serial;
  if ((plan_.changing >> part & 1U) != 0) shown += readings_.at(part)++;
  store_le(shown_.data(), shown);
  value = shown_;
  return od::AbortCode::none;
}

od::AbortCode OddAnswers::writing(const od::Values&, ObjectRef ref, std::span<const std::uint8_t>) noexcept {
  const bool silent = ref == heartbeat_time && plan_.resets == ResetsAtHeartbeat::silent;
  if (!silent) return od::AbortCode::none;
  executor_->after({}, *this);
  return od::AbortCode::pending;  // its reset comes before an answer
}

void OddAnswers::written(od::Values& values, ObjectRef ref) noexcept {
  if (ref != heartbeat_time) return;
  if (plan_.resets == ResetsAtHeartbeat::keeps) kept_ = values.get_or<std::uint16_t>(heartbeat_time, 0);
  executor_->after(until_reset, *this);
}

void OddAnswers::run() noexcept {
  if (device_->powered() && !device_->booting()) device_->apply(co::NmtCommand::reset_node);
}

}  // namespace berth::plant
