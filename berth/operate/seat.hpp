/// One slot at run time: what the machine file and the store say of it, and what was learnt from the bus.
#pragma once

#include <memory>
#include <optional>
#include <string>

#include "berth/co/emcy.hpp"
#include "berth/manager/configuration.hpp"
#include "berth/network/slave_boots.hpp"
#include "berth/operate/slot_life.hpp"
#include "berth/operate/written_files.hpp"
#include "berth/places/binding.hpp"
#include "berth/places/identity.hpp"
#include "berth/places/plan.hpp"
#include "berth/rt/executor.hpp"

namespace berth::operate {

/// Whether a second device holds its node-ID.
struct Doubt {
  bool suspect = false;    ///< traffic suggests it
  unsigned suspected = 0;  ///< rounds in a row in which devices that sat here before were asked for in vain
  unsigned shared = 0;     ///< remaining attempts to separate the two
  /// When to ask next for a former device that fell silent: it may return without a boot-up message (cut cable).
  std::optional<rt::Time> former_at{};
  rt::Duration former_pause{};  ///< until the next such question
  unsigned in_vain = 0;         ///< rounds in a row in which the two devices that caused the doubt were not found again
  bool by_two = false;          ///< no device sits here, and two answer under its node-ID
  Identity other{};             ///< the last device that answered instead of the slot's and was examined
};

/// The state of the upload of its device's configuration, as 5F0Ah reports it.
enum class Uploading : std::uint8_t { none, under_way, done, failed };

/// The configuration that `config =` and the machine's links want for its device.
struct SeatConfiguration {
  std::string file;                                      ///< its origin, as messages name it
  std::string path;                                      ///< path of its file; empty: it is in none
  std::optional<WrittenFiles::Form> written;             ///< it was given while Berth ran, instead of `config =`
  std::shared_ptr<const manager::Configuration> wanted;  ///< null: nothing, or unreadable
  std::string unreadable;                                ///< why the file of `config =` could not be read
  std::string eds;                                       ///< path of its description; empty: not known
  std::string uploaded;                                  ///< a DCF that is in no file and replaces one; empty: none
  Uploading upload = Uploading::none;                    ///< how the last one ended
  std::optional<rt::Time> waits_since;                   ///< since when it is saved and waits for a power cycle
  unsigned failed_savings = 0;                           ///< in a row: memory wears out
  unsigned restarts = 0;                                 ///< in a row, each during a configuration
  rt::Time unanswered{};                                 ///< when a write of it got no answer; 0: none
  bool stuck = false;  ///< it failed for good: not tried again before the device boots or a user asks for it
  /// Something is wanted, whether readable or not.
  [[nodiscard]] bool any() const noexcept { return wanted != nullptr || !unreadable.empty(); }
};

/// The rate of its heartbeat, or how it is watched without one.
struct HeartbeatRate {
  rt::Duration period{};        ///< if not the bus's: what the device accepts, or has; 0: the bus's
  std::string refused{};        ///< why the wanted period is not used; empty: it is
  std::string how{};            ///< how it is watched without a heartbeat, and why: the reason while operational
  rt::Duration seen{};          ///< the observed period, whatever 1017h says; 0: as 1017h says
  rt::Time written{};           ///< 1017h was written, and whether that resets the device is not known yet; 0: it is
  rt::Time ran{};               ///< when its heartbeat last reported that it became operational
  std::uint64_t boot_ups = 0;   ///< of its node-ID, when 1017h was last written or examined
  rt::Duration boots_behind{};  ///< time from a write to the last boot-up after it
  unsigned resets = 0;          ///< 2 for each boot-up right after a write, 1 for one a little later
  bool by_sdo = false;          ///< no error control: it is asked by SDO; `at`: last
  std::uint64_t beats = 0;      ///< heard at the last look
  rt::Time at{};
  unsigned fast = 0;  ///< looks in a row with too many
};

/// Its device has a new node-ID, which takes effect when it is switched off and on.
struct PowerCycle {
  std::optional<places::Binding> binding;
  unsigned looked_at = 0;  ///< rounds
};

/// The last error that a device reported (EMCY) and that, as far as is known, is not gone.
struct ToldError {
  co::Emcy message;
  rt::Time at{};            ///< the first of those that were equal, one after the other
  std::uint32_t count = 1;  ///< of these
};

/// Events under its node-ID, so that their reports and actions are not repeated for each.
struct LastHeard {
  bool seen = false;                          ///< the bound device was there in this run
  rt::Time heard_again{};                     ///< when it was reported that the node-ID is heard again
  std::optional<ToldError> emergency{};       ///< its last error since its boot-up
  rt::Time typed{};                           ///< when it answered 1000h
  bool untyped = false;                       ///< it answered 1018h and not 1000h (letter B)
  rt::Time hurried{};                         ///< when a boot-up hastened the look at the bus
  rt::Time taken_back{};                      ///< when a search found it in its slot
  rt::Time left{};                            ///< when it last left operational by itself, or seemed to
  unsigned leaves = 0;                        ///< in a row, each soon after the previous one
  unsigned doubts = 0;                        ///< how often a second device was looked for because of these
  std::optional<places::SlotState> failed{};  ///< how the binding that is tried again ended before
  std::optional<rt::Time> reset{};            ///< when equals were reset, to see which node-IDs they have stored
  unsigned resets = 0;                        ///< how often, until each had booted
};

struct Seat {
  Seat(rt::Executor& executor, places::SlotSpec spec)
      : slave(executor, {.node = spec.id, .rules = {.assigned = true, .boots = true, .mandatory = spec.mandatory}}) {
    slot.spec = std::move(spec);
  }

  places::Slot slot;
  Life life = Life::unknown;  ///< changed by `SlotTable::happened` alone
  rt::Time since{};
  std::string reason;
  std::string absence;              ///< why it is absent, without what to do about it
  std::optional<Identity> offered;  ///< a device that fits the slot, is on the bus and has no slot
  bool fresh = false;               ///< bound in this run, and its past elsewhere not examined yet
  bool held = false;                ///< a user took it out of operational: it is not started again
  bool ask_again = false;           ///< silent, and due to be asked once more
  bool polled = true;               ///< false: its device is not asked before it sends something (paper 5 §2)
  bool misses_one = false;          ///< empty, and its reason names a device that was found and is not seated
  bool guarded = false;             ///< the device sends no heartbeat, or none is wanted: it is asked
  rt::Time checked{};               ///< when it was last identified
  Doubt doubt;
  places::Uncompared uncompared;  ///< parts of its 1018h
  network::Slave slave;           ///< its device's boot-up (CiA 302-2); `awaited`: until a user asks, too
  SeatConfiguration configuration;
  HeartbeatRate rate;
  PowerCycle power_cycle;
  LastHeard last;

  /// Why a device that answers is letter B (CiA 302-2: no answer to the upload of 1000h).
  static constexpr const char* no_type = "it answers 1018h, and no answer comes to the upload of 1000h";

  [[nodiscard]] const std::string& name() const noexcept { return slot.spec.name.name; }
  [[nodiscard]] NodeId id() const noexcept { return slot.spec.id; }
  /// The device profile that is expected: the lower word of 1000h (CiA 301 §7.5.2.1); 0: none, or not known.
  [[nodiscard]] std::uint16_t profile() const noexcept { return static_cast<std::uint16_t>(slot.spec.device_type); }
  [[nodiscard]] bool there() const noexcept { return is_there(life); }
  /// What answers under its node-ID contradicts nothing that is known of its device. If either identity is only partly
  /// known, all devices of a maker could match, so the type must also be the slot's.
  [[nodiscard]] bool sits(const Identity& who) const noexcept {
    const Identity says = uncompared.of(who);
    if (!slot.record.confirmed || !says.agrees(slot.record.confirmed->device)) return false;
    const bool whole = says.unknown == 0 && slot.record.confirmed->device.unknown == 0;
    return whole || places::fits(slot.spec, says);
  }
  [[nodiscard]] places::SlotState state() const noexcept { return shown(life); }
  /// The state shown to users: a failed binding stays failed while it is tried again.
  [[nodiscard]] places::SlotState shown_state() const noexcept { return last.failed.value_or(state()); }
  /// Its boot-up is done: nothing to do before it boots, or a user asks for it.
  [[nodiscard]] bool is_booted() const noexcept {
    return slave.status.ready() || slave.status.phase == network::SlavePhase::awaited;
  }
  /// Its device was identified, and its boot-up is next.
  [[nodiscard]] bool is_to_boot() const noexcept { return life == Life::present && !is_booted(); }
  /// Its device is there, or waits for its power cycle: no search is needed for it.
  [[nodiscard]] bool is_accounted_for() const noexcept { return there() || power_cycle.binding.has_value(); }
  /// Its boot-up begins anew with the next round.
  void boot_again() noexcept { slave.status.phase = network::SlavePhase::idle; }
  /// Sets the letter of a boot-up that did not take place, or ended before its first step.
  void set_letter(manager::BootStatus status) noexcept {
    slave.forget();
    slave.status.result.status = status;
  }
  [[nodiscard]] manager::BootStatus letter() const noexcept { return slave.status.result.status; }
  /// Its heartbeats reported another state than operational within the last four periods.
  [[nodiscard]] bool left_lately(rt::Time now, rt::Duration period) const noexcept {
    return now - last.left < 4 * period;
  }
  /// Letter K: it was started, answers SDO, but the heartbeat that 1017h promises never came.
  [[nodiscard]] bool is_unheard() const noexcept {
    return life == Life::failed && rate.by_sdo && letter() == manager::BootStatus::k;
  }
};

}  // namespace berth::operate
