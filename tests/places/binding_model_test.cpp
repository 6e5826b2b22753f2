// The binding's table explored to the end: two slots of one type, two devices, and every interleaving of Berth's steps
// with lost requests, lost answers, crashes of Berth before and after each effect, devices that lose and regain power,
// and a person who clears a slot whose device is silent. Intentions for devices without power are tried again, and
// dropped as the main job drops them. The table, the planner and `Binding::untouched` are the real ones; bus, devices
// and store are small models of what CiA 305 and `SlotStore` promise. S1.29, S1.33, S1.36, S1.53.
#include <gtest/gtest.h>
#include <algorithm>
#include <deque>
#include <optional>
#include <string>
#include <unordered_map>
#include <vector>

#include "berth/places/binding.hpp"
#include "berth/places/plan.hpp"

using namespace berth;
using namespace berth::places;

namespace {

constexpr Identity address_of[2] = {{1, 1, 0, 0x0A}, {1, 1, 0, 0x0B}};
constexpr NodeId slot_id[2] = {NodeId(1), NodeId(2)};
constexpr NodeId master(127);

// What brings a pending node-ID into use at a device that has another.
enum class Habit : std::uint8_t { reset_communication, reset_node, power_cycle };

struct Device {
  bool powered = true;
  NodeId persistent, pending, active;
  bool configuration = false;
  bool ours = false;  // `persistent` is what Berth's 17h stored, and no person has given its slot away
  Habit habit = Habit::reset_communication;
};

void power_on(Device& d) { d = Device{true, d.persistent, d.persistent, d.persistent, false, d.ours, d.habit}; }

struct State {
  Device devices[2];
  int asked[2] = {-1, -1};  // which device, per slot
  int confirmed[2] = {-1, -1};
  bool blank_asked[2] = {false, false};
  std::optional<Binding> work;
  std::size_t slot = 0;
  bool quiet = false;                // this run of Berth has sent its opening 11 FF, 04 00
  bool heard[2] = {false, false};    // a boot-up under slot i's id since its vacancy was checked
  bool avoided[2] = {false, false};  // an action for it failed in this round
  bool waits[2] = {false, false};    // for its power cycle, as this run of Berth knows
  int faults = 0;

  [[nodiscard]] std::string key() const {
    std::string k;
    const auto put = [&](unsigned v) { k.push_back(static_cast<char>(v)); };
    for (const auto& d : devices) {
      put(d.powered + 2U * d.configuration + 4U * d.ours + 8U * static_cast<unsigned>(d.habit));
      put(d.persistent.value());
      put(d.pending.value());
      put(d.active.value());
    }
    for (int i = 0; i < 2; ++i)
      put(static_cast<unsigned>((asked[i] + 1) * 16 + (confirmed[i] + 1) * 4 + blank_asked[i] * 2 + heard[i]));
    put(static_cast<unsigned>(quiet * 64 + avoided[0] * 32 + avoided[1] * 16 + faults));
    put(static_cast<unsigned>(waits[0] + 2 * waits[1]));
    if (work) {
      put(1U + static_cast<unsigned>(work->kind()));
      put(work->assignment().device == address_of[0] ? 0 : 1);
      put(work->assignment().id.value());
      put(static_cast<unsigned>(work->step()));
      put(static_cast<unsigned>(work->why()));
      put(work->old_id().value());
      put(work->staying().boots + 2U * work->staying().asked);
      put(work->tries_left() * 16 + work->staying().once * 8 + work->untouched() * 4 + work->stored() * 2 +
          work->volatile_only());
      put(static_cast<unsigned>(slot));
    }
    return k;
  }
};

int index_of(const Identity& a) { return a == address_of[0] ? 0 : 1; }

// ---- what the bus and the devices do (docs/protocols/cia305.md) ----

void switch_global_waiting(State& s) {
  for (auto& d : s.devices) {
    if (!d.powered) continue;
    d.configuration = false;
    const bool takes = !d.active.configured() && d.habit != Habit::power_cycle;
    if (takes && d.pending.configured()) d.active = d.pending;
  }
}

void note_boot(State& s, NodeId id, int except) {
  for (int i = 0; i < 2; ++i) {
    if (slot_id[i] == id && !(s.work && except >= 0 && index_of(s.work->assignment().device) == except))
      s.heard[i] = true;
  }
}

void reset(State& s, NodeId id, bool node) {
  for (auto& d : s.devices) {
    const bool takes = d.habit == Habit::reset_communication || (node && d.habit == Habit::reset_node);
    if (d.powered && d.active == id && takes) d.active = d.pending;
  }
}

bool duplicate_id(const State& s) {
  return s.devices[0].powered && s.devices[1].powered && s.devices[0].active.configured() &&
         s.devices[0].active == s.devices[1].active;
}

// ---- what Berth does: one step of the table, with its effect; gives the outcome ----

std::vector<Slot> slots_of(const State& s) {
  std::vector<Slot> slots(2);
  for (int i = 0; i < 2; ++i) {
    auto& slot = slots[static_cast<std::size_t>(i)];
    slot.spec.id = slot_id[i];
    slot.spec.type = {1, 1};
    slot.record.slot = SlotId{i + 1};
    if (s.asked[i] >= 0) slot.record.intended = Assignment{address_of[s.asked[i]], slot_id[i]};
    if (s.confirmed[i] >= 0) slot.record.confirmed = Assignment{address_of[s.confirmed[i]], slot_id[i]};
  }
  return slots;
}

// Discovery and presence: every powered device and the node-ID it uses.
std::vector<Found> found_in(const State& s) {
  std::vector<Found> found;
  for (int i = 0; i < 2; ++i) {
    if (s.devices[i].powered) found.push_back({address_of[i], s.devices[i].active});
  }
  return found;
}

std::vector<Identity> blanks_of(const State& s) {
  std::vector<Identity> blanks;
  for (int i = 0; i < 2; ++i) {
    if (s.blank_asked[i]) blanks.push_back(address_of[i]);
  }
  return blanks;
}

// The first action whose device did not fail in this round, there or not; when all did, the next round begins.
bool begin_next(State& s) {
  const auto p = plan(slots_of(s), found_in(s), blanks_of(s), master);
  const auto due = [&](const Action& a) { return !s.avoided[index_of(a.device)] && !s.waits[index_of(a.device)]; };
  auto next = std::ranges::find_if(p.actions, due);
  if (next == p.actions.end()) {
    s.avoided[0] = s.avoided[1] = false;
    next = std::ranges::find_if(p.actions, due);
  }
  if (next == p.actions.end()) return false;
  const bool bind = next->kind == Action::Kind::bind;
  const int who = index_of(next->device);
  s.slot = next->slot;
  // The store has its intention already: an earlier binding may have touched the device.
  const bool resumed = bind ? s.asked[s.slot] == who : s.blank_asked[who];
  s.work.emplace(bind ? Binding::Kind::bind : Binding::Kind::blank,
                 Assignment{next->device, bind ? slot_id[s.slot] : NodeId()}, 2U, resumed);
  return true;
}

// What the main job does with a binding that has ended: `Network::not_bound`.
void end_work(State& s) {
  const Binding& w = *s.work;
  const int who = index_of(w.assignment().device);
  const bool bind = w.kind() == Binding::Kind::bind;
  if (w.step() == Step::failed) {
    s.avoided[who] = true;
    const bool dropped = bind && s.confirmed[s.slot] < 0 && s.asked[s.slot] >= 0 && w.untouched();
    if (dropped) s.asked[s.slot] = -1;
  }
  s.waits[who] = w.step() == Step::power_cycle;
  // A node-ID that was given up may be what another one failed for.
  if (w.step() == Step::done && !bind) s.avoided[0] = s.avoided[1] = false;
  s.work.reset();
}

void advance(State& s, Outcome outcome) {
  s.work->advance(outcome);
  if (s.work->ended()) end_work(s);
}

Outcome effect(State& s) {
  Binding& w = *s.work;
  const int who = index_of(w.assignment().device);
  Device& d = s.devices[who];
  const bool bind = w.kind() == Binding::Kind::bind;
  switch (w.step()) {
    case Step::check_vacant:
      s.heard[s.slot] = false;
      for (int i = 0; i < 2; ++i) {
        if (i != who && s.devices[i].powered && s.devices[i].active == w.assignment().id) return Outcome::mismatch;
      }
      return Outcome::ok;
    case Step::write_ask:
      if (bind)
        s.asked[s.slot] = who;
      else
        s.blank_asked[who] = true;
      return Outcome::ok;
    case Step::select:
      switch_global_waiting(s);
      if (!d.powered) return Outcome::silent;
      d.configuration = true;
      return Outcome::ok;
    case Step::inquire:
      if (!d.powered || !d.configuration) return Outcome::silent;
      w.inquired(d.active);
      return Outcome::ok;
    case Step::configure:
    case Step::revert: {
      if (bind && w.step() == Step::configure && s.heard[s.slot]) return Outcome::mismatch;
      const NodeId value = w.step() == Step::configure ? w.assignment().id : w.revert_to();
      bool any = false;
      for (auto& each : s.devices) {
        if (each.powered && each.configuration) {
          each.pending = value;
          any = true;
        }
      }
      return any ? Outcome::ok : Outcome::silent;
    }
    case Step::store:
      if (bind && s.heard[s.slot]) return Outcome::mismatch;
      if (!d.powered || !d.configuration) return Outcome::silent;
      d.persistent = d.pending;
      d.ours = d.persistent.configured();
      return Outcome::ok;
    case Step::release:
      if (bind && s.heard[s.slot] && w.why() == Why::none) return Outcome::mismatch;
      switch_global_waiting(s);
      return Outcome::ok;
    case Step::reset:
      if (bind && s.heard[s.slot]) return Outcome::mismatch;
      reset(s, w.old_id(), w.staying().once);
      return Outcome::ok;
    case Step::await_boot_up: {
      if (d.powered && d.active == w.assignment().id) return Outcome::ok;
      // Whoever has the old node-ID has booted under it.
      const auto stays = [&](const Device& each) { return each.powered && each.active == w.old_id(); };
      const bool stayed = w.old_id().configured() ? stays(s.devices[0]) || stays(s.devices[1]) : !w.staying().boots;
      return stayed ? Outcome::mismatch : Outcome::silent;
    }
    case Step::identify: {
      if (!bind) {
        if (!d.powered) return Outcome::silent;
        switch_global_waiting(s);
        return d.active.configured() ? Outcome::mismatch : Outcome::ok;
      }
      bool other = false;
      for (int i = 0; i < 2; ++i)
        other = other || (i != who && s.devices[i].powered && s.devices[i].active == w.assignment().id);
      if (other) return Outcome::mismatch;
      return d.powered && d.active == w.assignment().id ? Outcome::ok : Outcome::silent;
    }
    case Step::write_confirm:
      if (bind) {
        s.asked[s.slot] = -1;
        s.confirmed[s.slot] = who;
      }
      s.blank_asked[who] = false;
      return Outcome::ok;
    default: return Outcome::error;
  }
}

void crash(State& s) {
  s.work.reset();
  s.quiet = false;
  s.heard[0] = s.heard[1] = false;
  s.avoided[0] = s.avoided[1] = false;
  s.waits[0] = s.waits[1] = false;
}

// One move of Berth without faults; false when it has nothing to do.
bool berth_move(State& s) {
  if (!s.quiet) {
    bool unfinished = false;
    for (int i = 0; i < 2; ++i) unfinished = unfinished || s.asked[i] >= 0 || s.blank_asked[i];
    for (auto& d : s.devices) {
      if (unfinished && d.powered && d.configuration) d.pending = NodeId();
    }
    switch_global_waiting(s);
    s.quiet = true;
    return true;
  }
  if (!s.work) return begin_next(s);
  advance(s, effect(s));
  return true;
}

bool settled(const State& s) {
  for (int i = 0; i < 2; ++i) {
    if (s.confirmed[i] < 0 || s.asked[i] >= 0) return false;
    const Device& d = s.devices[s.confirmed[i]];
    if (d.active != slot_id[i] || d.persistent != slot_id[i]) return false;
  }
  return s.confirmed[0] != s.confirmed[1];
}

// A person switches a device that waits for it off and on. False: none does.
bool power_cycle(State& s) {
  for (int i = 0; i < 2; ++i) {
    if (!std::exchange(s.waits[i], false)) continue;
    power_on(s.devices[i]);
    note_boot(s, s.devices[i].active, -1);
    return true;
  }
  return false;
}

// From here on nothing goes wrong and every device has power: Berth must finish.
bool finishes(State s, std::unordered_map<std::string, bool>& known) {
  for (auto& d : s.devices) {
    if (!d.powered) {
      power_on(d);
      note_boot(s, d.active, -1);
    }
  }
  std::vector<std::string> path;
  for (int moves = 0; moves < 400; ++moves) {
    const auto key = s.key();
    if (const auto it = known.find(key); it != known.end()) {
      for (const auto& k : path) known[k] = it->second;
      return it->second;
    }
    path.push_back(key);
    const bool looked_at = moves % 40 >= 36 && !s.work;  // another device may wait for what it uses meanwhile
    if (looked_at && power_cycle(s)) continue;
    if (!berth_move(s) && !power_cycle(s)) break;
  }
  const bool good = settled(s) && !duplicate_id(s);
  for (const auto& k : path) known[k] = good;
  return good;
}

struct Explored {
  std::size_t states = 0;
  std::size_t caused = 0;     // Berth made two devices hold one node-ID
  std::size_t stuck = 0;      // no way to the end
  std::size_t two_seats = 0;  // one device in two slots
  std::size_t forgotten = 0;  // a memory has a slot's node-ID by Berth, and the slot does not say so
  std::string example;
};

Explored explore(const State& start, int budget) {
  Explored result;
  std::unordered_map<std::string, bool> seen;
  std::unordered_map<std::string, bool> known;
  std::deque<State> queue{start};
  seen[start.key()] = true;
  const auto visit = [&](const State& next) {
    if (seen.emplace(next.key(), true).second) queue.push_back(next);
  };
  const auto by_berth = [&](const State& before, const State& next) {
    if (!duplicate_id(before) && duplicate_id(next)) {
      ++result.caused;
      if (result.example.empty() && before.work) result.example = name(before.work->step());
    }
    visit(next);
  };
  while (!queue.empty()) {
    const State s = queue.front();
    queue.pop_front();
    ++result.states;
    if (!finishes(s, known)) {
      if (result.stuck++ == 0 && result.example.empty()) result.example = s.work ? name(s.work->step()) : "idle";
    }
    const auto seat = [&](int i) { return s.asked[i] >= 0 ? s.asked[i] : s.confirmed[i]; };
    if (seat(0) >= 0 && seat(0) == seat(1)) ++result.two_seats;
    for (int i = 0; i < 2; ++i) {
      for (int d = 0; d < 2; ++d)
        result.forgotten += s.devices[d].ours && s.devices[d].persistent == slot_id[i] && seat(i) != d;
    }

    State done = s;
    if (berth_move(done)) by_berth(s, done);
    if (s.faults >= budget) continue;
    State faulty = s;
    ++faulty.faults;
    {  // Berth dies before the effect
      State next = faulty;
      crash(next);
      visit(next);
    }
    if (s.work) {
      const Step step = s.work->step();
      State next = faulty;
      (void)effect(next);
      State died = next;  // dies after the effect, before it knew
      crash(died);
      by_berth(s, died);
      const bool on_lss =
          step == Step::select || step == Step::inquire || step == Step::configure || step == Step::store;
      const bool answered = on_lss || step == Step::identify;
      if (answered) {  // the answer is lost
        next.work = s.work;
        advance(next, Outcome::silent);
        by_berth(s, next);
      }
      if (answered && step != Step::select) {  // the request is lost
        State lost = faulty;
        advance(lost, Outcome::silent);
        by_berth(s, lost);
      }
    }
    for (int i = 0; i < 2; ++i) {  // power
      State next = faulty;
      Device& d = next.devices[i];
      next.waits[i] = false;
      if (d.powered) {
        d.powered = false;
        d.configuration = false;
      } else {
        power_on(d);
        note_boot(next, d.active, i);
      }
      visit(next);
    }
    for (int i = 0; i < 2; ++i) {  // berth replace
      const int who = seat(i);
      if (who < 0 || s.devices[who].powered || s.work) continue;
      State next = faulty;
      next.asked[i] = next.confirmed[i] = -1;
      next.waits[who] = false;
      next.devices[who].ours = false;
      visit(next);
    }
  }
  return result;
}

State with_ids(NodeId a, NodeId b) {
  State s;
  for (int i = 0; i < 2; ++i) {
    const NodeId id = i == 0 ? a : b;
    s.devices[i].persistent = s.devices[i].pending = s.devices[i].active = id;
  }
  return s;
}

void expect_sound(const State& start, int budget, const char* what) {
  const auto e = explore(start, budget);
  std::printf("%s: %zu states\n", what, e.states);
  EXPECT_EQ(e.caused, 0U) << what << " at " << e.example;
  EXPECT_EQ(e.stuck, 0U) << what << " at " << e.example;
  EXPECT_EQ(e.two_seats, 0U) << what;
  EXPECT_EQ(e.forgotten, 0U) << what;
  EXPECT_GT(e.states, 100U) << what;
}

}  // namespace

// S1.53
TEST(BindingModel, S1_53_BlankDevicesThroughEveryCrashAndLoss) {
  expect_sound(with_ids(NodeId(), NodeId()), 6, "both blank");
}

// S1.36: they come with node-IDs of another plant, right, wrong, swapped and equal.
TEST(BindingModel, S1_36_DevicesThatComeWithNodeIds) {
  const NodeId none;
  const NodeId one(1);
  const NodeId two(2);
  const NodeId far(77);
  const std::pair<NodeId, NodeId> starts[] = {{one, two},  {two, one},  {one, one}, {two, two},
                                              {none, one}, {two, none}, {far, one}, {far, far}};
  for (const auto& [a, b] : starts) {
    const auto what = std::to_string(a.value()) + " and " + std::to_string(b.value());
    expect_sound(with_ids(a, b), 5, what.c_str());
  }
}

// Devices that boot under their old node-ID when their communication is reset: some take the new one when the node is,
// some when they are switched off and on only.
TEST(BindingModel, S1_36_DevicesThatAResetDoesNotMove) {
  const NodeId none;
  const NodeId one(1);
  const NodeId two(2);
  const NodeId far(77);
  const std::pair<NodeId, NodeId> starts[] = {{two, one}, {one, one}, {far, none},
                                              {far, one}, {far, far}, {none, none}};
  for (const auto habit : {Habit::reset_node, Habit::power_cycle}) {
    for (const bool both : {false, true}) {
      for (const auto& [a, b] : starts) {
        State s = with_ids(a, b);
        s.devices[0].habit = habit;
        if (both) s.devices[1].habit = habit;
        const auto what = std::to_string(a.value()) + " and " + std::to_string(b.value()) +
                          (habit == Habit::reset_node ? ", reset node" : ", power cycle") + (both ? ", both" : "");
        expect_sound(s, 4, what.c_str());
      }
    }
  }
}

// The judge can find something: a table that confirms before it identified, or skips the vacancy check, is caught.
TEST(BindingModel, WithoutOpeningRevertADuplicateIsFound) {
  State s = with_ids(NodeId(), NodeId(1));
  // A run of Berth died with device 0 in configuration and slot 1's node-ID pending there; device 1 came with that id.
  s.devices[0].configuration = true;
  s.devices[0].pending = NodeId(1);
  s.asked[0] = 0;
  s.quiet = true;  // and this run did not begin with 11 FF
  EXPECT_GT(explore(s, 0).caused, 0U);
  s.quiet = false;
  EXPECT_EQ(explore(s, 0).caused, 0U);
}
