#include "berth/device/application.hpp"

#include <algorithm>

#include "berth/co/pdo_mapping.hpp"

namespace berth::device {

void WriteWatch::add(od::Values& values, ObjectRef ref, std::function<void()> call) {
  // Once per index: a hook that is attached twice is called twice.
  const bool known = std::ranges::any_of(entries_, [&](const Entry& each) { return each.ref.index == ref.index; });
  entries_.push_back({ref, std::move(call)});
  if (!known) values.attach(*this, ref.index);
}

void WriteWatch::one(ObjectRef ref) noexcept {
  // By position: a callback may add entries.
  for (std::size_t i = 0; i < entries_.size(); ++i) {
    if (entries_[i].ref == ref) entries_[i].call();
  }
}

void WriteWatch::written(od::Values&, ObjectRef ref) noexcept { one(ref); }

void WriteWatch::mapped(const od::Values& values, std::uint16_t mapping) noexcept {
  const auto count = values.get_or<std::uint8_t>({mapping, 0}, 0);
  for (std::uint8_t i = 1; i <= count && i <= co::PdoMapping::most_entries; ++i) {
    one(co::PdoEntry::of(values.get_or<std::uint32_t>({mapping, i}, 0)).object);
  }
}

}  // namespace berth::device
