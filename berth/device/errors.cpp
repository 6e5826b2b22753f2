#include "berth/device/errors.hpp"

#include <algorithm>

#include "berth/base/bytes.hpp"

namespace berth::device {
namespace {

constexpr ObjectRef error_register_object{0x1001, 0};
constexpr std::uint16_t field_object = 0x1003;
constexpr std::uint16_t cob_id_object = 0x1014;
constexpr std::uint16_t inhibit_object = 0x1015;

// The identifier must not change if the object is valid before and after; bit 30 is reserved (CiA 301 §7.5.2.17).
od::AbortCode writing_emcy_id(const od::Values& values, std::uint32_t value) noexcept {
  const co::CobId now(values.get_or<std::uint32_t>({cob_id_object, 0}, co::CobId::invalid_bit));
  const co::CobId next(value);
  if (!next.well_formed_emcy()) return od::AbortCode::invalid_value;
  if (!next.valid()) return od::AbortCode::none;
  if (now.valid() && now.key() != next.key()) return od::AbortCode::invalid_value;
  if (!next.extended() && co::restricted(next.id())) return od::AbortCode::invalid_value;
  return od::AbortCode::none;
}

}  // namespace

Errors::Errors(can::Dispatcher& dispatcher, od::Values& values, co::NmtSlave& nmt, const Host& host, Owner& owner)
    : values_(&values), nmt_(&nmt), host_(&host), owner_(&owner), emcy_(dispatcher) {
  if (values.description().find(field_object) != nullptr) field_ = std::make_unique<co::ErrorField>();
  for (const auto index : {field_object, cob_id_object, inhibit_object}) {
    if (values.description().find(index) != nullptr) values.attach(*this, index);
  }
}

bool Errors::raise(std::uint16_t code, std::uint8_t register_bits, const Info& info, std::uint8_t source) noexcept {
  if (!emcy_.raise(code, register_bits, info, source)) return false;
  if (field_) field_->push({code, emcy_.error_register(), info});
  show();
  return true;
}

bool Errors::clear(std::uint16_t code, const Info& info, std::uint8_t source) noexcept {
  if (!emcy_.clear(code, info, source)) return false;
  show();
  return true;
}

void Errors::show() noexcept {
  values_->set(error_register_object, emcy_.error_register());
  owner_->value_changed(error_register_object);
}

void Errors::behave(std::uint8_t error_class) noexcept {
  if (error_class == 0) return;  // 1029h:00 is a count
  nmt_->apply_error_behaviour(values_->get_or<std::uint8_t>({0x1029, error_class}, 0));
}

void Errors::start() noexcept {
  const auto id = nmt_->node_id();
  emcy_.set_cob_id(co::CobId(
      values_->get_or<std::uint32_t>({cob_id_object, 0}, id.configured() ? co::emcy_id(id) : co::CobId::invalid_bit)));
  emcy_.set_inhibit(host_->in_world(std::chrono::microseconds(100) *
                                    values_->get_or<std::uint16_t>({inhibit_object, 0}, std::uint16_t{0})));
}

od::AbortCode Errors::reading(const od::Values& values, ObjectRef ref, std::span<const std::uint8_t>& value) noexcept {
  if (ref.index != field_object) return od::AbortCode::none;
  const auto most = values.description().find(field_object)->count - 1;
  const auto count = std::min<int>(field_->count(), most);
  if (ref.sub > count) return od::AbortCode::no_data;
  if (ref.sub == 0) {
    shown_[0] = static_cast<std::uint8_t>(count);
    value = std::span(shown_).first(1);
  } else {
    store_le<std::uint32_t>(shown_.data(), field_->at(ref.sub));
    value = shown_;
  }
  return od::AbortCode::none;
}

od::AbortCode Errors::writing(const od::Values& values, ObjectRef ref, std::span<const std::uint8_t> value) noexcept {
  if (ref.index == cob_id_object && value.size() == 4) {
    return writing_emcy_id(values, load_le<std::uint32_t>(value.data()));
  }
  if (ref.index != field_object) return od::AbortCode::none;
  if (ref.sub != 0 || std::ranges::any_of(value, [](auto byte) { return byte != 0; })) {
    return od::AbortCode::invalid_value;
  }
  field_->clear();
  return od::AbortCode::none;
}

void Errors::written(od::Values&, ObjectRef ref) noexcept {
  if (ref.index != field_object) start();
}

}  // namespace berth::device
