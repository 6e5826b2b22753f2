// The objects of a device that do something, and the dictionary of a device without a description file.
#include <algorithm>
#include <array>

#include "berth/base/bytes.hpp"
#include "berth/device/device.hpp"

namespace berth::device {

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
    scratch_ = {};  // "stores nothing", whatever the description says
    value = scratch_;
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
    case 0x1011: return od::AbortCode::not_stored;
    case 0x1014: return value.size() == 4 ? writing_emcy_id(load_le<std::uint32_t>(value.data())) : od::AbortCode::none;
    case 0x1016:
      if (ref.sub == 0 || value.size() != 4) return od::AbortCode::none;
      return consumer_->set_entry(ref.sub, load_le<std::uint32_t>(value.data()));
    default: return od::AbortCode::none;
  }
}

// The identifier may change only while the object is not valid before or after (CiA 301 §7.5.2.17).
od::AbortCode Device::writing_emcy_id(std::uint32_t value) const noexcept {
  const co::CobId now(values_.get_or<std::uint32_t>({0x1014, 0}, co::CobId::invalid_bit));
  const co::CobId next(value);
  if (!next.valid()) return od::AbortCode::none;
  if (now.valid() && now.key() != next.key()) return od::AbortCode::invalid_value;
  if (!next.extended() && co::restricted(next.id())) return od::AbortCode::invalid_value;
  return od::AbortCode::none;
}

void Device::written(od::Values&, ObjectRef ref) noexcept { apply_object(ref.index); }

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

const std::shared_ptr<const od::Description>& minimal_description() {
  using od::Access;
  using od::DataType;
  using od::Literal;
  static const auto description = [] {
    od::DescriptionBuilder b;
    b.variable(0x1000, {.name = "Device type", .access = Access::ro, .initial = Literal::number(0)});
    b.variable(0x1001, {.name = "Error register",
                        .type = DataType::unsigned8,
                        .access = Access::ro,
                        .mappable = true,
                        .initial = Literal::number(0)});
    b.object(0x1003, od::ObjectCode::array, "Pre-defined error field");
    b.sub(0x1003, {.sub = 0, .name = "Number of errors", .type = DataType::unsigned8, .initial = Literal::number(0)});
    for (std::uint8_t i = 1; i <= 8; ++i)
      b.sub(0x1003, {.sub = i, .name = "Standard error field", .access = Access::ro});
    b.variable(0x1008, {.name = "Manufacturer device name",
                        .type = DataType::visible_string,
                        .access = Access::constant,
                        .initial = Literal::text("Berth simulated device"),
                        .capacity = 64});
    b.variable(0x100C, {.name = "Guard time", .type = DataType::unsigned16, .initial = Literal::number(0)});
    b.variable(0x100D, {.name = "Life time factor", .type = DataType::unsigned8, .initial = Literal::number(0)});
    b.variable(0x1014, {.name = "COB-ID EMCY", .initial = Literal::node_id_plus(0x80)});
    b.variable(0x1015, {.name = "Inhibit time EMCY", .type = DataType::unsigned16, .initial = Literal::number(0)});
    b.object(0x1016, od::ObjectCode::array, "Consumer heartbeat time");
    for (std::uint8_t i = 1; i <= 8; ++i) {
      b.sub(0x1016, {.sub = i, .name = "Consumer heartbeat time", .initial = Literal::number(0)});
    }
    b.variable(0x1017,
               {.name = "Producer heartbeat time", .type = DataType::unsigned16, .initial = Literal::number(0)});
    b.object(0x1018, od::ObjectCode::record, "Identity object", DataType::identity);
    const std::array<std::string_view, 4> parts{"Vendor-ID", "Product code", "Revision number", "Serial number"};
    for (std::uint8_t i = 1; i <= 4; ++i) {
      b.sub(0x1018, {.sub = i, .name = parts[i - 1U], .access = Access::ro, .initial = Literal::number(0)});
    }
    b.object(0x1029, od::ObjectCode::array, "Error behaviour");
    b.sub(0x1029,
          {.sub = 1, .name = "Communication error", .type = DataType::unsigned8, .initial = Literal::number(0)});
    b.object(0x1200, od::ObjectCode::record, "SDO server parameter", DataType::sdo_parameter);
    b.sub(0x1200,
          {.sub = 1, .name = "COB-ID client to server", .access = Access::ro, .initial = Literal::node_id_plus(0x600)});
    b.sub(0x1200,
          {.sub = 2, .name = "COB-ID server to client", .access = Access::ro, .initial = Literal::node_id_plus(0x580)});
    return b.build();
  }();
  return description;
}

}  // namespace berth::device
