/// Boots the devices that are in their slots, by the procedure of CiA 302-2 (network/boot_slave.hpp): configuration,
/// error control, start. `Presence` has verified before that it is the slot's device.
#pragma once

#include <memory>
#include <vector>

#include "berth/network/boot_slave.hpp"
#include "berth/operate/error_control.hpp"
#include "berth/operate/programming.hpp"
#include "berth/operate/slot_startup.hpp"
#include "berth/operate/spares.hpp"

namespace berth::operate {

class Starter final : public EarlyStarter, private network::SlaveBoots::Owner {
 public:
  Starter(BusServices& services, SlotTable& slots, Agenda& agenda, SlotStartup& startup, Asking& asking,
          Configuring& configuring, Spares& spares, Presence& presence);
  ~Starter();

  /// A device is in its slot and was not started, or waited and may be started now.
  [[nodiscard]] bool is_due() const noexcept;
  /// Boots all that are due, side by side. Returns when each started device has reported operational or its time is
  /// over. True: the network is operational, with Berth as its master.
  rt::Task<bool> check_and_start();
  rt::Task<void> start_early(Seat& seat) override;

 private:
  class Target;
  class Source;
  bool starts(const network::Slave& slave) noexcept override;
  void ended(network::Slave& slave) noexcept override;
  void started(network::Slave& slave, const Result<bool>& ran) noexcept override;
  rt::Task<void> boot(Seat& seat);
  rt::Task<bool> may_boot(Seat& seat);
  rt::Task<bool> takes_running(Seat& seat);
  rt::Task<Result<void>> update(Seat& seat, network::BootTarget& target);
  [[nodiscard]] bool boot_failed(Seat& seat, const network::BootResult& result);
  rt::Task<Result<void>> configure(Seat& seat);
  rt::Task<Result<void>> bring_up_beneath(Seat& seat);
  rt::Task<bool> runs_already(Seat& seat);
  rt::Task<void> start_waiting();
  rt::Task<void> start_all();
  rt::Task<void> await_operational();
  rt::Task<void> start_again(rt::Time since);
  rt::Task<std::string> stopped_program(NodeId id);
  [[nodiscard]] bool beats(const Seat& seat) const noexcept;
  [[nodiscard]] Seat& seat_of(const network::Slave& slave) const noexcept { return *slots_.at(slave.what.node); }

  BusServices& s_;
  SlotTable& slots_;
  Agenda& agenda_;
  SlotStartup& startup_;
  Asking& asking_;
  Configuring& configuring_;
  Spares& spares_;
  Presence& presence_;
  ErrorControl control_;
  Programming programming_;
  network::SlaveBoots boots_;
  std::vector<std::unique_ptr<network::BootTarget>> targets_;
  std::vector<std::unique_ptr<network::BootSource>> sources_;
  std::vector<Seat*> awaited_;  // NMT start was sent, and their heartbeats did not report operational yet
};

}  // namespace berth::operate
