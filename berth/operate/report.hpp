/// What a run has to say: the slot table as it stands, and what happened. `berth up --json`, the live table and the
/// control socket all print this.
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

/// The error that a slot's device told last (EMCY) and that is not gone, as far as is known.
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
  std::optional<Identity> device;  ///< that is bound here, intended or confirmed
  places::SlotState state = places::SlotState::unknown;
  rt::Time since{};                                        ///< since when it is in this state
  std::string reason;                                      ///< for states that need one: what is wrong and what to do
  manager::BootStatus boot = manager::BootStatus::booted;  ///< how its boot-up ended: the letter of CiA 302-2
  std::uint8_t unasked = 0;                                ///< parts of `type`: `places::SlotAsks::unasked`
  std::optional<NmtState> nmt = {};                        ///< that its device told last, by heartbeat or guarding
  std::optional<rt::Time> heard = {};                      ///< when it told that
  std::optional<EmcyReport> emcy = {};
};

/// What an event is about.
enum class EventKind : std::uint8_t {
  step,   ///< what is done now
  state,  ///< a slot's state has changed
  found,  ///< a device
  bound,
  new_device,  ///< with `when_ambiguous = "one-at-a-time"`: which slot it got
  moved,
  configured,
  restored,  ///< factory settings
  forgotten,
  question,
  duplicate,
  power_cycle_needed,
  recipe,
  emcy,       ///< a device told an error, or that its errors are gone
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
  discovered,   ///< a discovery has found a device
  bound,        ///< every slot that can be is bound, and one at least
  operational,  ///< every slot that is not optional is operational
};
inline constexpr std::size_t milestones = 3;
[[nodiscard]] const char* name(Milestone milestone) noexcept;

/// One thing that happened. `kind` is for programs, `text` for people.
struct Event {
  rt::Time at{};
  std::string bus;
  EventKind kind = EventKind::step;
  std::string slot;  ///< name, empty when no slot is concerned
  std::string text;
  std::vector<std::string> slots = {};    ///< of a "question": the slots that it is about
  std::vector<std::string> devices = {};  ///< of a "question": the LSS addresses of the devices
  bool offers_save = false;  ///< of a "question": shall the slot's device save its parameters, and be restarted?

  friend bool operator==(const Event&, const Event&) = default;
};

/// Who is NMT master of a bus that has several (`[bus.NAME.flying_master]`).
struct MasterReport {
  std::string bus;
  std::optional<manager::MasterRank> active = {};  ///< empty: they are agreeing
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

/// Seconds since the world began, as a JSON number has them.
[[nodiscard]] double seconds(rt::Time at) noexcept;

/// One JSON object: `{"slots": [{"bus", "id", "name", "type", "r_sn", "state", "since_s"}], "bus_time_s": {...},
/// "events": [...]}`. Type code and R_SN are "0x…" strings; `r_sn` is null for a slot without a device; "reason" is
/// there when it is not empty, "boot" when the boot-up ended with a letter (CiA 302-2; "L" is no error), "nmt" and
/// "heard_s" what its device told last and when, "emcy" its last error (`{"at_s", "code", "text", "register",
/// "count"}`) while that is not gone; so is
/// "questions": `[{"bus", "kind", "text", "slots", "devices"}]`, which `berth replace SLOT --device ADDRESS` answers,
/// and "masters": `[{"bus", "node", "priority", "here"}]`, the active NMT master (`node` null: not agreed) of each bus
/// that has several.
[[nodiscard]] std::string to_json(const Report& report, int indent = 2);
/// The same in pieces of some 64 KiB, one after the other: of thousands of devices the whole text, and what it is made
/// from, would take more memory than the devices.
using JsonSink = std::function<void(std::string_view piece)>;
void write_json(const Report& report, int indent, const JsonSink& out);
/// One line of JSON, for streams.
[[nodiscard]] std::string to_json(const Event& event);
[[nodiscard]] std::string to_json(const SlotReport& slot);

/// "  0.215 s  backbone  slot 2 'left': bound to ...".
[[nodiscard]] std::string to_line(const Event& event);

}  // namespace berth::operate
