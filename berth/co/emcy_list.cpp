#include "berth/co/emcy_list.hpp"

#include "berth/base/bytes.hpp"

namespace berth::co {

namespace {
constexpr std::uint16_t list_object = 0x1028;
}

EmcyList::EmcyList(can::Dispatcher& dispatcher, od::Values& values, EmcyConsumer::Observer& observer)
    : values_(&values), consumer_(dispatcher, observer) {
  const auto* const object = values.description().find(list_object);
  if (object == nullptr) return;
  consumer_.reserve(object->count);
  values.attach(*this, list_object);
}

void EmcyList::start() noexcept {
  running_ = true;
  apply();
}

void EmcyList::stop() noexcept {
  running_ = false;
  consumer_.clear();
}

void EmcyList::apply() noexcept {
  consumer_.clear();
  const auto* const object = values_->description().find(list_object);
  if (object == nullptr) return;
  for (const od::SubObject& sub : values_->description().subs(*object)) {
    if (sub.sub < 1 || sub.sub > 127) continue;
    const CobId id(values_->get_or<std::uint32_t>({list_object, sub.sub}, CobId::invalid_bit));
    if (id.allowed()) consumer_.hear(NodeId(sub.sub), id);
  }
}

od::AbortCode EmcyList::writing(const od::Values&, ObjectRef ref, std::span<const std::uint8_t> value) noexcept {
  if (ref.sub == 0 || value.size() != 4) return od::AbortCode::none;
  const CobId before(values_->get_or<std::uint32_t>(ref, CobId::invalid_bit));
  const CobId after(load_le<std::uint32_t>(value.data()));
  if (!after.well_formed_emcy()) return od::AbortCode::invalid_value;
  if (!after.valid()) return od::AbortCode::none;
  const bool fine = before.valid() ? before.same_identifier(after) : after.allowed();
  return fine ? od::AbortCode::none : od::AbortCode::invalid_value;
}

void EmcyList::written(od::Values&, ObjectRef) noexcept {
  if (running_) apply();
}

}  // namespace berth::co
