/// The services of CiA 301 that depend on the dictionary: the SDO servers, and PDO, SYNC, TIME and the emergency
/// consumer if it has their objects. They run in the NMT states that allow them (`co::Services`), report what they
/// receive to the application, and their errors to the device.
#pragma once

#include <cstddef>
#include <memory>

#include "berth/co/emcy_list.hpp"
#include "berth/co/nmt.hpp"
#include "berth/co/pdo.hpp"
#include "berth/co/sdo_servers.hpp"
#include "berth/co/sync.hpp"
#include "berth/co/time_stamp.hpp"
#include "berth/device/application.hpp"
#include "berth/device/errors.hpp"

namespace berth::device {

class ObjectServices final : public Errors::Owner {
 public:
  /// `pdos`: options for `co::Pdos`. All must outlive it.
  ObjectServices(can::Dispatcher& dispatcher, od::Values& values, Application& application, co::ServiceOwner& owner,
                 const co::Pdos::Options& pdos);

  /// The device, whose node-ID is `id`, enters an NMT state with the services `now`, from one with `was`.
  void change(const co::Services& was, const co::Services& now, NodeId id) noexcept;

  /// An event of TPDO 1..512 (types 00h, FEh, FFh); false when it is not active or has no events.
  bool event(unsigned tpdo) noexcept { return pdos_ && pdos_->event(tpdo); }
  /// The local side changed the object's value: an event for the TPDOs that map it. False: none does.
  bool changed(ObjectRef object) noexcept { return pdos_ && pdos_->changed(object); }
  /// Sends a TIME message; `closed`: no producer (1012h bit 30), or not in a state with TIME.
  can::Queued send_time(const co::TimeOfDay& time) noexcept { return time_ ? time_->send(time) : can::Queued::closed; }
  [[nodiscard]] co::SdoServers& sdo() noexcept { return sdo_; }
  /// Null when the dictionary has none (1400h to 1BFFh).
  [[nodiscard]] co::Pdos* pdos() noexcept { return pdos_.get(); }
  /// As a consumer of SYNC: none came for 1.5 times 1006h.
  [[nodiscard]] bool sync_missing() const noexcept { return sync_ && sync_->missing(); }

  /// Bytes held outside the object.
  [[nodiscard]] std::size_t memory() const noexcept;

 private:
  void value_changed(ObjectRef object) noexcept override { changed(object); }

  co::SdoServers sdo_;
  std::unique_ptr<co::Pdos> pdos_;           // 1400h to 1BFFh
  std::unique_ptr<co::Sync> sync_;           // 1005h
  std::unique_ptr<co::TimeStamp> time_;      // 1012h
  std::unique_ptr<co::EmcyList> emcy_list_;  // 1028h
};

}  // namespace berth::device
