#include <SQLiteCpp/Database.h>
#include <gtest/gtest.h>
#include <algorithm>
#include <array>
#include <cstdint>
#include <cstdio>
#include <functional>
#include <map>
#include <optional>
#include <string>
#include <vector>

#include "berth/store/database.hpp"
#include "berth/store/schema.hpp"
#include "tests/pch.hpp"
#include "tests/store/crash_vfs.hpp"

namespace berth::store {
namespace {

using places::Assignment;
using places::SlotId;
using places::SlotRecord;

constexpr const char* file = "/berth.db";

LssAddress device(std::uint32_t serial) { return {1, 1, 0, serial}; }

/// The value itself: a loop over `result.value()` of a temporary would dangle.
template <class T>
T must(Result<T> result) {
  return std::move(result).value();
}

/// All that a store says, to compare two of them.
struct State {
  std::vector<std::string> lines;
  friend bool operator==(const State&, const State&) = default;
};

std::string shown(const std::optional<Assignment>& seat) {
  return seat ? to_string(seat->device) + "@" + std::to_string(seat->id.value()) : "-";
}

std::string shown(const std::optional<places::Configured>& c) {
  return c ? std::string(name(c->stage)) + " " + to_string(c->device) + " " + std::to_string(c->days) : "-";
}

State state_of(places::SlotStore& store) {
  State state;
  for (const auto& r : must(store.load("m"))) {
    state.lines.push_back(std::to_string(r.slot.value) + " " + r.name.name + " " + shown(r.intended) + " " +
                          shown(r.confirmed) + " " + shown(r.configured));
  }
  for (const auto& b : must(store.unfinished_blanks())) state.lines.push_back("blank " + to_string(b.device) + b.bus);
  for (const auto& m : must(store.marked(places::Mark::restore)))
    state.lines.push_back("used " + to_string(m.device) + m.on.bus);
  for (const auto& l : must(store.lent())) state.lines.push_back("lent " + to_string(l.device) + l.bus);
  for (const auto& h : must(store.history(std::nullopt))) {
    state.lines.push_back(std::to_string(h.sequence) + " " + h.event + " " + h.reason + " " + h.on.bus);
  }
  return state;
}

using Step = std::function<bool(places::SlotStore&)>;

/// A binding of two slots, a replacement, a blanking, and all of it of a twin on another bus: every call that Berth
/// makes.
std::vector<Step> binding() {
  using Stage = places::Configured::Stage;
  const Assignment a{device(5), NodeId(2)};
  const Assignment b{device(6), NodeId(4)};
  const Assignment c{device(0x15), NodeId(2)};
  const places::BusDevice five{device(5), {"m", "b"}};
  const places::BusDevice twin{device(5), {"m", "c"}};
  const places::BusDevice used{c.device, {"m", "b"}};
  return {
      [](auto& s) {
        return s.declare({"m", "b", "left"}).has_value();
      },
      [](auto& s) {
        return s.declare({"m", "b", "right"}).has_value();
      },
      [=](auto& s) { return s.ask(SlotId{1}, a, "discovered").has_value(); },
      [=](auto& s) { return s.confirm(SlotId{1}, a, "heard").has_value(); },
      [=](auto& s) { return s.ask(SlotId{2}, b, "discovered").has_value(); },
      [=](auto& s) { return s.confirm(SlotId{2}, b, "heard").has_value(); },
      [=](auto& s) {
        return s.configure(SlotId{2}, {Stage::writing, device(6), 15'000, 1}, "b.dcf").has_value();
      },
      [=](auto& s) {
        return s.configure(SlotId{1}, {Stage::writing, device(5), 15'000, 1}, "a.dcf").has_value();
      },
      [=](auto& s) {
        return s.configure(SlotId{1}, {Stage::power_cycle, device(5), 15'000, 1}, "a.dcf").has_value();
      },
      [=](auto& s) {
        return s.configure(SlotId{2}, {Stage::done, device(6), 15'000, 1}, "b.dcf").has_value();
      },
      [=](auto& s) { return s.clear(SlotId{1}, "replaced by a person").has_value(); },
      [=](auto& s) {
        return s.ask_blank({device(5), "m", "b", NodeId(2)}, "found with a wrong node-ID").has_value();
      },
      [=](auto& s) { return s.ask(SlotId{1}, c, std::string(9000, 'x')).has_value(); },  // more than one page
      [=](auto& s) { return s.confirm_blank(five, "heard").has_value(); },
      [=](auto& s) { return s.mark(places::Mark::restore, used, c.id, "used").has_value(); },
      [=](auto& s) { return s.confirm(SlotId{1}, c, "heard").has_value(); },
      [=](auto& s) { return s.unmark(places::Mark::restore, used, "has its factory settings").has_value(); },
      [](auto& s) {
        return s.declare({"m", "c", "twin"}).has_value();
      },
      [=](auto& s) {
        return s.ask_blank({device(5), "m", "b", NodeId(2)}, "it is back").has_value();
      },
      [=](auto& s) {
        return s.lend({device(5), "m", "b", NodeId(126)}).has_value();
      },
      [=](auto& s) {
        return s.ask_blank({device(5), "m", "c", NodeId(9)}, "found with a wrong node-ID").has_value();
      },
      [=](auto& s) {
        return s.lend({device(5), "m", "c", NodeId(125)}).has_value();
      },
      [=](auto& s) { return s.mark(places::Mark::restore, twin, a.id, "used").has_value(); },
      [=](auto& s) { return s.ask(SlotId{3}, a, "discovered").has_value(); },
      [=](auto& s) { return s.confirm(SlotId{3}, a, "heard").has_value(); },
      [=](auto& s) { return s.give_back(twin).has_value(); },
      [=](auto& s) { return s.unmark(places::Mark::restore, twin, "has its factory settings").has_value(); },
  };
}

/// states[n]: what the store says after n steps, by the memory store.
std::vector<State> states_of(const std::vector<Step>& steps) {
  places::MemoryStore store;
  std::vector<State> states{state_of(store)};
  for (const auto& step : steps) {
    EXPECT_TRUE(step(store));
    states.push_back(state_of(store));
  }
  return states;
}

std::unique_ptr<Database> open_on(const CrashVfs& disk) {
  auto opened = Database::open(file, {.vfs = disk.name(), .lock = false});
  if (!opened) return nullptr;
  return std::move(*opened);
}

/// Runs the steps from `from` on; how many of all are done then.
std::size_t run_on(const CrashVfs& disk, const std::vector<Step>& steps, std::size_t from) {
  auto store = open_on(disk);
  std::size_t done = from;
  if (store == nullptr) return done;
  while (done < steps.size() && steps[done](*store)) ++done;
  return done;
}

/// A crash at one step of the disk, and how many steps of the binding were done by then.
struct Crashed {
  CrashVfs::Moment disk;
  std::size_t done = 0;
};

/// What a crash leaves at each step that the disk takes from an empty one to the end of the binding, closing included.
std::vector<Crashed> crashes_of(CrashVfs& disk, const std::vector<Step>& steps) {
  std::vector<CrashVfs::Moment> moments;
  std::vector<std::size_t> behind;  // moments before the end of each step
  disk.format();
  disk.record(&moments);
  {
    auto store = open_on(disk);
    EXPECT_NE(store, nullptr);
    for (const auto& step : steps) {
      EXPECT_TRUE(step(*store));
      behind.push_back(moments.size());
    }
  }
  disk.record(nullptr);
  std::vector<Crashed> crashes;
  for (auto& moment : moments) {
    const auto done = std::upper_bound(behind.begin(), behind.end(), crashes.size()) - behind.begin();
    crashes.push_back({std::move(moment), static_cast<std::size_t>(done)});
  }
  return crashes;
}

/// The state found must be the one before or after the step in which the power went; gives how many steps it holds.
std::size_t check_found(const CrashVfs& disk, const std::vector<State>& states, std::size_t done,
                        const std::string& where) {
  auto opened = Database::open(file, {.vfs = disk.name(), .lock = false});
  EXPECT_TRUE(opened) << where << ": " << (opened ? "" : opened.error().message);
  if (!opened) return done;
  const auto found = state_of(**opened);
  if (found == states[done]) return done;
  const bool after = done + 1 < states.size() && found == states[done + 1];
  EXPECT_TRUE(after) << where << ": neither the state after " << done << " steps nor after the next";
  return done + 1;
}

constexpr std::array<Loss, 5> losses{Loss::all, Loss::all_torn_last, Loss::none, Loss::none_torn_last, Loss::some};

// S1.53: what was asked and what was confirmed survive a crash at every write, sync and deletion k of a binding, with
// whatever was not synced lost or torn; the next start goes on from there and comes to the same end.
TEST(Crash, S1_53_BeforeOrAfterEachTransactionForEveryK) {
  CrashVfs disk("crash-every-k");
  const auto steps = binding();
  const auto states = states_of(steps);
  const auto crashes = crashes_of(disk, steps);
  Random random(1);
  std::uint64_t points = 0;
  for (const auto loss : losses) {
    for (std::size_t k = 0; k < crashes.size(); ++k) {
      ++points;
      const auto where = "loss " + std::to_string(static_cast<int>(loss)) + " k " + std::to_string(k);
      disk.put_back(crashes[k].disk);
      disk.after_crash(loss, random);
      const auto done = check_found(disk, states, crashes[k].done, where);
      if (k % 4 == 0) {
        EXPECT_EQ(run_on(disk, steps, done), steps.size()) << where;
        EXPECT_EQ(check_found(disk, states, steps.size(), where), steps.size()) << where;
      }
      if (HasFailure()) return;
    }
  }
  std::printf("%llu crash points\n", static_cast<unsigned long long>(points));
  EXPECT_GT(points, 5 * steps.size() * 2);
}

/// A store as a Berth of schema 6 left it, with a row in every table.
void leave_schema_six(const CrashVfs& disk) {
  SQLite::Database raw(std::string(file), SQLite::OPEN_READWRITE | SQLite::OPEN_CREATE, 0, disk.name());
  raw.exec("PRAGMA synchronous = EXTRA");  // else the journal's deletion, and with it the last row, may be lost
  create_schema(raw, 6);
  raw.exec(
      "INSERT INTO slots (machine, bus, name) VALUES ('m', 'b', 'left'), ('m', 'b', 'right');"
      "INSERT INTO seats VALUES (1, 'asked', 1, 1, 0, 5, 2), (1, 'confirmed', 1, 1, 0, 5, 2),"
      " (2, 'confirmed', 1, 1, 0, 6, 4);"
      "INSERT INTO blanks (vendor, product, revision, serial, machine, bus, node_id) VALUES (1, 1, 0, 9, 'm', 'b', 7);"
      "INSERT INTO marks VALUES (1, 1, 0, 6, 0, 4);"
      "INSERT INTO loans VALUES (1, 1, 0, 8, 'm', 'b', 126);"
      "INSERT INTO history (stamp_ms, slot, event, vendor, product, revision, serial, node_id, reason) VALUES"
      " (1, 1, 'confirmed', 1, 1, 0, 5, 2, 'heard'), (2, NULL, 'restored', 1, 1, 0, 6, 255, 'done');");
}

// A store of before is brought to today's schema in one transaction: the power goes at every write, sync and deletion
// of it, and the next start finds all that was there, nothing twice.
TEST(Crash, InTheMiddleOfBeingBroughtToTodaysSchema) {
  CrashVfs disk("crash-migration");
  leave_schema_six(disk);
  const State whole = state_of(*open_on(disk));
  ASSERT_EQ(whole.lines.size(), 7U) << "two slots, a blank, a mark, a loan and two lines";
  std::vector<CrashVfs::Moment> crashes;
  disk.format();
  leave_schema_six(disk);
  disk.record(&crashes);
  open_on(disk);
  disk.record(nullptr);
  Random random(3);
  for (const auto loss : losses) {
    for (std::size_t k = 0; k < crashes.size(); ++k) {
      disk.put_back(crashes[k]);
      disk.after_crash(loss, random);
      const auto found = open_on(disk);
      ASSERT_NE(found, nullptr) << "loss " << static_cast<int>(loss) << " k " << k;
      ASSERT_EQ(state_of(*found).lines, whole.lines) << "loss " << static_cast<int>(loss) << " k " << k;
    }
  }
  std::printf("%zu crash points\n", losses.size() * crashes.size());
  EXPECT_GT(losses.size() * crashes.size(), 100U);
}

// The power goes again while the store recovers: at every step of it.
TEST(Crash, AgainDuringRecovery) {
  CrashVfs disk("crash-twice");
  const auto steps = binding();
  const auto states = states_of(steps);
  const auto crashes = crashes_of(disk, steps);
  Random random(2);
  std::uint64_t points = 0;
  for (std::size_t k = 0; k < crashes.size(); k += 11) {
    disk.put_back(crashes[k].disk);
    disk.after_crash(losses.at(k / 11 % losses.size()), random);
    std::vector<CrashVfs::Moment> again;
    disk.record(&again);
    // Opening, one read and closing: recovery and checkpoint.
    if (auto store = open_on(disk)) (void)store->load("m");
    disk.record(nullptr);
    for (std::size_t j = 0; j < again.size(); ++j) {
      ++points;
      disk.put_back(again[j]);
      disk.after_crash(losses.at(random.below(losses.size())), random);
      const auto where = "k " + std::to_string(k) + " then " + std::to_string(j);
      const auto done = check_found(disk, states, crashes[k].done, where);
      EXPECT_EQ(run_on(disk, steps, done), steps.size()) << where;
      if (HasFailure()) return;
    }
  }
  std::printf("%llu double crash points\n", static_cast<unsigned long long>(points));
  EXPECT_GT(points, 50U);
}

// A full disk: the call says so, nothing has changed, and the store works on when there is room again.
TEST(Crash, AFullDiskChangesNothing) {
  CrashVfs disk("full-disk");
  const auto steps = binding();
  const auto states = states_of(steps);
  std::uint64_t refused = 0;
  for (std::uint64_t k = 0; k < 200; ++k) {
    disk.format();
    auto store = open_on(disk);
    ASSERT_NE(store, nullptr);
    disk.full_at(k);
    for (std::size_t i = 0; i < steps.size(); ++i) {
      if (steps[i](*store)) continue;
      ++refused;
      EXPECT_EQ(state_of(*store), states[i]) << "k " << k << " step " << i;
      EXPECT_TRUE(steps[i](*store)) << "k " << k << " step " << i;
    }
    EXPECT_EQ(state_of(*store), states.back()) << "k " << k;
    if (HasFailure()) return;
  }
  EXPECT_GT(refused, 20U);
}

/// All but the bytes themselves: SQLite salts its journals with numbers that no run has twice.
std::string shape_of(const std::map<std::string, CrashVfs::File>& files) {
  std::string shape;
  for (const auto& [name, file] : files) {
    shape += name + ": " + std::to_string(file.synced.size()) + " of " + std::to_string(file.now.size()) +
             " bytes synced" + (file.exists ? ", exists" : "") + (file.exists_synced ? ", safely" : "") + "; waiting";
    for (const auto& change : file.pending) {
      shape += " " + std::to_string(change.bytes.size()) + (change.truncate ? " cut at " : " at ") +
               std::to_string(change.at);
    }
    shape += "\n";
  }
  return shape;
}

// What the tests above put back is what the process that ran into the crash leaves, whatever it tried afterwards.
TEST(Crash, APutBackMomentIsTheDiskThatACrashLeaves) {
  CrashVfs disk("crash-moment");
  const auto steps = binding();
  const auto crashes = crashes_of(disk, steps);
  for (std::size_t k = 0; k < crashes.size(); k += 13) {
    disk.format();
    disk.crash_at(k);
    const auto done = run_on(disk, steps, 0);
    ASSERT_TRUE(disk.crashed()) << "k " << k;
    EXPECT_EQ(shape_of(disk.files()), shape_of(crashes[k].disk.files)) << "k " << k;
    EXPECT_GE(done, crashes[k].done) << "k " << k;
    EXPECT_LE(done, crashes[k].done + 1) << "k " << k;
  }
  disk.format();
  disk.crash_at(crashes.size());
  EXPECT_EQ(run_on(disk, steps, 0), steps.size());
  EXPECT_FALSE(disk.crashed()) << "a step more than were put back";
}

// The disk itself can lose: without a sync it must, else the tests above prove nothing.
TEST(Crash, TheDiskLosesWhatWasNotSynced) {
  CrashVfs disk("losing-disk");
  Random random(3);
  sqlite3* db = nullptr;
  ASSERT_EQ(sqlite3_open_v2(file, &db, SQLITE_OPEN_READWRITE | SQLITE_OPEN_CREATE, disk.name().c_str()), SQLITE_OK);
  ASSERT_EQ(sqlite3_exec(db, "PRAGMA synchronous = OFF; CREATE TABLE t (x); INSERT INTO t VALUES (1);", nullptr,
                         nullptr, nullptr),
            SQLITE_OK);
  disk.crash_at(0);
  sqlite3_exec(db, "INSERT INTO t VALUES (2);", nullptr, nullptr, nullptr);
  sqlite3_close(db);
  ASSERT_TRUE(disk.crashed());
  disk.after_crash(Loss::all, random);
  EXPECT_TRUE(disk.files().empty());
}

}  // namespace
}  // namespace berth::store
