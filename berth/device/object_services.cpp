#include "berth/device/object_services.hpp"

namespace berth::device {

void ObjectServices::change(const co::Services& was, const co::Services& now, NodeId id) noexcept {
  if (pdos && !now.pdo) pdos->stop();
  const bool begins = now.sync_time && !was.sync_time;
  if (sync && begins) sync->start();
  if (time && begins) time->start();
  if (emcy_list && now.emcy && !was.emcy) emcy_list->start();
  if (pdos && now.pdo && !was.pdo) pdos->start(id);
  if (now.sync_time) return;
  if (sync) sync->stop();
  if (time) time->stop();
  if (emcy_list) emcy_list->stop();
}

std::size_t ObjectServices::memory() const noexcept {
  return (pdos ? pdos->memory() : 0) + (sync ? sizeof(co::Sync) : 0) + (time ? sizeof(co::TimeStamp) : 0) +
         (emcy_list ? sizeof(co::EmcyList) : 0);
}

}  // namespace berth::device
