// Objects 1010h, 1011h and 1020h: what is stored, and whether the configuration is still the verified one.
#include <algorithm>

#include "berth/base/bytes.hpp"
#include "berth/device/device.hpp"

namespace berth::device {

namespace {
constexpr std::uint32_t save_signature = 0x6576'6173;  // "save"
constexpr std::uint32_t load_signature = 0x6461'6F6C;  // "load"
}  // namespace

od::AbortCode Device::writing_storage(ObjectRef ref, std::span<const std::uint8_t> value) noexcept {
  const bool saves = ref.index == 0x1010;
  const auto signature = value.size() == 4 ? load_le<std::uint32_t>(value.data()) : 0;
  if (ref.sub == 0 || !parameters_ || signature != (saves ? save_signature : load_signature)) {
    return od::AbortCode::not_stored;
  }
  if (storing()) return od::AbortCode::device_state;
  const bool begun = saves ? parameters_->save(values_, ref.sub) : parameters_->restore(values_, ref.sub);
  if (!begun) return od::AbortCode::hardware;
  storing_ = ref;
  host_.storing(true);
  return od::AbortCode::pending;
}

void Device::parameters_written(bool ok) noexcept {
  host_.storing(false);
  // Without an answer when the client gave up or a state without SDO came in between.
  sdo_.complete(storing_, ok ? od::AbortCode::none : od::AbortCode::hardware);
}

od::AbortCode Device::ConfigurationWatch::writing(const od::Values& values, ObjectRef ref,
                                                  std::span<const std::uint8_t> value) noexcept {
  changes_ = !std::ranges::equal(values.bytes(ref), value);
  return od::AbortCode::none;
}

void Device::ConfigurationWatch::written(od::Values& values, ObjectRef ref) noexcept {
  if (!changes_ || ref.index == 0x1020) return;
  const auto& description = values.description();
  const auto* const object = description.find(ref.index);
  const auto* const sub = object == nullptr ? nullptr : description.find(*object, ref.sub);
  if (sub == nullptr) return;
  if (device_->options_.parameter_group(description, *object, *sub) == parameter_group::none) return;
  values.set({0x1020, 1}, 0U);
  values.set({0x1020, 2}, 0U);
}

}  // namespace berth::device
