/// The main job on one bus: finds the devices, gives each the node-ID of its slot, checks, starts and watches it, and
/// puts replacements to work. One `Network` is one master on one port; `Session` has one for each bus of a machine.
///
/// On a bus with several masters (`[bus.NAME.flying_master]`) the main job runs while this one is the active master,
/// and rests while another is (`Mastership`).
///
/// What it does, in this order, again and again while it runs:
///   1. opening: a device that an interrupted run left in LSS configuration state is taken out of it
///   2. preparation: is the device of every bound slot there? By heartbeat, else SDO 1000h, else guarding (S1.30)
///   3. discovery: RAND, by Berth's planner, finds every device that no slot knows (S1.31); while a slot's device is
///      missing still, whatever else devices speak is tried (`discovery::Auto`). A bus with `discovery =` uses that
///      method alone; `"rand"` is RAND as published
///   4. plan and binding: `places::plan`, then the bindings, side by side as far as LSS allows: one device is told its
///      node-ID while those before it boot (S1.32, S1.33)
///   5. check, configuration and start: identity, what `config =` wants, heartbeat, NMT start; operational when the
///      device says so
///   6. watch: heartbeats and boot-ups; every `probe_period` one question whether a new device is there
#pragma once

#include <functional>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <tl/expected.hpp>
#include <vector>

#include "berth/operate/main_job.hpp"
#include "berth/operate/mastership.hpp"
#include "berth/operate/scan.hpp"
#include "berth/rt/scope.hpp"

namespace berth::operate {

class Network final : private PortHealth::Owner {
 public:
  /// `bus`, `store` and `port` must outlive this. `machine`: the machine file's name. `slots`: the specifications of
  /// this bus.
  Network(rt::Executor& executor, can::Port& port, std::string machine, const design::Bus& bus,
          std::vector<places::SlotSpec> slots, places::SlotStore& store, const NetworkObserver& observer);
  ~Network();
  Network(const Network&) = delete;
  Network& operator=(const Network&) = delete;

  /// Declares the slots in the store and loads what it knows. Call once, before anything else. `written`: where
  /// configurations that SDO clients write to the manager are stored.
  Result<void> open(const manager::SlotSettings& settings = {}, const SlotDescriptions& descriptions = {},
                    WrittenFiles written = {});
  /// Begins the main job. Without it the network only serves single commands. The main job rests while the port is down
  /// or takes no frame (another master, a gate that still listens), and restarts by itself.
  void start();
  /// Stops the main job at once, as if Berth had been ended.
  void stop() noexcept;

  [[nodiscard]] const design::Bus& bus() const noexcept { return parts_.bus.bus; }
  [[nodiscard]] std::vector<SlotReport> report() const { return parts_.slots.report(); }
  /// The part of `report` that is cheap enough to read at every event, in the slots' own order.
  struct Occupancy {
    places::SlotState state;
    std::optional<Identity> device;
    friend bool operator==(const Occupancy&, const Occupancy&) = default;
  };
  [[nodiscard]] std::vector<Occupancy> occupancy() const;
  /// Every slot that is not optional is operational.
  [[nodiscard]] bool operational() const noexcept { return parts_.slots.operational(); }
  /// The main job has nothing to do now but watch.
  [[nodiscard]] bool idle() const noexcept { return job_.idle(); }
  [[nodiscard]] Phase phase() const noexcept { return parts_.agenda.phase; }
  /// How far the NMT startup has come.
  [[nodiscard]] SlotStartup::Phase startup() const noexcept { return parts_.startup.phase(); }
  /// The last plan of which device belongs where: its oddities (devices and facts that are not as they should be) and
  /// questions; both are events too.
  [[nodiscard]] const Planning& planning() const noexcept { return parts_.planning; }

  // Commands of a user. They wait until the main job has nothing to do.

  /// `berth replace SLOT`: forgets which device sits in the slot and looks for a new one. `device` names the new device
  /// and so answers a question. `used`: the used device that waits for this slot, or sits in it, may be used; its
  /// factory settings are restored first. Errors: `not_found` no such slot; `invalid` the slot's device is there and
  /// operational, or `device` is not of the slot's type; `duplicate` the device sits in another slot of this bus.
  Result<void> replace(const std::string& slot, std::optional<Identity> device, bool used = false);

  /// A user sent this NMT command beside the main job, which then does not counteract it: a node that was stopped or
  /// made pre-operational stays so until a user starts it or it boots.
  void commanded(co::NmtCommand command, co::NmtTarget target);

  /// The obstacle to starting this slot's device is gone: it is tried again.
  void try_again(NodeId slot);

  /// Silences the master's own device until the main job, if it runs, has looked around anew (network_bitrate.hpp).
  void fall_silent() noexcept { port_.fall_silent(); }

  /// `berth forget DEVICE`: gives up an unfinished intention to take the device's node-ID away. Errors: `not_found`
  /// there is none on this bus.
  Result<void> forget(const Identity& device);

  /// For single commands (`berth sdo`, `berth nmt`, `berth lss`). A caller that uses LSS or RAND takes the turn first:
  /// the main job holds it while it works.
  [[nodiscard]] BusServices& services() noexcept { return parts_.bus; }

  /// The devices on this bus: those that were heard, or all.
  [[nodiscard]] rt::Task<Result<std::vector<operate::Seen>>> scan(ScanRange range) { return scan_.run(range); }

  /// Compares the configurations of all slots that have one, or of the slot of this name, and with `write` corrects
  /// differences; a running device is only compared. Waits for the turn. Errors: `not_found` no such slot.
  [[nodiscard]] rt::Task<Result<std::vector<SlotConfiguration>>> configure(std::string slot, bool write);

  /// Discovery and binding once, without starting anything (`berth bind`), by `method` ("auto", or a name of
  /// `discovery::Method`; empty: the machine file's). Waits for the turn.
  [[nodiscard]] rt::Task<Result<void>> bind_once(std::string method = {}) { return job_.bind_once(std::move(method)); }

  /// The same from scratch (`berth bind --from-scratch`): makes every device pre-operational, forgets every binding,
  /// takes away every node-ID that LSS can change, and then binds all anew. Fixed node-IDs stay. Errors: `invalid` no
  /// user `confirmed` it; `unsupported` Berth does not command this bus; those of `bind_once`.
  [[nodiscard]] rt::Task<Result<void>> bind_from_scratch(bool confirmed) { return job_.bind_from_scratch(confirmed); }

  using NewDevices = operate::NewDevices;
  /// Changes devices only as a search does. The turn must be held.
  [[nodiscard]] rt::Task<Result<NewDevices>> find_new() { return parts_.finding.search.find_new(); }

  /// The device that `locate` found and showed.
  struct Located {
    Identity device;
    NodeId id;                      ///< its present node-ID
    std::optional<NmtState> state;  ///< empty: not known
  };
  /// Makes the device of this LSS address show itself for `time`: in LSS configuration state its two indicators flicker
  /// in turn (CiA 303-3). Then all are in LSS waiting again, also if the task is destroyed. Waits for the turn and
  /// keeps it, so that no search runs meanwhile. A device that is operational, or whose state is unknown, is shown only
  /// with `anyway`: it goes on working, but some makers' devices do not tolerate LSS then. Errors: `not_found` it does
  /// not answer; `invalid` operational, or state unknown.
  [[nodiscard]] rt::Task<Result<Located>> locate(Identity device, rt::Duration time, bool anyway);

  friend bool take_over(Network& network, const places::SlotSpec& spec);
  friend rt::Task<Result<SlotUpload>> upload_slot(Network& network, std::string slot);
  friend Result<void> poll_slot(Network& network, const std::string& slot, bool on);
  friend bool is_configured(const Network& network, const std::string& slot);
  friend const BusStatistics& statistics_of(Network& network) noexcept { return network.parts_.slots.diagnosis(); }
  friend tl::expected<std::string, std::string> give_configuration(Network& network, const std::string& slot,
                                                                   WrittenFiles::Form form,
                                                                   std::span<const std::uint8_t> bytes,
                                                                   const std::string& file);

 private:
  class Asked;
  void port_rests() noexcept override;
  void port_goes_on() override;

  SupervisionRelay relay_;
  std::unique_ptr<RolePort> role_;  // only with several masters
  NetworkParts parts_;
  PortHealth port_;
  MainJob job_;
  Scan scan_;
  std::unique_ptr<Asked> asked_;            // requests to the master's own device
  std::unique_ptr<Mastership> mastership_;  // only with several masters
  bool running_ = false;
  rt::Scope scope_;  // last: its tasks use everything above
};

/// The present configuration of this slot's device, as a DCF. It becomes what the slot wants, instead of `config =`,
/// until Berth ends: a replacement gets it. Waits for the turn. Errors: `not_found` no such slot.
[[nodiscard]] rt::Task<Result<SlotUpload>> upload_slot(Network& network, std::string slot);

/// `berth poll SLOT --stop`, `berth poll SLOT`: whether the absent device of an optional slot is asked for (paper 5
/// §2, Figure 4: the application stops polling). After a stop the slot's node-ID is asked nothing until a frame is
/// heard from it, for example its boot-up message; from then on it is asked again. Blank devices are still found.
/// Errors: `not_found` no such slot; `invalid` to stop it: the slot is not optional, or its device is there.
Result<void> poll_slot(Network& network, const std::string& slot, bool on);

/// The slot's device is to be configured: by `config =`, by links, or by what was given while Berth ran.
[[nodiscard]] bool is_configured(const Network& network, const std::string& slot);

/// What happened on this bus since Berth began.
[[nodiscard]] const BusStatistics& statistics_of(Network& network) noexcept;

/// A user gives the slot this configuration, which replaces `config =` from its next configuration on and is kept as
/// one that an SDO client writes (ConfigurationIntake). `file` is where it came from, for messages. Returns what the
/// slot's event says. The error says why it is refused.
[[nodiscard]] tl::expected<std::string, std::string> give_configuration(Network& network, const std::string& slot,
                                                                        WrittenFiles::Form form,
                                                                        std::span<const std::uint8_t> bytes,
                                                                        const std::string& file);

/// From now on `spec` decides about the slot's spares, further types, replacement and ambiguity (`SlotSpec::spares`,
/// `also`, `replacement`, `when_ambiguous`); what else it says is ignored. The devices that wait are looked at anew.
/// False: the bus has no slot of this name.
bool take_over(Network& network, const places::SlotSpec& spec);

}  // namespace berth::operate
