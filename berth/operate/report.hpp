/// The contents of a run's report: the slot table as it stands, and what happened. `berth up --json`, the live table
/// and the control socket print it.
#pragma once

#include <cstdint>
#include <deque>
#include <functional>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "berth/base/ids.hpp"
#include "berth/manager/boot_rules.hpp"
#include "berth/manager/flying_negotiation.hpp"
#include "berth/places/oddity.hpp"
#include "berth/places/slot.hpp"
#include "berth/rt/executor.hpp"

namespace berth::operate {

/// The last error that a slot's device reported (EMCY) and that, as far as is known, is not gone.
struct EmcyReport {
  std::uint16_t code = 0;
  std::uint8_t error_register = 0;
  std::string text;         ///< what the code means for a device of its profile
  rt::Time at{};            ///< the first of `count` equal ones, one after the other
  std::uint32_t count = 1;  ///< of these
};

/// One slot as it stands.
struct SlotReport {
  std::string bus;
  NodeId id;
  std::string name;
  TypeCode type;
  std::optional<Identity> device;  ///< the device bound here, intended or confirmed
  places::SlotState state = places::SlotState::unknown;
  rt::Time since{};                                        ///< since when it is in this state
  std::string reason;                                      ///< for states that need one: what is wrong and what to do
  manager::BootStatus boot = manager::BootStatus::booted;  ///< how its boot-up ended: the letter of CiA 302-2
  std::uint8_t unasked = 0;                                ///< parts of `type`: `places::SlotAsks::unasked`
  std::optional<NmtState> nmt = {};                        ///< last reported by its device, by heartbeat or guarding
  std::optional<rt::Time> heard = {};                      ///< when it reported that
  std::optional<EmcyReport> emcy = {};
};

/// What an event is about.
enum class EventKind : std::uint8_t {
  step,   ///< the step under way
  state,  ///< a slot's state has changed
  found,  ///< a device
  bound,
  new_device,  ///< with `when_ambiguous = "one-at-a-time"`: the slot that the device got
  moved,
  configured,
  restored,  ///< factory settings
  forgotten,
  question,
  duplicate,
  power_cycle_needed,
  recipe,
  emcy,       ///< a device reported an error, or that its errors are gone
  startup,    ///< of the network as a whole: halted, stopped, reset
  master,     ///< which of several masters is the active one
  milestone,  ///< its text is the milestone's name
  error,
  // Oddities (`places::OddityKind`):
  surplus,
  foreign,
  clone,
  wrong_revision,
  fixed_mismatch,
  misplaced,
  returned,
  unfinished,
  lent,
};
/// The word in JSON: "new device".
[[nodiscard]] const char* name(EventKind kind) noexcept;
[[nodiscard]] EventKind event_kind(places::OddityKind kind) noexcept;

/// What a network reaches once in a run.
enum class Milestone : std::uint8_t {
  discovered,   ///< a discovery found a device
  bound,        ///< every slot that can be bound is, and at least one
  operational,  ///< every slot that is not optional is operational
};
inline constexpr std::size_t milestones = 3;
[[nodiscard]] const char* name(Milestone milestone) noexcept;

/// One thing that happened. `kind` is for programs, `text` for people.
struct Event {
  rt::Time at{};
  std::string bus;
  EventKind kind = EventKind::step;
  std::string slot;  ///< name; empty: no slot is concerned
  std::string text;
  std::vector<std::string> slots = {};    ///< of a "question": the slots concerned
  std::vector<std::string> devices = {};  ///< of a "question": the LSS addresses of the devices
  bool offers_save = false;  ///< of a "question": ask to save the slot's device's parameters and restart it

  friend bool operator==(const Event&, const Event&) = default;
};

/// The active NMT master of a bus that has several (`[bus.NAME.flying_master]`).
struct MasterReport {
  std::string bus;
  std::optional<manager::MasterRank> active = {};  ///< empty: not agreed yet
  bool here = false;                               ///< it is this Berth

  /// "field: node 127 is the active NMT master (priority 1), this Berth".
  [[nodiscard]] std::string text() const;
};

struct Report {
  std::vector<SlotReport> slots;
  std::vector<std::pair<std::string, double>> bus_time_s;  ///< per bus: seconds of bus time from start to now
  std::deque<Event> events;
  std::vector<Event> questions = {};       ///< that are open now
  std::vector<MasterReport> masters = {};  ///< of the buses that have several
};

/// Seconds since the world began, as in the JSON.
[[nodiscard]] double seconds(rt::Time at) noexcept;

/// One JSON object: `{"slots": [{"bus", "id", "name", "type", "r_sn", "state", "since_s"}], "bus_time_s": {...},
/// "events": [...]}`. Type code and R_SN are "0x…" strings; `r_sn` is null for a slot without a device. Optional
/// members:
/// - "reason", if it is not empty
/// - "boot", if the boot-up ended with a letter (CiA 302-2; "L" is no error)
/// - "nmt" and "heard_s": the last state that its device reported, and when
/// - "emcy": its last error (`{"at_s", "code", "text", "register", "count"}`) while it is not gone
/// - "questions": `[{"bus", "kind", "text", "slots", "devices"}]`, answered by `berth replace SLOT --device ADDRESS`
/// - "masters": `[{"bus", "node", "priority", "here"}]`, the active NMT master (`node` null: not agreed) of each bus
///   that has several
[[nodiscard]] std::string to_json(const Report& report, int indent = 2);
/// The same in pieces of about 64 KiB: for thousands of devices the whole text and its source would take more memory
/// than the devices.
using JsonSink = std::function<void(std::string_view piece)>;
void write_json(const Report& report, int indent, const JsonSink& out);
/// One line of JSON, for streams.
[[nodiscard]] std::string to_json(const Event& event);
[[nodiscard]] std::string to_json(const SlotReport& slot);

/// "  0.215 s  backbone  slot 2 'left': bound to ...".
[[nodiscard]] std::string to_line(const Event& event);

}  // namespace berth::operate
