#include "berth/device/application.hpp"

#include <utility>

#include "berth/base/bytes.hpp"
#include "berth/co/pdo_mapping.hpp"
#include "berth/od/pdo_objects.hpp"

namespace berth::device {

void WriteWatch::add(od::Values& values, ObjectRef ref, std::function<void()> call) {
  // Attached once per index: a hook that is attached twice is called twice.
  const auto first = calls_.lower_bound({ref.index, 0});
  const bool known = first != calls_.end() && first->first.index == ref.index;
  calls_.emplace(ref, std::move(call));
  if (!known) values.attach(*this, ref.index);
}

// A callback may add others meanwhile.
WriteWatch::Calls::const_iterator WriteWatch::call_from(Calls::const_iterator at, ObjectRef ref) const noexcept {
  for (; at != calls_.end() && at->first == ref; ++at) at->second();
  return at;
}

void WriteWatch::one(ObjectRef ref) const noexcept { call_from(calls_.lower_bound(ref), ref); }

void WriteWatch::written(od::Values&, ObjectRef ref) noexcept { one(ref); }

// Objects that are neighbours in an RPDO are mostly neighbours in the dictionary.
void WriteWatch::mapped(const od::Values& values, std::uint16_t mapping) const noexcept {
  const auto& description = values.description();
  const auto* const object = description.find(mapping);
  if (object == nullptr) return;
  const auto count = values.get_or<std::uint8_t>({mapping, 0}, 0);
  auto next = calls_.end();
  for (const auto& sub : description.subs(*object)) {
    if (sub.sub == 0) continue;
    if (sub.sub > count || sub.sub > co::PdoMapping::most_entries) break;
    const auto raw = values.scalar(sub);
    if (raw.size() != sizeof(std::uint32_t)) continue;
    const ObjectRef ref = co::PdoEntry::of(load_le<std::uint32_t>(raw.data())).object;
    const bool follows = next != calls_.end() && next->first == ref;
    next = call_from(follows ? next : calls_.lower_bound(ref), ref);
  }
}

Callbacks& Application::on() {
  if (!callbacks_) callbacks_ = std::make_unique<Callbacks>();
  return *callbacks_;
}

void Application::on_write(ObjectRef ref, std::function<void()> call) {
  if (!writes_) writes_ = std::make_unique<WriteWatch>();
  writes_->add(*values_, ref, std::move(call));
}

void Application::received(unsigned rpdo, rt::Time) noexcept {
  if (writes_) writes_->mapped(*values_, od::mapping_index(od::PdoKind::rpdo, rpdo));
  tell(&Callbacks::rpdo, rpdo);
}

void Application::received_mpdo(ObjectRef object, rt::Time) noexcept {
  if (writes_) writes_->one(object);
}

std::size_t Application::memory() const noexcept {
  return (callbacks_ ? sizeof(Callbacks) : 0) + (writes_ ? sizeof(WriteWatch) + writes_->memory() : 0);
}

}  // namespace berth::device
