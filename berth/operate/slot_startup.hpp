/// The NMT startup of one bus (CiA 302-2; docs/boot-up.md): `network::NetworkStartup` for the slots of a bus. Applies
/// `[bus.NAME.startup]` and the slots' `mandatory` to devices that are ready to be started, fail, or are lost, and
/// shows this in the slots' states and texts.
#pragma once

#include <optional>
#include <string>
#include <string_view>

#include "berth/network/network_startup.hpp"
#include "berth/operate/slot_table.hpp"

namespace berth::operate {

/// The master's own device.
class MasterState {
 public:
  virtual void apply(co::NmtCommand command) noexcept = 0;

 protected:
  ~MasterState() = default;
};

class SlotStartup final : private network::NetworkStartup::Owner {
 public:
  using Phase = network::StartupPhase::Phase;
  using Go = network::NetworkStartup::Go;

  SlotStartup(BusServices& services, SlotTable& slots) noexcept;
  /// Call it before the first `begin`. `master` must outlive this.
  void set_master(MasterState& master) noexcept { master_ = &master; }

  /// The main job begins: the boot time counts from now.
  void begin();
  /// The main job was stopped.
  void end() noexcept { network_.end(); }
  [[nodiscard]] Phase phase() const noexcept { return network_.phase(); }

  /// The seat's device is ready and may be started now, by itself.
  [[nodiscard]] bool starts(const Seat& seat) const noexcept { return network_.starts(seat.slave); }
  /// If it may not: its slot's reason says what its start waits for.
  void tell_why_waiting(Seat& seat);
  /// Checks the mandatory slots, halts the startup if one failed, and continues when all are ready. Returns what is to
  /// be started now.
  [[nodiscard]] Go goes_on();
  /// `goes_on` has work: a user released what waits.
  [[nodiscard]] bool released() const noexcept { return released_ || released_by_master_ != Go::nothing; }
  /// Every slot that is not optional is operational: the master becomes operational too, unless the application does
  /// that.
  void network_operational() noexcept;

  /// The device of this slot was ready, and was lost or booted by itself.
  void error_event(const Seat& seat, std::string_view what);
  /// Carries out the reaction to an error event of a mandatory slot.
  rt::Task<void> act_on_error();
  /// A user's command: NMT start ends a stop and starts what waits; a command to the master's own node-ID is applied to
  /// the master.
  void commanded(co::NmtCommand command, co::NmtTarget target);

 private:
  struct ErrorEvent {
    network::StartupPhase::OnError asks_for;
    std::string text;  // "slot 'x', which is mandatory: its heartbeat stopped"
  };
  [[nodiscard]] bool is_ready(const network::Slave& slave) const noexcept override;
  [[nodiscard]] bool has_failed(const network::Slave& slave) const noexcept override;
  void heard(network::NetworkStartup::News news, const network::Slave* slave) noexcept override;
  void apply(co::NmtCommand command) noexcept override;

  [[nodiscard]] std::string why_waiting() const;
  void tell_the_waiting();
  void stop_all(const std::string& why);
  void await_all(const std::string& why);
  void tell(const std::string& text);

  BusServices& s_;
  SlotTable& slots_;
  MasterState* master_ = nullptr;
  network::NetworkStartup network_;
  std::optional<ErrorEvent> error_;
  std::string halted_by_;                // name of the mandatory slot
  bool released_ = false;                // a user ended a stop
  Go released_by_master_ = Go::nothing;  // what it starts after a user made the master operational
};

}  // namespace berth::operate
