/// How the device of a slot is watched (CiA 301 §7.2.8.3.2): by its heartbeat at the period that is wanted, at the
/// nearest one that it takes, or at its own when that cannot be changed; one without a heartbeat by guarding, and by
/// SDO when it knows no guarding either. What a slot says of it (`places::SlotWatch`) comes first.
#pragma once

#include "berth/operate/slot_table.hpp"

namespace berth::operate {

/// What 1017h is to be: what the device takes, else what the slot wants, else the bus's.
[[nodiscard]] rt::Duration heartbeat_time(const design::Timing& timing, const Seat& seat) noexcept;
/// How often its heartbeat comes: as it was seen, else as 1017h has it. And when it is missed: what the slot wants,
/// else in the same proportion as the bus's.
[[nodiscard]] rt::Duration heartbeat_period(const design::Timing& timing, const Seat& seat) noexcept;
[[nodiscard]] rt::Duration heartbeat_timeout(const design::Timing& timing, const Seat& seat) noexcept;

class ErrorControl {
 public:
  ErrorControl(BusServices& services, SlotTable& slots) noexcept : s_(services), slots_(slots) {}

  /// Writes 1017h, or what guarding needs, and says what the device has instead when it refuses. False: it is not there
  /// any more.
  rt::Task<bool> set(Seat& seat);
  /// Beside `config =`, whose values are written together. True: 1017h is one of them. Errors: it did not answer.
  rt::Task<Result<bool>> look(Seat& seat);
  /// It did not take that 1017h. `held`: what it has instead, little-endian; empty: it is asked. False: it is not there
  /// any more.
  rt::Task<bool> learn(Seat& seat, std::vector<std::uint8_t> held);
  /// It runs already: it is watched, by its heartbeat at the period that it has when that was missed.
  rt::Task<void> watch_running(Seat& seat);
  /// It was started, and sends no heartbeat: what can be known of it, and it is watched by guarding or SDO.
  rt::Task<void> ask_started(Seat& seat);
  /// It was started, and the heartbeat that 1017h promises did not come in time (letter K): it is watched by SDO until
  /// one does. A device that accepted the period and keeps 0 has no heartbeat: `ask_started`. False: it does not answer
  /// SDO either, or it has booted unheard.
  rt::Task<bool> watch_unheard(Seat& seat);
  /// Why it is letter K then.
  [[nodiscard]] std::string text_of_unheard(const Seat& seat) const;
  /// Its heartbeats come so often (`places::BootWatch::steady`): it is watched by that, and told once.
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
