/// Check, configuration and start of the devices that are in their slots.
#pragma once

#include "berth/operate/spares.hpp"

namespace berth::operate {

class Starter final : public EarlyStarter {
 public:
  Starter(BusServices& services, SlotTable& slots, Agenda& agenda, Asking& asking, Configuring& configuring,
          Spares& spares, Presence& presence) noexcept
      : s_(services),
        slots_(slots),
        agenda_(agenda),
        asking_(asking),
        configuring_(configuring),
        spares_(spares),
        presence_(presence) {}

  /// A device is in its slot and was not started.
  [[nodiscard]] bool is_due() const noexcept;
  /// All that are due, side by side; returns when each has told that it is operational, or had its
  /// time to. True: the network is operational, and Berth its master.
  rt::Task<bool> check_and_start();
  rt::Task<void> start_early(Seat& seat) override;

 private:
  [[nodiscard]] static bool is_ready(const Seat& seat) noexcept;
  rt::Task<void> start_seat(Seat& seat);
  rt::Task<bool> set_heartbeat(Seat& seat);
  rt::Task<void> send_start(Seat& seat);
  rt::Task<void> await_operational();
  rt::Task<void> start_again();

  BusServices& s_;
  SlotTable& slots_;
  Agenda& agenda_;
  Asking& asking_;
  Configuring& configuring_;
  Spares& spares_;
  Presence& presence_;
};

}  // namespace berth::operate
