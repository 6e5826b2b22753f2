/// The NMT startup of one bus (CiA 302-2; docs/boot-up.md): what `[bus.NAME.startup]` and the slots' `mandatory` make
/// of devices that are ready to be started, fail, or are lost. The rules are `manager::StartupPhase`'s; which devices
/// there are, the slot table's.
#pragma once

#include <optional>
#include <string>
#include <string_view>

#include "berth/manager/startup_phase.hpp"
#include "berth/operate/slot_table.hpp"
#include "berth/rt/later.hpp"

namespace berth::operate {

/// The master's own device.
class MasterState {
 public:
  virtual void apply(co::NmtCommand command) noexcept = 0;

 protected:
  ~MasterState() = default;
};

class Startup {
 public:
  using Phase = manager::StartupPhase::Phase;

  Startup(BusServices& services, SlotTable& slots) noexcept;
  /// Before the first `begin`; must stay.
  void set_master(MasterState& master) noexcept { master_ = &master; }

  /// The main job begins: the boot time counts from now.
  void begin();
  /// It was ended where it stood.
  void end() noexcept;
  [[nodiscard]] Phase phase() const noexcept { return phase_.now(); }

  /// What the slot's device is expected to be, and what it is to the network.
  [[nodiscard]] static manager::SlaveRules rules_of(const Seat& seat);
  /// The seat's device is ready. True: it is started now; else its state says what its start waits for.
  [[nodiscard]] bool starts(Seat& seat);
  /// Looks at the mandatory slots: halts the startup for one that failed, and lets it go on when all are ready. True:
  /// now there is something to start (`together`, or each seat that waits).
  [[nodiscard]] bool goes_on();
  /// `goes_on` has something to look at: a person released what waits.
  [[nodiscard]] bool released() const noexcept { return released_; }
  /// One NMT start for all is due, not one for each.
  [[nodiscard]] bool together() const noexcept { return phase_.starts_all(); }
  /// Every slot that is not optional is operational: the master is too, unless the application makes it so.
  void network_operational() noexcept;

  /// The device of this slot was lost, or booted by itself, and was ready before.
  void error_event(const Seat& seat, std::string_view what);
  /// Does what an error event of a mandatory slot asks for.
  rt::Task<void> act_on_error();
  /// A person's command: NMT start ends a stop, and starts what waits; to the master's own node-ID it is carried out
  /// there.
  void commanded(co::NmtCommand command, co::NmtTarget target);

 private:
  struct ErrorEvent {
    manager::StartupPhase::OnError asks_for;
    std::string text;  // "slot 'x', which is mandatory: its heartbeat stopped"
  };
  [[nodiscard]] const Seat* missing() const noexcept;
  [[nodiscard]] const Seat* failed() const noexcept;
  [[nodiscard]] std::string why_waiting() const;
  void halt(const Seat& seat, const std::string& why);
  void tell_the_waiting();
  void boot_time_over() noexcept;
  void make_operational() noexcept;
  void stop_all(const std::string& why);
  void await_all(const std::string& why);
  void tell(const std::string& text);

  BusServices& s_;
  SlotTable& slots_;
  MasterState* master_ = nullptr;
  manager::StartupPhase phase_;
  std::optional<ErrorEvent> error_;
  std::string halted_by_;  // the mandatory slot
  bool master_operational_ = false;
  bool has_mandatory_ = false;
  bool released_ = false;  // the master became operational by a person's command, and what waits is to be started
  rt::Later<Startup, &Startup::boot_time_over> boot_time_over_;
};

}  // namespace berth::operate
