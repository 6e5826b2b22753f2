/// One slot at run time: what the machine file and the store say of it, and what the bus has told.
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
  bool suspect = false;    ///< traffic says that it may be so
  unsigned suspected = 0;  ///< rounds in a row in which devices that sat here before were asked for in vain
  unsigned shared = 0;     ///< tries left to tell the two apart
  /// One that sat here and fell silent may come back without a word, as when its cable was cut: asked for then.
  std::optional<rt::Time> former_at{};
  rt::Duration former_pause{};  ///< until it is asked for the next time
  unsigned in_vain = 0;         ///< rounds in a row in which the two that were found for it were not found again
  bool by_two = false;          ///< no device sits here, and two answer under its node-ID
  Identity other{};             ///< the last one that answered instead of the slot's device and was looked at
};

/// What became of the upload of its device's configuration, as 5F0Ah tells it.
enum class Uploading : std::uint8_t { none, under_way, done, failed };

/// What `config =` and the machine's links want of its device.
struct SeatConfiguration {
  std::string file;                                      ///< where it is from, as messages name it
  std::string path;                                      ///< of that file; empty: it is in none
  std::optional<WrittenFiles::Form> written;             ///< an SDO client wrote it, instead of `config =`
  std::shared_ptr<const manager::Configuration> wanted;  ///< null: nothing, or unreadable
  std::string unreadable;                                ///< why the file of `config =` could not be read
  std::string eds;                                       ///< path of its description; empty: not known
  std::string uploaded;                                  ///< a DCF that is in no file, instead of one; empty: none
  Uploading upload = Uploading::none;                    ///< how the last one ended
  std::optional<rt::Time> waits_since;                   ///< it was saved then, and waits for a power cycle
  unsigned failed_savings = 0;                           ///< in a row: memory wears out
  unsigned restarts = 0;                                 ///< in a row, each while it was configured
  rt::Time unanswered{};                                 ///< a write of it had no answer then; 0: none
  bool stuck = false;  ///< it failed for good: not tried again before the device boots or a person says so
  /// Something is wanted, whether it can be read or not.
  [[nodiscard]] bool any() const noexcept { return wanted != nullptr || !unreadable.empty(); }
};

/// How often its heartbeat comes.
struct HeartbeatRate {
  rt::Duration period{};        ///< other than the bus's: what the device takes, or has; 0: the bus's
  std::string refused{};        ///< why it is not what was wanted; empty: it is
  std::string how{};            ///< how it is watched without a heartbeat, and why: the reason while it is operational
  rt::Duration seen{};          ///< its heartbeats come so often, whatever 1017h says; 0: as that says
  rt::Time written{};           ///< 1017h was, and whether the device resets itself for that is not known yet; 0: it is
  rt::Time ran{};               ///< its heartbeat told that it became operational, last
  std::uint64_t boot_ups = 0;   ///< of its node-ID, when 1017h was written, or looked at after that
  rt::Duration boots_behind{};  ///< the last boot-up after a write
  unsigned resets = 0;          ///< that it does: 2 for each boot-up right after a write, 1 for one a little later
  bool by_sdo = false;          ///< it has no error control, and is asked by SDO; `at`: last
  std::uint64_t beats = 0;      ///< heard when it was looked at last
  rt::Time at{};
  unsigned fast = 0;  ///< looks in a row at which there were too many
};

/// Its device's new node-ID waits to be switched off and on.
struct PowerCycle {
  std::optional<places::Binding> binding;
  unsigned looked_at = 0;  ///< rounds
};

/// The error that a device told last (EMCY), and that is not gone as far as is known.
struct ToldError {
  co::Emcy message;
  rt::Time at{};            ///< the first of those that were equal, one after the other
  std::uint32_t count = 1;  ///< of these
};

/// What came under its node-ID, that it is not told or done again for each.
struct LastHeard {
  bool seen = false;                          ///< the device that is bound was there in this run
  rt::Time heard_again{};                     ///< it was told that the node-ID is heard again
  std::optional<ToldError> emergency{};       ///< its last error since its boot-up
  rt::Time typed{};                           ///< it answered 1000h
  bool untyped = false;                       ///< it answered 1018h and not 1000h (letter B)
  rt::Time hurried{};                         ///< a boot-up hastened the look at the bus
  rt::Time taken_back{};                      ///< a search found it where it sits
  rt::Time left{};                            ///< it left operational by itself, last
  unsigned leaves = 0;                        ///< in a row, each soon after the one before
  std::optional<places::SlotState> failed{};  ///< the binding that is tried again ended so before
  std::optional<rt::Time> reset{};            ///< of equal ones, to see which node-IDs they have in their memories
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
  std::optional<Identity> offered;  ///< a device that fits it, is on the bus and has no slot
  bool fresh = false;               ///< bound in this run, and not yet looked at for a past elsewhere
  bool held = false;                ///< a person took it out of operational: it is not started again
  bool ask_again = false;           ///< silent, and due to be asked once more
  bool polled = true;               ///< false: nobody asks for its device before it speaks (paper 5 §2)
  bool misses_one = false;          ///< empty, and says which device was found and is not seated
  bool guarded = false;             ///< the device sends no heartbeat, or none is wanted: it is asked
  rt::Time checked{};               ///< when it was identified last
  Doubt doubt;
  places::Uncompared uncompared;  ///< parts of its 1018h
  network::Slave slave;           ///< the boot-up of its device (CiA 302-2); `awaited`: nor before a person says so
  SeatConfiguration configuration;
  HeartbeatRate rate;
  PowerCycle power_cycle;
  LastHeard last;

  /// Why a device that speaks is letter B (CiA 302-2: no answer to the upload of 1000h).
  static constexpr const char* no_type = "it answers 1018h, and no answer comes to the upload of 1000h";

  [[nodiscard]] const std::string& name() const noexcept { return slot.spec.name.name; }
  [[nodiscard]] NodeId id() const noexcept { return slot.spec.id; }
  /// The device profile that is expected: the lower word of 1000h (CiA 301 §7.5.2.1); 0: none, or not known.
  [[nodiscard]] std::uint16_t profile() const noexcept { return static_cast<std::uint16_t>(slot.spec.device_type); }
  [[nodiscard]] bool there() const noexcept { return is_there(life); }
  /// What answers under its node-ID says nothing else than its device does. Where one of the two says a part only, all
  /// of a maker would agree: the type is the slot's, too.
  [[nodiscard]] bool sits(const Identity& who) const noexcept {
    const Identity says = uncompared.of(who);
    if (!slot.record.confirmed || !says.agrees(slot.record.confirmed->device)) return false;
    const bool whole = says.unknown == 0 && slot.record.confirmed->device.unknown == 0;
    return whole || places::fits(slot.spec, says);
  }
  [[nodiscard]] places::SlotState state() const noexcept { return shown(life); }
  /// The same for people: a binding that failed is failed while it is tried again.
  [[nodiscard]] places::SlotState shown_state() const noexcept { return last.failed.value_or(state()); }
  /// Its boot-up is done: nothing is to be done before it boots, or a person says so.
  [[nodiscard]] bool is_booted() const noexcept {
    return slave.status.ready() || slave.status.phase == network::SlavePhase::awaited;
  }
  /// Its device was identified, and its boot-up is next.
  [[nodiscard]] bool is_to_boot() const noexcept { return life == Life::present && !is_booted(); }
  /// Its device is there, or waits for its power cycle: nobody needs to look for it.
  [[nodiscard]] bool is_accounted_for() const noexcept { return there() || power_cycle.binding.has_value(); }
  /// Its boot-up begins anew with the next round.
  void boot_again() noexcept { slave.status.phase = network::SlavePhase::idle; }
  /// How its boot-up ended that was none, or ended before its first step.
  void set_letter(manager::BootStatus status) noexcept {
    slave.forget();
    slave.status.result.status = status;
  }
  [[nodiscard]] manager::BootStatus letter() const noexcept { return slave.status.result.status; }
  /// Letter K: it was started, answers SDO, and the heartbeat that 1017h promises never came.
  [[nodiscard]] bool is_unheard() const noexcept {
    return life == Life::failed && rate.by_sdo && letter() == manager::BootStatus::k;
  }
};

}  // namespace berth::operate
