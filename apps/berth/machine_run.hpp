/// A machine, what it runs on, its store and the session, put together from files: the one way in which a command that
/// works on a machine prepares it.
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

/// What a person gives: file names, or the texts that `berth demo` has built in. Without either, the machine is one bus
/// without slots at `Options::ports` (machine_file.hpp).
struct Sources {
  std::string machine_name;
  std::string plant_name;
  std::string_view machine_text;  ///< empty: the files are read
  std::string_view plant_text;
  bool links = false;  ///< those of the machine are part of its devices' configuration
};

/// What a plant plans after a milestone.
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
  /// The signals that end a command: in place before the store is opened.
  [[nodiscard]] Interrupt& interrupt() noexcept { return *interrupt_; }
  /// What all of it runs on. Real ports have an executor and a loop, and nothing else.
  [[nodiscard]] rt::Driver& driver() noexcept { return *driver_; }
  [[nodiscard]] rt::Time now() const noexcept { return driver_->now(); }
  /// In real time: its loop. Null: time is a simulated world's.
  [[nodiscard]] io::Loop* loop() noexcept { return loop_; }
  /// The simulated buses. Null: every bus is outside this process (a real port, or a `berth plant`'s).
  [[nodiscard]] plant::World* world() noexcept { return world_.get(); }
  /// The gates of the buses outside this process.
  [[nodiscard]] Guards& guards() noexcept { return guards_; }
  [[nodiscard]] Strangers& strangers() noexcept { return *strangers_; }
  [[nodiscard]] Record& record() noexcept { return record_; }

  /// Power for the simulated devices.
  void power_on();
  /// That, and in simulated time the time that they need to boot, and `more`.
  void power_on_and_boot(rt::Duration more);
  /// A milestone of the session: what the plant plans after it comes.
  void milestone(operate::Milestone milestone);
  /// Confirmation of a person is wanted, or was given by --yes: the first start of a machine whose devices are real.
  [[nodiscard]] bool first_start();
  /// Ends a session as the machine file, or --on-exit, wants: its NMT command goes out before this returns.
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

  // In the order in which they need each other: what comes later goes first.
  design::Machine machine_;
  bool rate_as_it_stands_ = false;  // no bit rate was given: the port tells it
  plant::PlantFile plant_;
  Record record_;
  std::unique_ptr<plant::World> world_;
  std::optional<ScriptTeller> scripts_;  // with a world
  rt::Executor executor_;                // where there is no world
  std::unique_ptr<rt::Driver> driver_;
  io::Loop* loop_ = nullptr;                      // of the driver
  std::optional<Interrupt> interrupt_;            // until the store is closed
  std::optional<OutsidePorts> outside_;           // real ports, behind their gates
  std::vector<std::unique_ptr<can::Port>> ours_;  // Berth's nodes on simulated buses
  std::vector<std::unique_ptr<BusTap>> taps_;
  Guards guards_{machine_, record_};
  std::unique_ptr<SlotTable> slot_table_;
  std::unique_ptr<tree::Session> session_;
  std::optional<command::RemoteCommands> remote_commands_;  // what comes by SDO
  std::unique_ptr<Strangers> strangers_;
};

/// Devices outside of this process stay as they are when it ends.
[[nodiscard]] bool leaves_running(MachineRun& run, const Options& options);

}  // namespace berth::cli
