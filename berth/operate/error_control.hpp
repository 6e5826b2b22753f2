/// How the device of a slot is watched (CiA 301 §7.2.8.3.2): by its heartbeat at the wanted period, at the nearest
/// period it accepts, or at its own if that cannot be changed; without a heartbeat by guarding; without either by SDO.
/// The slot's setting (`places::SlotWatch`) takes precedence.
#pragma once

#include "berth/operate/slot_table.hpp"

namespace berth::operate {

/// The value for 1017h: what the device accepts, else what the slot wants, else the bus's.
[[nodiscard]] rt::Duration heartbeat_time(const design::Timing& timing, const Seat& seat) noexcept;
/// The period of its heartbeat: as observed, else as set in 1017h. The timeout: what the slot wants, else in the same
/// proportion as the bus's.
[[nodiscard]] rt::Duration heartbeat_period(const design::Timing& timing, const Seat& seat) noexcept;
[[nodiscard]] rt::Duration heartbeat_timeout(const design::Timing& timing, const Seat& seat) noexcept;

class ErrorControl {
 public:
  ErrorControl(BusServices& services, SlotTable& slots) noexcept : s_(services), slots_(slots) {}

  /// Writes 1017h, or what guarding needs. If the device refuses, it reports what the device has instead. False: the
  /// device is no longer there.
  rt::Task<bool> set(Seat& seat);
  /// For use beside `config =`, whose values are written together. True: 1017h is one of them. Errors: the device did
  /// not answer.
  rt::Task<Result<bool>> look(Seat& seat);
  /// The device did not accept that 1017h. `held`: its own value, little-endian; empty: it is read. False: the device
  /// is no longer there.
  rt::Task<bool> learn(Seat& seat, std::vector<std::uint8_t> held);
  /// For a device that already runs: watches it, by its heartbeat at the device's own period if that was missed.
  rt::Task<void> watch_running(Seat& seat);
  /// For a device that was started and sends no heartbeat: finds out what it supports, and watches it by guarding or
  /// SDO.
  rt::Task<void> ask_started(Seat& seat);
  /// For a device that was started and whose heartbeat, promised by 1017h, did not come in time (letter K): it is
  /// watched by SDO until one comes. A device that accepted the period and keeps 0 has no heartbeat: `ask_started`.
  /// False: it does not answer SDO either, or it booted unheard.
  rt::Task<bool> watch_unheard(Seat& seat);
  /// The reason shown for letter K then.
  [[nodiscard]] std::string text_of_unheard(const Seat& seat) const;
  /// Its heartbeats come at this steady period (`places::BootWatch::steady`): it is watched by that, and this is
  /// reported once.
  void take_period(Seat& seat, rt::Duration steady);

 private:
  void note_reset(Seat& seat) const;
  void note_write(Seat& seat) const;
  enum class Keeps : std::uint8_t { all, again, none };
  rt::Task<Keeps> look_at_what_it_keeps(Seat& seat);
  rt::Task<bool> leave_as_it_is(Seat& seat, std::uint16_t wanted);
  rt::Task<Result<void>> write(NodeId id, std::uint16_t period_ms);
  rt::Task<std::uint16_t> nearest(NodeId id, std::uint16_t refused_ms, std::uint32_t abort_code);
  rt::Task<bool> set_heartbeat(Seat& seat);
  rt::Task<bool> set_guarding(Seat& seat);
  static void begin_anew(Seat& seat);
  void guard(Seat& seat);
  void tell(Seat& seat, const std::string& instead);

  BusServices& s_;
  SlotTable& slots_;
};

}  // namespace berth::operate
