/// A machine, its ports or world, its store and the session, made from files. Every command that works on a machine
/// prepares it by this.
#pragma once

#include <memory>
#include <optional>
#include <string>
#include <string_view>
#include <tl/expected.hpp>
#include <vector>

#include "berth/command/command_buffer.hpp"
#include "berth/design/machine.hpp"
#include "berth/io/loop_driver.hpp"
#include "berth/plant/world.hpp"
#include "berth/sim/world_driver.hpp"
#include "berth/tree/session.hpp"
#include "guards.hpp"
#include "interrupt.hpp"
#include "options.hpp"
#include "output.hpp"
#include "outside_ports.hpp"
#include "ports.hpp"
#include "record.hpp"
#include "simulated.hpp"
#include "slot_table.hpp"
#include "strangers.hpp"

namespace berth::cli {

/// What the user gives: file names, or the built-in texts of `berth demo`. Without either, the machine is one bus
/// without slots at `Options::ports` (machine_file.hpp).
struct Sources {
  std::string machine_name;
  std::string plant_name;
  std::string_view machine_text;  ///< empty: the files are read
  std::string_view plant_text;
  bool links = false;  ///< the machine's links are part of its devices' configuration
};

/// The plan of a plant after this milestone.
[[nodiscard]] plant::After after(operate::Milestone milestone) noexcept;

/// All that a command needs to work on a machine.
class MachineRun {
 public:
  using Made = tl::expected<std::unique_ptr<MachineRun>, Failure>;
  /// Opens the session. With `options.dry_run` nothing outside this process changes: the store is a copy. A simulated
  /// machine runs in real time with `options.sim.pace`, else as fast as it can be computed.
  [[nodiscard]] static Made make(const Options& options, const Sources& sources);
  MachineRun(const MachineRun&) = delete;
  MachineRun& operator=(const MachineRun&) = delete;

  [[nodiscard]] const design::Machine& machine() const noexcept { return machine_; }
  [[nodiscard]] const plant::PlantFile& plant() const noexcept { return plant_; }
  [[nodiscard]] tree::Session& session() noexcept { return *session_; }
  /// The signals that end a command, caught before the store is opened.
  [[nodiscard]] Interrupt& interrupt() noexcept { return *interrupt_; }
  /// Drives everything here. Real ports have only an executor and a loop.
  [[nodiscard]] rt::Driver& driver() noexcept { return *driver_; }
  [[nodiscard]] rt::Time now() const noexcept { return driver_->now(); }
  /// In real time: its loop. Null: a simulated world gives the time.
  [[nodiscard]] io::Loop* loop() noexcept { return loop_; }
  /// The simulated buses. Null: every bus is outside this process (a real port, or a `berth plant`'s).
  [[nodiscard]] plant::World* world() noexcept { return world_.get(); }
  /// The gates of the buses outside this process.
  [[nodiscard]] Guards& guards() noexcept { return guards_; }
  [[nodiscard]] Strangers& strangers() noexcept { return *strangers_; }
  [[nodiscard]] Record& record() noexcept { return record_; }
  /// `SlotTable::beside`.
  friend std::string beside_slot_table(const MachineRun& run, const std::string& ending) {
    return run.slot_table_->beside(ending);
  }

  /// Powers the simulated devices.
  void power_on();
  /// The same; then in simulated time runs for as long as they need to boot, and `more`.
  void power_on_and_boot(rt::Duration more);
  /// The session reached a milestone: the plant's plan for it begins.
  void milestone(operate::Milestone milestone);
  /// The user's confirmation is needed, or --yes gave it: the first start of a machine with real devices.
  [[nodiscard]] bool first_start();
  /// The slots of `machine` that this run has too decide by its specifications (`operate::Network::take_over`). Slots
  /// beneath a gateway stay as they are; returns their names.
  std::vector<std::string> take_over(const design::Machine& machine);
  /// Ends the session as the machine file, or --on-exit, says: its NMT command is sent before this returns.
  void leave(const Options& options);

 private:
  MachineRun() = default;
  [[nodiscard]] tl::expected<void, Failure> read(const Options& options, const Sources& sources);
  [[nodiscard]] design::MachineResult read_machine(const Options& options, const Sources& sources,
                                                   std::optional<Failure>& problem) const;
  [[nodiscard]] tl::expected<void, Failure> settle_ports(const Options& options, bool simulate);
  [[nodiscard]] tl::expected<void, Failure> build_world(const Options& options);
  void run_by_loop(rt::Executor& executor);
  [[nodiscard]] tl::expected<std::vector<can::Port*>, Failure> attach_all(const Options& options);
  [[nodiscard]] tl::expected<void, Failure> open_session(const Options& options, bool links,
                                                         const std::vector<can::Port*>& ports);
  [[nodiscard]] tl::expected<can::Port*, Failure> attach(const design::Bus& bus, const Options& options);

  // Ordered by dependency: later members are destroyed first.
  design::Machine machine_;
  bool rate_as_it_stands_ = false;  // no bit rate was given: the port gives it
  plant::PlantFile plant_;
  Record record_;
  std::unique_ptr<plant::World> world_;
  std::optional<ScriptTeller> scripts_;  // if there is a world
  rt::Executor executor_;                // if there is no world
  std::unique_ptr<rt::Driver> driver_;
  io::Loop* loop_ = nullptr;                      // of the driver
  std::optional<Interrupt> interrupt_;            // until the store is closed
  std::optional<OutsidePorts> outside_;           // real ports, behind their gates
  std::vector<std::unique_ptr<can::Port>> ours_;  // Berth's nodes on simulated buses
  std::vector<std::unique_ptr<BusTap>> taps_;
  Guards guards_{machine_, record_};
  std::unique_ptr<SlotTable> slot_table_;
  std::unique_ptr<tree::Session> session_;
  std::optional<command::RemoteCommands> remote_commands_;  // requests by SDO
  std::unique_ptr<Strangers> strangers_;
};

/// Devices outside this process keep their state when it ends.
[[nodiscard]] bool leaves_running(MachineRun& run, const Options& options);

}  // namespace berth::cli
