// The objects of a device that do something.
#include <algorithm>

#include "berth/base/bytes.hpp"
#include "berth/device/device.hpp"

namespace berth::device {
namespace {

// The identifier may change only while the object is not valid before or after; bit 30 is reserved (CiA 301 §7.5.2.17).
od::AbortCode writing_emcy_id(const od::Values& values, std::uint32_t value) noexcept {
  const co::CobId now(values.get_or<std::uint32_t>({0x1014, 0}, co::CobId::invalid_bit));
  const co::CobId next(value);
  if (!next.well_formed_emcy()) return od::AbortCode::invalid_value;
  if (!next.valid()) return od::AbortCode::none;
  if (now.valid() && now.key() != next.key()) return od::AbortCode::invalid_value;
  if (!next.extended() && co::restricted(next.id())) return od::AbortCode::invalid_value;
  return od::AbortCode::none;
}

}  // namespace

rt::Duration Device::milliseconds(std::uint16_t index) const noexcept {
  return timing_.in_world(std::chrono::milliseconds(values_.get_or<std::uint16_t>({index, 0}, 0)));
}

od::AbortCode Device::reading(const od::Values&, ObjectRef ref, std::span<const std::uint8_t>& value) noexcept {
  if (ref.index == 0x1003) {
    const auto most = values_.description().find(0x1003)->count - 1;
    const auto count = std::min<int>(errors_->count(), most);
    if (ref.sub == 0) {
      scratch_[0] = static_cast<std::uint8_t>(count);
      value = std::span(scratch_).first(1);
    } else if (ref.sub > count) {
      return od::AbortCode::no_data;
    } else {
      store_le<std::uint32_t>(scratch_.data(), errors_->at(ref.sub));
      value = scratch_;
    }
  } else if ((ref.index == 0x1010 || ref.index == 0x1011) && ref.sub != 0 && value.size() == scratch_.size()) {
    scratch_ = {};  // bit 0: on command; bit 1: by itself. Whatever the description says
    scratch_[0] = parameters_ ? 1 : 0;
    value = scratch_;
  } else if (ref.index == 0x1021 && !eds_.empty()) {
    value = eds_;
  }
  return od::AbortCode::none;
}

od::AbortCode Device::writing(const od::Values&, ObjectRef ref, std::span<const std::uint8_t> value) noexcept {
  switch (ref.index) {
    case 0x1003:
      if (ref.sub != 0 || std::ranges::any_of(value, [](auto byte) { return byte != 0; })) {
        return od::AbortCode::invalid_value;
      }
      errors_->clear();
      return od::AbortCode::none;
    case 0x1010:
    case 0x1011: return writing_storage(ref, value);
    case 0x1014:
      return value.size() == 4 ? writing_emcy_id(values_, load_le<std::uint32_t>(value.data())) : od::AbortCode::none;
    case 0x1016:
      if (ref.sub == 0 || value.size() != 4) return od::AbortCode::none;
      return consumer_->set_entry(ref.sub, load_le<std::uint32_t>(value.data()));
    default: return options_.node_id_object ? writing_node_id(ref, value) : od::AbortCode::none;
  }
}

void Device::written(od::Values&, ObjectRef ref) noexcept {
  apply_object(ref.index);
  const bool sdo_channel = ref.index >= 0x1201 && ref.index <= 0x127F;
  if (sdo_channel || ref.index == 0x1005 || ref.index == 0x1012 || ref.index == 0x1014) listen();
  if (ref.index == 0x1016) forget_heartbeat_errors();
}

void Device::apply_object(std::uint16_t index) noexcept {
  switch (index) {
    case 0x1014:
      emcy_.set_cob_id(co::CobId(values_.get_or<std::uint32_t>(
          {0x1014, 0}, nmt_.node_id().configured() ? co::emcy_id(nmt_.node_id()) : co::CobId::invalid_bit)));
      return;
    case 0x1015:
      emcy_.set_inhibit(timing_.in_world(std::chrono::microseconds(100) *
                                         values_.get_or<std::uint16_t>({0x1015, 0}, std::uint16_t{0})));
      return;
    case 0x1017:
      producer_.set_period(milliseconds(0x1017));
      guarding_.set_heartbeat_active(producer_.period() > rt::Duration::zero());
      return;
    case 0x100C:
    case 0x100D:
      guarding_.set_life_time(milliseconds(0x100C), values_.get_or<std::uint8_t>({0x100D, 0}, std::uint8_t{0}));
      return;
    default: return;
  }
}

void Device::apply_consumer_entries() noexcept {
  const auto* object = consumer_ ? values_.description().find(0x1016) : nullptr;
  if (object == nullptr) return;
  for (const auto& sub : values_.description().subs(*object)) {
    if (sub.sub == 0) continue;
    const auto value = values_.get_or<std::uint32_t>({0x1016, sub.sub}, 0);
    if (value != 0) (void)consumer_->set_entry(sub.sub, value);
  }
}

}  // namespace berth::device
