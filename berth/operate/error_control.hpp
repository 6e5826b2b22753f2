/// How the device of a slot is watched (CiA 301 §7.2.8.3.2): by its heartbeat at the bus's period, at the nearest one
/// that it takes, or at its own when that cannot be changed; one without a heartbeat is asked by guarding when it is
/// started, and by SDO when it knows no guarding either.
#pragma once

#include "berth/operate/slot_table.hpp"

namespace berth::operate {

/// How often its heartbeat comes, and when it is missed: in the same proportion as the bus's.
[[nodiscard]] rt::Duration heartbeat_period(const design::Timing& timing, const Seat& seat) noexcept;
[[nodiscard]] rt::Duration heartbeat_timeout(const design::Timing& timing, const Seat& seat) noexcept;

class ErrorControl {
 public:
  ErrorControl(BusServices& services, SlotTable& slots) noexcept : s_(services), slots_(slots) {}

  /// Writes 1017h, and says what the device has instead when it refuses. False: it is not there any more.
  rt::Task<bool> set(Seat& seat);
  /// At which period a device beats that runs already, and whose heartbeat was missed.
  rt::Task<void> learn(Seat& seat);
  /// It was started, and has no heartbeat: what can be known of it.
  rt::Task<void> ask_started(Seat& seat);

 private:
  rt::Task<Result<void>> write(NodeId id, std::uint16_t period_ms);
  rt::Task<std::uint16_t> nearest(NodeId id, std::uint16_t refused_ms, std::uint32_t abort_code);
  void tell(Seat& seat, const std::string& instead);

  BusServices& s_;
  SlotTable& slots_;
};

}  // namespace berth::operate
