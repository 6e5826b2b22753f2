#include "berth/device/object_services.hpp"
#include "berth/od/pdo_objects.hpp"

#include <algorithm>

namespace berth::device {
namespace {

// An object that is longer needs an `od::Stream`.
constexpr std::size_t longest_buffer = 65536;

// A download must fit into the server's buffer: it is as long as the longest object that can be written.
std::size_t sdo_buffer(const od::Description& description) noexcept {
  std::size_t longest = 32;
  for (const auto& sub : description.subs()) {
    if (od::writable(sub.access)) longest = std::max<std::size_t>(longest, sub.capacity);
  }
  return std::min(longest, longest_buffer);
}

bool has_any(const od::Description& description, std::uint16_t first, std::uint16_t last) noexcept {
  const auto it = std::ranges::lower_bound(description.objects(), first, {}, &od::Object::index);
  return it != description.objects().end() && it->index <= last;
}

}  // namespace

ObjectServices::ObjectServices(can::Dispatcher& dispatcher, od::Values& values, Application& application,
                               co::ServiceOwner& owner, const co::Pdos::Options& pdos)
    : sdo_(dispatcher, values, sdo_buffer(values.description())) {
  const auto& d = values.description();
  if (has_any(d, od::first_pdo_record, od::last_pdo_record)) {
    pdos_ = std::make_unique<co::Pdos>(dispatcher, values, owner, pdos);
    pdos_->observe(&application);
  }
  if (d.find(0x1005) != nullptr) {
    sync_ = std::make_unique<co::Sync>(dispatcher, values, owner, pdos_.get());
    sync_->observe(&application);
  }
  if (d.find(0x1012) != nullptr) {
    time_ = std::make_unique<co::TimeStamp>(dispatcher, values);
    time_->observe(&application);
  }
  if (d.find(0x1028) != nullptr) emcy_list_ = std::make_unique<co::EmcyList>(dispatcher, values, application);
}

void ObjectServices::change(const co::Services& was, const co::Services& now, NodeId id) noexcept {
  if (now.sdo && !was.sdo) sdo_.start(id);
  if (!now.sdo) sdo_.stop();
  if (pdos_ && !now.pdo) pdos_->stop();
  const bool begins = now.sync_time && !was.sync_time;
  if (sync_ && begins) sync_->start();
  if (time_ && begins) time_->start();
  if (emcy_list_ && now.emcy && !was.emcy) emcy_list_->start();
  if (pdos_ && now.pdo && !was.pdo) pdos_->start(id);
  if (now.sync_time) return;
  if (sync_) sync_->stop();
  if (time_) time_->stop();
  if (emcy_list_) emcy_list_->stop();
}

std::size_t ObjectServices::memory() const noexcept {
  return sdo_.memory() + (pdos_ ? pdos_->memory() : 0) + (sync_ ? sizeof(co::Sync) : 0) +
         (time_ ? sizeof(co::TimeStamp) : 0) + (emcy_list_ ? sizeof(co::EmcyList) : 0);
}

}  // namespace berth::device
