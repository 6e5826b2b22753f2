// The objects of a device that do something.
#include <algorithm>

#include "berth/base/bytes.hpp"
#include "berth/device/device.hpp"

namespace berth::device {
od::AbortCode Device::reading(const od::Values&, ObjectRef ref, std::span<const std::uint8_t>& value) noexcept {
  if ((ref.index == 0x1010 || ref.index == 0x1011) && ref.sub != 0 && value.size() == scratch_.size()) {
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
    case 0x1010:
    case 0x1011: return writing_storage(ref, value);
    default: return options_.node_id_object ? writing_node_id(ref, value) : od::AbortCode::none;
  }
}

}  // namespace berth::device
