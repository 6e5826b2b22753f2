/// A slot's device as the boot-up of CiA 302-2 accesses it (network/boot_slave.hpp): under the slot's node-ID, on the
/// bus of the main job.
#pragma once

#include "berth/network/boot_slave.hpp"
#include "berth/operate/slot_table.hpp"

namespace berth::operate {

class SeatTarget : public network::BootTarget {
 public:
  SeatTarget(BusServices& services, Seat& seat) noexcept
      : s_(services), seat_(seat), objects_(services.sdo, seat.id()) {}

  [[nodiscard]] co::SdoAccess& objects() noexcept override { return objects_; }
  rt::Task<Result<rt::Time>> command(co::NmtCommand command) override;
  rt::Task<bool> boots(rt::Time since, rt::Time deadline) override;
  rt::Task<std::optional<NmtState>> heartbeat(rt::Duration within) override;
  rt::Task<std::optional<NmtState>> guard() override;
  /// By `heartbeat_timeout`; a device without a heartbeat is asked by guarding after its start.
  void supervise(const manager::SlaveRules& rules) override;

 private:
  BusServices& s_;
  Seat& seat_;
  co::NodeAccess objects_;
};

}  // namespace berth::operate
