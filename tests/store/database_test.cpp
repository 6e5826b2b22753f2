#include "berth/store/database.hpp"

#include <SQLiteCpp/Database.h>
#include <fcntl.h>
#include <gtest/gtest.h>
#include <rapidcheck/gtest.h>
#include <sys/file.h>
#include <sys/stat.h>
#include <sys/wait.h>
#include <unistd.h>
#include <algorithm>
#include <cstdint>
#include <optional>
#include <stdexcept>
#include <string>
#include <vector>

#include <filesystem>
#include <fstream>
#include <iterator>

#include "berth/base/random.hpp"
#include "berth/store/file_lock.hpp"
#include "berth/store/schema.hpp"
#include "tests/pch.hpp"

namespace berth::store::database_tests {
namespace {

namespace fs = std::filesystem;
using places::Assignment;
using places::HistoryEntry;
using places::MemoryStore;
using places::SlotId;

class Folder {
 public:
  Folder() {
    // In memory where the system has such a folder: these tests open many stores, and each write is synced.
    const bool memory = ::access("/dev/shm", W_OK | X_OK) == 0;
    const fs::path root = memory ? fs::path("/dev/shm") : fs::temp_directory_path();
    std::string pattern = (root / "berth-store-XXXXXX").string();
    if (::mkdtemp(pattern.data()) == nullptr) throw std::runtime_error("no folder for stores: " + pattern);
    path_ = pattern;
  }
  ~Folder() { fs::remove_all(path_); }
  [[nodiscard]] std::string file(const char* name = "berth.db") const { return (path_ / name).string(); }

 private:
  fs::path path_;
};

std::string bytes_of(const std::string& path) {
  std::ifstream in(path, std::ios::binary);
  return {std::istreambuf_iterator<char>(in), std::istreambuf_iterator<char>()};
}

void write_bytes(const std::string& path, const std::string& bytes) {
  std::ofstream(path, std::ios::binary | std::ios::trunc) << bytes;
}

std::unique_ptr<Database> must_open(const std::string& path) {
  auto opened = Database::open(path);
  EXPECT_TRUE(opened) << (opened ? "" : opened.error().message);
  return opened ? std::move(*opened) : nullptr;
}

LssAddress device(std::uint32_t serial) { return {0x01000001, 1, 0, serial}; }

TEST(Store, KeepsEverythingOverARestart) {
  const Folder folder;
  const Assignment seat{{0xFFFFFFFF, 0x80000000, 7, 0xFFFFFFFF}, NodeId(127)};
  {
    auto store = must_open(folder.file());
    store->stamp(1234);
    const auto slot = store->declare({"m", "b", "left \xC3\xA4"}).value();
    EXPECT_EQ(store->declare({"m", "b", "left \xC3\xA4"}).value(), slot);
    ASSERT_TRUE(store->ask(slot, seat, "because"));
    ASSERT_TRUE(store->confirm(slot, seat, "heard"));
    ASSERT_TRUE(store->ask(slot, {seat.device, NodeId(126)}, "again"));
    ASSERT_TRUE(store->ask_blank({device(9), "m", "b", NodeId(5)}, "stray"));
    ASSERT_TRUE(store->note({0, 0, std::nullopt, "note", std::nullopt, NodeId(), "by hand"}));
  }
  EXPECT_FALSE(fs::exists(folder.file() + "-wal"));
  auto store = must_open(folder.file());
  const auto records = store->load("m").value();
  ASSERT_EQ(records.size(), 1U);
  EXPECT_EQ(records[0].name.name, "left \xC3\xA4");
  EXPECT_EQ(records[0].confirmed, seat);
  EXPECT_EQ(records[0].intended, (Assignment{seat.device, NodeId(126)}));
  EXPECT_EQ(store->unfinished_blanks().value(),
            (std::vector<places::UnfinishedBlank>{{device(9), "m", "b", NodeId(5)}}));
  const auto history = store->history(std::nullopt).value();
  std::vector<std::string> events;
  for (const auto& line : history) events.push_back(line.event);
  EXPECT_EQ(events, (std::vector<std::string>{"declared", "asked", "confirmed", "asked", "blank asked", "note"}));
  for (std::size_t i = 0; i < history.size(); ++i) EXPECT_EQ(history[i].sequence, static_cast<std::int64_t>(i) + 1);
  EXPECT_EQ(history[1].device, seat.device);
  EXPECT_EQ(history[1].id, NodeId(127));
  EXPECT_EQ(history[1].stamp_ms, 1234);
  EXPECT_EQ(history[1].reason, "because");
  EXPECT_EQ(store->history(records[0].slot).value().size(), 4U);
  EXPECT_TRUE(store->load("other").value().empty());
  EXPECT_EQ(store->load(places::SlotId{2}).error().code, Errc::not_found);
  EXPECT_EQ(store->devices().value().size(), 2U);
}

TEST(Store, ManySlotsAtOnceOldAndNewInTheirOrder) {
  const Folder folder;
  auto store = must_open(folder.file());
  const auto b = store->declare({"m", "b", "b"}).value();
  const std::vector<places::SlotName> names{{"m", "b", "a"}, {"m", "b", "b"}, {"m", "b", "c"}, {"m", "b", "a"}};
  const auto slots = store->declare_all(names).value();
  ASSERT_EQ(slots.size(), 4U);
  EXPECT_EQ(slots[1], b);
  EXPECT_EQ(slots[3], slots[0]);
  EXPECT_EQ(store->declare_all(names).value(), slots);
  EXPECT_EQ(store->history(std::nullopt).value().size(), 3U);
  EXPECT_TRUE(store->declare_all({}).value().empty());
}

TEST(Store, DevicesSeenAreCountedByTheirHistory) {
  const Folder folder;
  auto store = must_open(folder.file());
  store->stamp(10);
  const auto slot = store->declare({"m", "b", "s"}).value();
  ASSERT_TRUE(store->ask(slot, {device(5), NodeId(2)}, ""));
  store->stamp(20);
  ASSERT_TRUE(store->confirm(slot, {device(5), NodeId(2)}, ""));
  ASSERT_TRUE(store->clear(slot, ""));
  store->stamp(30);
  ASSERT_TRUE(store->ask_blank({device(4), "m", "b", NodeId()}, ""));
  EXPECT_EQ(store->devices().value(), (std::vector<DeviceSeen>{{device(4), 30, 30, 1}, {device(5), 10, 20, 3}}));
}

/// The value itself: a loop over `result.value()` of a temporary would dangle.
template <class T>
T must(Result<T> result) {
  return std::move(result).value();
}

std::string shown(const std::optional<places::Configured>& c) {
  if (!c) return "-";
  return std::string(name(c->stage)) + to_string(c->device) + "/" + std::to_string(c->days) + "/" +
         std::to_string(c->ms);
}

const std::vector<places::BusName> buses{{"m", "a"}, {"m", "b"}, {"n", "a"}};

// Few devices, and their twins on three buses of two machines.
std::vector<places::BusDevice> everyone() {
  std::vector<places::BusDevice> all;
  for (std::uint32_t serial = 0; serial < 3; ++serial) {
    for (const auto& bus : buses) all.push_back({device(serial), bus});
  }
  return all;
}

std::vector<std::string> all_of(places::SlotStore& store) {
  std::vector<std::string> out;
  const auto seat = [](const std::optional<Assignment>& s) {
    return s ? to_string(s->device) + "@" + std::to_string(s->id.value()) : std::string("-");
  };
  for (const char* machine : {"m", "n"}) {
    for (const auto& r : must(store.load(machine))) {
      out.push_back(std::to_string(r.slot.value) + r.name.machine + r.name.bus + r.name.name + seat(r.intended) +
                    seat(r.confirmed) + shown(r.configured));
      const auto same = must(store.load(r.slot));
      RC_ASSERT(same.slot == r.slot && same.name == r.name && same.intended == r.intended);
      RC_ASSERT(same.confirmed == r.confirmed && same.configured == r.configured);
      for (const auto& h : must(store.history(r.slot))) out.push_back(std::to_string(h.sequence));
    }
  }
  for (const auto& b : must(store.unfinished_blanks())) {
    out.push_back(to_string(b.device) + b.machine + b.bus + std::to_string(b.id.value()));
  }
  for (const auto& l : must(store.lent())) {
    out.push_back("lent" + to_string(l.device) + l.machine + l.bus + std::to_string(l.id.value()));
  }
  for (const auto mark : {places::Mark::restore, places::Mark::fixed}) {
    const auto marked = must(store.marked(mark));
    for (const auto& m : marked) {
      out.push_back(std::string(name(mark)) + to_string(m.device) + m.on.machine + m.on.bus +
                    std::to_string(m.id.value()));
    }
    for (const auto& who : everyone()) {
      const bool among = std::ranges::any_of(
          marked, [&](const places::Marked& m) { return m.device == who.device && m.on.covers(who.on); });
      RC_ASSERT(must(store.is_marked(mark, who)) == among);
    }
  }
  for (const auto& who : everyone()) {
    for (const auto& h : must(store.history_of(who))) out.push_back(std::to_string(h.sequence));
    const auto sat = places::former_seat(must(store.history_of(who)));
    out.push_back(sat ? std::to_string(sat->slot.value) + "until" + std::to_string(sat->until_ms) : "-");
  }
  for (const auto& h : must(store.history(std::nullopt))) {
    out.push_back(std::to_string(h.sequence) + "," + std::to_string(h.stamp_ms) + "," +
                  (h.slot ? std::to_string(h.slot->value) : "-") + h.event + (h.device ? to_string(*h.device) : "-") +
                  std::to_string(h.id.value()) + h.reason + h.on.machine + h.on.bus);
  }
  return out;
}

/// One call with random arguments; the error's code, or nothing.
std::optional<Errc> random_call(places::SlotStore& store, Random r) {
  const SlotId slot{static_cast<std::int64_t>(r.below(8))};
  const Assignment seat{device(static_cast<std::uint32_t>(r.below(3))),
                        NodeId(static_cast<std::uint8_t>(1 + r.below(2)))};
  // Now and then on no bus, as rows of before schema 7 are.
  const places::BusName bus = r.chance(100'000) ? places::BusName() : buses[r.below(buses.size())];
  const places::BusDevice who{seat.device, bus};
  const auto code = [](const auto& result) { return result ? std::nullopt : std::optional(result.error().code); };
  store.stamp(static_cast<std::int64_t>(r.below(1000)));
  const auto mark = static_cast<places::Mark>(r.below(2));
  switch (r.below(14)) {
    case 13: return code(store.lend({seat.device, bus.machine, bus.bus, seat.id}));
    case 12: return code(store.give_back(who));
    case 11: return code(store.drop_blank(who, "gone for good"));
    case 9: return code(store.mark(mark, who, seat.id, "seen"));
    case 10: return code(store.unmark(mark, who, "done"));
    case 0: return code(store.declare({bus.machine, bus.bus, std::to_string(r.below(3))}));
    case 1:
    case 2: return code(store.ask(slot, seat, "why"));
    case 3:
    case 4: return code(store.confirm(slot, seat, "heard"));
    case 5: return code(store.clear(slot, "gone"));
    case 6:
      return r.chance(500'000) ? code(store.ask_blank({seat.device, bus.machine, bus.bus, seat.id}, "x"))
                               : code(store.confirm_blank(who, "y"));
    case 7: {
      const auto stage = static_cast<places::Configured::Stage>(r.below(3));
      return code(store.configure(slot, {stage, seat.device, static_cast<std::uint32_t>(r.next()), 86'399'999}, "dcf"));
    }
    default: {
      const bool there = slot.value >= 1 && slot.value <= 6;  // and was from the beginning on
      const auto place = there && r.chance(500'000) ? std::optional(slot) : std::nullopt;
      return code(store.note({7, 8, place, "note", seat.device, seat.id, std::string("a\0b", 3), bus}));
    }
  }
}

// The two stores are judged against each other: same answers, same refusals, same history, restarts between.
RC_GTEST_PROP(Store, DoesWhatTheMemoryStoreDoes, (std::uint64_t seed)) {
  const Folder folder;
  MemoryStore memory;
  auto store = must_open(folder.file());
  Random random(seed);
  // Two slots on each bus.
  for (const auto& bus : buses) {
    for (const char* name : {"0", "1"}) {
      RC_ASSERT(store->declare({bus.machine, bus.bus, name}) && memory.declare({bus.machine, bus.bus, name}));
    }
  }
  for (int i = 0; i < 40; ++i) {
    const Random call = random.fork();
    RC_ASSERT(random_call(*store, call) == random_call(memory, call));
    if (random.chance(50'000)) {
      store.reset();
      store = must_open(folder.file());
    }
  }
  RC_ASSERT(all_of(*store) == all_of(memory));
}

TEST(Store, HistoryIsNeverRewritten) {
  const Folder folder;
  {
    auto store = must_open(folder.file());
    ASSERT_TRUE(store->declare({"m", "b", "s"}));
  }
  SQLite::Database raw(folder.file(), SQLite::OPEN_READWRITE);
  EXPECT_THROW(raw.exec("UPDATE history SET reason = 'nicer'"), SQLite::Exception);
  EXPECT_THROW(raw.exec("DELETE FROM history"), SQLite::Exception);
}

TEST(Store, OneOwnerAtATimeNamedByItsProcessId) {
  const Folder folder;
  auto store = must_open(folder.file());
  const auto second = Database::open(folder.file());
  ASSERT_FALSE(second);
  EXPECT_EQ(second.error().error.code, Errc::exhausted);
  EXPECT_NE(second.error().message.find("process " + std::to_string(::getpid()) + " uses this store"),
            std::string::npos)
      << second.error().message;
  // The same file by another name is the same store.
  fs::create_symlink(folder.file(), folder.file("link.db"));
  EXPECT_FALSE(Database::open(folder.file("link.db")));
  store.reset();
  EXPECT_TRUE(Database::open(folder.file()));
}

// Another user must not read a slot table, and must not lock it: that would stop Berth's next start.
TEST(Store, ItsFilesAreThisUsersAlone) {
  const mode_t before = ::umask(0);
  for (const bool shared : {false, true}) {
    const Folder folder;
    ASSERT_EQ(::chmod(fs::path(folder.file()).parent_path().c_str(), shared ? 02770 : 0700), 0);
    const auto store = must_open(folder.file());
    ASSERT_TRUE(store->declare({"m", "b", "s"}));
    for (const char* const name : {"berth.db", "berth.db.lock", "berth.db-wal"}) {
      struct stat what {};
      ASSERT_EQ(::stat(folder.file(name).c_str(), &what), 0) << name;
      EXPECT_EQ(what.st_mode & 0777U, shared ? 0640U : 0600U) << name;
    }
  }
  ::umask(before);
}

TEST(Store, ALockFileThatWasOpenToAllIsClosed) {
  const Folder folder;
  write_bytes(folder.file("berth.db.lock"), "1\n");
  ASSERT_EQ(::chmod(folder.file("berth.db.lock").c_str(), 0666), 0);
  const auto store = must_open(folder.file());
  struct stat what {};
  ASSERT_EQ(::stat(folder.file("berth.db.lock").c_str(), &what), 0);
  EXPECT_EQ(what.st_mode & 0777U, 0600U);
}

TEST(Store, TheLockFileGoesWithItsOwner) {
  const Folder folder;
  auto store = must_open(folder.file());
  EXPECT_TRUE(fs::exists(folder.file("berth.db.lock")));
  EXPECT_FALSE(Database::open(folder.file()));
  EXPECT_TRUE(fs::exists(folder.file("berth.db.lock"))) << "the one that was refused removes nothing";
  store.reset();
  EXPECT_FALSE(fs::exists(folder.file("berth.db.lock")));
  // Another's file under that name is left alone.
  store = must_open(folder.file());
  fs::remove(folder.file("berth.db.lock"));
  write_bytes(folder.file("berth.db.lock"), "1\n");
  store.reset();
  EXPECT_TRUE(fs::exists(folder.file("berth.db.lock")));
  fs::remove(folder.file("berth.db.lock"));
  write_bytes(folder.file("broken.db"), "this is no slot table, and long enough to be looked at");
  EXPECT_FALSE(Database::open(folder.file("broken.db")));
  EXPECT_FALSE(fs::exists(folder.file("broken.db.lock"))) << "nor does a refusal leave one";
}

// Removing a lock file lets two processes own two files of one name, unless the name is looked at after locking.
TEST(Store, NoTwoOwnThatRemoveTheLockFile) {
  const Folder folder;
  std::vector<pid_t> children;
  for (int i = 0; i < 4; ++i) {
    const auto child = ::fork();
    if (child != 0) {
      children.push_back(child);
      continue;
    }
    for (int taken = 0, tries = 0; taken < 2000 && tries < 2'000'000; ++tries) {
      FileLock lock;
      if (lock.take(folder.file()) != FileLock::Outcome::taken) continue;
      ++taken;
      const int only = ::open(folder.file("owner").c_str(), O_CREAT | O_EXCL | O_WRONLY | O_CLOEXEC, 0600);
      if (only < 0) ::_exit(1);
      ::close(only);
      ::unlink(folder.file("owner").c_str());
    }
    ::_exit(0);
  }
  for (const auto child : children) {
    int status = -1;
    ::waitpid(child, &status, 0);
    EXPECT_EQ(status, 0) << "two owned the file at once";
  }
  EXPECT_FALSE(fs::exists(folder.file("berth.db.lock")));
}

// What stands in the lock file is who held it last; who holds it now may have written nothing.
TEST(Store, TheMessageNamesTheProcessThatHoldsTheLock) {
  const Folder folder;
  write_bytes(folder.file("berth.db.lock"), "1\n");
  int ready[2];
  ASSERT_EQ(::pipe(ready), 0);
  const auto child = ::fork();
  if (child == 0) {
    const int fd = ::open(folder.file("berth.db.lock").c_str(), O_RDONLY | O_CLOEXEC);
    const char byte = ::flock(fd, LOCK_EX) == 0 ? 'y' : 'n';
    if (::write(ready[1], &byte, 1) != 1) ::_exit(1);
    for (;;) ::pause();
  }
  char byte = 0;
  ASSERT_EQ(::read(ready[0], &byte, 1), 1);
  ASSERT_EQ(byte, 'y');
  const auto opened = Database::open(folder.file());
  ::kill(child, SIGKILL);
  ::waitpid(child, nullptr, 0);
  ASSERT_FALSE(opened);
  EXPECT_NE(opened.error().message.find("process " + std::to_string(child) + " uses"), std::string::npos)
      << opened.error().message;
}

TEST(Store, AKilledOwnerLeavesNoLockAndLosesNothing) {
  const Folder folder;
  int ready[2];
  ASSERT_EQ(::pipe(ready), 0);
  const auto child = ::fork();
  if (child == 0) {
    // Killing the process must lose nothing even where nothing is synced.
    auto store = Database::open(folder.file(), {.sync = false});
    const bool good =
        store && (*store)->declare({"m", "b", "s"}) && (*store)->ask(SlotId{1}, {device(5), NodeId(2)}, "");
    const char byte = good ? 'y' : 'n';
    if (::write(ready[1], &byte, 1) != 1) ::_exit(1);
    for (;;) ::pause();
  }
  char byte = 0;
  ASSERT_EQ(::read(ready[0], &byte, 1), 1);
  ASSERT_EQ(byte, 'y');
  EXPECT_FALSE(Database::open(folder.file()));
  ::kill(child, SIGKILL);
  ::waitpid(child, nullptr, 0);
  auto store = must_open(folder.file());
  ASSERT_NE(store, nullptr);
  EXPECT_EQ(store->load("m").value().at(0).intended, (Assignment{device(5), NodeId(2)}));
}

/// Refused, with these words, and not one byte changed.
void expect_refused(const std::string& path, const char* words) {
  const auto before = bytes_of(path);
  const auto opened = Database::open(path);
  ASSERT_FALSE(opened) << words;
  EXPECT_EQ(opened.error().error.code, Errc::invalid) << opened.error().message;
  EXPECT_NE(opened.error().message.find(words), std::string::npos) << opened.error().message;
  EXPECT_NE(opened.error().message.find("left as it is"), std::string::npos) << opened.error().message;
  EXPECT_TRUE(opened.error().message.starts_with(path)) << opened.error().message;
  EXPECT_EQ(bytes_of(path), before);
  EXPECT_FALSE(fs::exists(path + "-wal"));
  EXPECT_FALSE(fs::exists(path + "-journal"));
}

TEST(Store, RefusesFilesThatAreNotBerths) {
  const Folder folder;
  write_bytes(folder.file("text"), "my shopping list\n");
  expect_refused(folder.file("text"), "not a Berth store");
  write_bytes(folder.file("long"), std::string(10'000, 'x'));
  expect_refused(folder.file("long"), "not a Berth store");
  {
    SQLite::Database foreign(folder.file("foreign"), SQLite::OPEN_READWRITE | SQLite::OPEN_CREATE);
    foreign.exec("CREATE TABLE slots (x)");
  }
  expect_refused(folder.file("foreign"), "not a Berth store");
  {
    SQLite::Database wal(folder.file("wal"), SQLite::OPEN_READWRITE | SQLite::OPEN_CREATE);
    wal.exec("PRAGMA journal_mode = WAL; CREATE TABLE t (x)");
  }
  expect_refused(folder.file("wal"), "not a Berth store");
}

TEST(Store, RefusesANewerBerths) {
  const Folder folder;
  must_open(folder.file());
  {
    SQLite::Database raw(folder.file(), SQLite::OPEN_READWRITE);
    raw.exec("PRAGMA user_version = 99");
  }
  // The log is gone once the file is closed, and the header alone tells.
  expect_refused(folder.file(), "schema version 99");
}

TEST(Store, ANewerBerthsLogStaysToo) {
  const Folder folder;
  must_open(folder.file());
  std::string main;
  std::string log;
  {
    SQLite::Database raw(folder.file(), SQLite::OPEN_READWRITE);
    raw.exec("PRAGMA user_version = 99");
    main = bytes_of(folder.file());
    log = bytes_of(folder.file() + "-wal");
    ASSERT_FALSE(log.empty());
  }
  // As a newer Berth that was killed leaves it.
  write_bytes(folder.file(), main);
  write_bytes(folder.file() + "-wal", log);
  const auto opened = Database::open(folder.file());
  ASSERT_FALSE(opened);
  EXPECT_NE(opened.error().message.find("schema version 99"), std::string::npos) << opened.error().message;
  EXPECT_EQ(bytes_of(folder.file()), main);
  EXPECT_EQ(bytes_of(folder.file() + "-wal"), log);
}

TEST(Store, RefusesADamagedStore) {
  const Folder folder;
  {
    auto store = must_open(folder.file());
    for (int i = 0; i < 50; ++i) ASSERT_TRUE(store->declare({"m", "b", "slot " + std::to_string(i)}));
  }
  const auto whole = bytes_of(folder.file());
  write_bytes(folder.file("short"), whole.substr(0, whole.size() / 2));
  expect_refused(folder.file("short"), "damaged");
  auto torn = whole;
  for (std::size_t i = 4096; i < 8192; ++i) torn[i] = static_cast<char>(i * 7);
  write_bytes(folder.file("torn"), torn);
  expect_refused(folder.file("torn"), "damaged");
  {
    write_bytes(folder.file("tableless"), whole);
    SQLite::Database raw(folder.file("tableless"), SQLite::OPEN_READWRITE);
    raw.exec("PRAGMA journal_mode = DELETE; DROP TABLE blanks");
  }
  expect_refused(folder.file("tableless"), "no such table: blanks");
}

// A store from elsewhere may bring statements of its own: none of them is ever run.
TEST(Store, RefusesASchemaThatBerthDidNotMake) {
  const Folder folder;
  must_open(folder.file());
  const auto whole = bytes_of(folder.file());
  struct Case {
    const char* sql;
    const char* words;
  };
  const Case cases[] = {
      {"CREATE TRIGGER fill AFTER INSERT ON history BEGIN INSERT INTO slots (machine, bus, name) WITH RECURSIVE n(i) "
       "AS "
       "(SELECT 1 UNION ALL SELECT i + 1 FROM n) SELECT 'm', 'b', 'x' || i FROM n; END",
       "trigger fill"},
      {"CREATE VIEW look AS SELECT randomblob(1000000000)", "view look"},
      {"CREATE TABLE more (x)", "table more"},
      {"CREATE INDEX slow ON history (hex(reason))", "index slow"},
      {"DROP TRIGGER history_names_devices", "no such trigger: history_names_devices"},
      {"DROP TABLE marks", "no such table: marks"},
      {"ALTER TABLE slots ADD COLUMN more TEXT DEFAULT (1)", "table slots"},
      {"DROP TABLE slots; CREATE TABLE slots (id INTEGER PRIMARY KEY AUTOINCREMENT, machine TEXT NOT NULL, bus TEXT "
       "NOT "
       "NULL, name TEXT NOT NULL CHECK ((WITH RECURSIVE n(i) AS (SELECT 1) SELECT 1 FROM n)), UNIQUE (machine, bus, "
       "name)) STRICT",
       ""},
      {"PRAGMA writable_schema = ON; UPDATE sqlite_master SET sql = replace(sql, 'BETWEEN 0 AND 255', '< "
       "randomblob(9)')",
       "table"},
  };
  for (const auto& c : cases) {
    write_bytes(folder.file("x"), whole);
    try {
      SQLite::Database raw(folder.file("x"), SQLite::OPEN_READWRITE);
      raw.exec("PRAGMA journal_mode = DELETE");
      raw.exec(c.sql);
    } catch (const SQLite::Exception& error) {
      EXPECT_STREQ(c.words, "") << error.what();  // SQLite itself refuses a subquery in a CHECK
      continue;
    }
    expect_refused(folder.file("x"), c.words);
  }
}

// What `open` would refuse is refused before it is a file.
TEST(Store, BytesAreLookedAtBeforeTheyAreAFile) {
  const Folder folder;
  {
    auto store = must_open(folder.file());
    for (int i = 0; i < 50; ++i) ASSERT_TRUE(store->declare({"m", "b", "slot " + std::to_string(i)}));
  }
  const auto whole = bytes_of(folder.file());
  EXPECT_TRUE(look(whole, "in x"));
  EXPECT_TRUE(look("", "in x"));
  const auto refused = [](const std::string& bytes, const char* words) {
    const auto seen = look(bytes, "in x");
    ASSERT_FALSE(seen) << words;
    EXPECT_TRUE(seen.error().message.starts_with("in x: ")) << seen.error().message;
    EXPECT_NE(seen.error().message.find(words), std::string::npos) << seen.error().message;
  };
  refused("x", "not a Berth store");
  refused(whole.substr(0, 100), "damaged");
  refused(whole.substr(0, whole.size() / 2), "damaged");
  {
    SQLite::Database raw(folder.file(), SQLite::OPEN_READWRITE);
    raw.exec("PRAGMA journal_mode = DELETE; CREATE TRIGGER fill AFTER INSERT ON history BEGIN SELECT 1; END");
  }
  refused(bytes_of(folder.file()), "trigger fill");
}

// A signal or a deadline ends what takes long, and nothing is changed.
TEST(Store, WhatTakesLongCanBeEnded) {
  const Folder folder;
  must_open(folder.file());
  {
    SQLite::Database raw(folder.file(), SQLite::OPEN_READWRITE);
    raw.exec(
        "WITH RECURSIVE n(i) AS (SELECT 1 UNION ALL SELECT i + 1 FROM n LIMIT 50000) "
        "INSERT INTO history (stamp_ms, event, node_id, reason) SELECT i, 'e', 255, 'r' FROM n");
  }
  unsigned asked = 0;
  const auto refused = Database::open(folder.file(), {.ended = [&] { return ++asked > 0; }});
  ASSERT_FALSE(refused);
  EXPECT_GT(asked, 0U);
  EXPECT_NE(refused.error().message.find("ended"), std::string::npos) << refused.error().message;
  EXPECT_TRUE(refused.error().message.starts_with(folder.file()));
  bool over = false;
  auto opened = Database::open(folder.file(), {.ended = [&] { return over; }});
  ASSERT_TRUE(opened);
  EXPECT_EQ((*opened)->history(std::nullopt).value().size(), 50'000U);
  over = true;
  EXPECT_FALSE((*opened)->history(std::nullopt));
}

// Many devices in a store of schema 1: what brings it up looks at each line of the history a few times, not at all
// lines for each device.
TEST(Store, AnOldStoreWithManyDevicesIsBroughtUpInReason) {
  const Folder folder;
  {
    SQLite::Database raw(folder.file(), SQLite::OPEN_READWRITE | SQLite::OPEN_CREATE);
    create_schema(raw, 1);
    raw.exec(
        "WITH RECURSIVE n(i) AS (SELECT 1 UNION ALL SELECT i + 1 FROM n LIMIT 20000) INSERT INTO history (stamp_ms, "
        "event, vendor, product, revision, serial, node_id, reason) SELECT i, 'e', 1, 2, 3, i, 255, '' FROM n");
  }
  unsigned asked = 0;  // once in 100,000 steps
  auto opened = Database::open(folder.file(), {.ended = [&] { return ++asked > 200; }});
  ASSERT_TRUE(opened) << opened.error().message;
  EXPECT_EQ((*opened)->devices().value().size(), 20'000U);
}

TEST(Store, AValueLongerThanAnyOfBerthsIsDamage) {
  const Folder folder;
  must_open(folder.file());
  {
    SQLite::Database raw(folder.file(), SQLite::OPEN_READWRITE);
    raw.exec("INSERT INTO slots (machine, bus, name) VALUES ('m', 'b', hex(zeroblob(2000000)))");
  }
  auto opened = Database::open(folder.file());
  EXPECT_TRUE(!opened || !(*opened)->load("m"));
}

TEST(Store, ADamagedByteNeverCrashesIt) {
  const Folder folder;
  {
    auto store = must_open(folder.file());
    for (int i = 0; i < 10; ++i) ASSERT_TRUE(store->declare({"m", "b", "slot " + std::to_string(i)}));
  }
  const auto whole = bytes_of(folder.file());
  Random random(4);
  for (int n = 0; n < 150; ++n) {
    auto bytes = whole;
    for (std::uint64_t k = 1 + random.below(30); k > 0; --k)
      bytes[random.below(bytes.size())] = static_cast<char>(random.next());
    write_bytes(folder.file("x"), bytes);
    auto opened = Database::open(folder.file("x"));
    if (!opened) {
      EXPECT_EQ(bytes_of(folder.file("x")), bytes);
      continue;
    }
    (void)(*opened)->load("m");
    (void)(*opened)->history(std::nullopt);
    (void)(*opened)->declare({"m", "b", "new"});
  }
}

TEST(Store, FoldersAndMissingFoldersAreErrors) {
  const Folder folder;
  const auto missing = Database::open(folder.file("no/such/berth.db"));
  ASSERT_FALSE(missing);
  EXPECT_EQ(missing.error().error.code, Errc::io);
  fs::create_directory(folder.file("dir"));
  const auto dir = Database::open(folder.file("dir"));
  ASSERT_FALSE(dir);
  EXPECT_NE(dir.error().message.find("this is a folder"), std::string::npos);
}

// A store of schema 1 is brought to today's: nothing is lost, and what is new is filled from the history.
TEST(Store, MigratesAnOlderSchema) {
  const Folder folder;
  {
    SQLite::Database raw(folder.file(), SQLite::OPEN_READWRITE | SQLite::OPEN_CREATE);
    create_schema(raw, 1);
    raw.exec("INSERT INTO slots (machine, bus, name) VALUES ('m', 'b', 'left')");
    raw.exec("INSERT INTO seats VALUES (1, 'confirmed', 1, 2, 0, 5, 2)");
    raw.exec("INSERT INTO history (stamp_ms, slot, event, node_id, reason) VALUES (1, 1, 'declared', 255, 'left')");
    for (const char* line : {"(7, 1, 'asked', 1, 2, 0, 5, 2, 'r')", "(9, 1, 'confirmed', 1, 2, 0, 5, 2, 's')"}) {
      raw.exec(
          std::string("INSERT INTO history (stamp_ms, slot, event, vendor, product, revision, serial, node_id, reason) "
                      "VALUES ") +
          line);
    }
  }
  auto store = must_open(folder.file());
  ASSERT_NE(store, nullptr);
  EXPECT_EQ(store->load("m").value().at(0).confirmed, (Assignment{{1, 2, 0, 5}, NodeId(2)}));
  EXPECT_EQ(store->history(std::nullopt).value().size(), 3U);
  EXPECT_EQ(store->devices().value(), (std::vector<DeviceSeen>{{{1, 2, 0, 5}, 7, 9, 2}}));
  ASSERT_TRUE(store->clear(SlotId{1}, "gone"));
  EXPECT_EQ(store->devices().value().at(0).lines, 3);
  store.reset();
  SQLite::Database raw(folder.file(), SQLite::OPEN_READONLY);
  EXPECT_EQ(raw.execAndGet("PRAGMA user_version").getInt(), schema_version);
}

// Schema 2 had no configurations: nothing is lost, and what waits for a power cycle is kept from now on.
TEST(Store, MigratesSchemaTwoAndKeepsWhatWaitsForAPowerCycle) {
  const Folder folder;
  {
    SQLite::Database raw(folder.file(), SQLite::OPEN_READWRITE | SQLite::OPEN_CREATE);
    create_schema(raw, 2);
    raw.exec("INSERT INTO slots (machine, bus, name) VALUES ('m', 'b', 'left')");
    raw.exec("INSERT INTO seats VALUES (1, 'confirmed', 1, 2, 0, 5, 2)");
  }
  const places::Configured waits{places::Configured::Stage::power_cycle, {1, 2, 0, 5}, 0xFFFFFFFF, 1};
  {
    auto store = must_open(folder.file());
    ASSERT_NE(store, nullptr);
    EXPECT_EQ(store->load("m").value().at(0).confirmed, (Assignment{{1, 2, 0, 5}, NodeId(2)}));
    EXPECT_FALSE(store->load("m").value().at(0).configured);
    ASSERT_TRUE(store->configure(SlotId{1}, waits, "pump.dcf"));
    EXPECT_EQ(store->configure(SlotId{7}, waits, "x").error().code, Errc::not_found);
  }
  auto store = must_open(folder.file());
  EXPECT_EQ(store->load("m").value().at(0).configured, waits);
  EXPECT_EQ(store->history(SlotId{1}).value().back().event, "power cycle needed");
  ASSERT_TRUE(store->clear(SlotId{1}, "gone"));
  EXPECT_FALSE(store->load("m").value().at(0).configured);
}

// Schema 4 did not say where a blanking was begun: what is unfinished stays so, and is of any bus.
TEST(Store, MigratesSchemaFourAndKeepsItsUnfinishedBlanks) {
  const Folder folder;
  {
    SQLite::Database raw(folder.file(), SQLite::OPEN_READWRITE | SQLite::OPEN_CREATE);
    create_schema(raw, 4);
    raw.exec("INSERT INTO blanks (vendor, product, revision, serial) VALUES (1, 2, 0, 5), (1, 2, 0, 6)");
  }
  auto store = must_open(folder.file());
  ASSERT_NE(store, nullptr);
  const places::UnfinishedBlank five{{1, 2, 0, 5}, "", "", NodeId()};
  const places::UnfinishedBlank six{{1, 2, 0, 6}, "m", "b", NodeId(3)};
  EXPECT_EQ(store->unfinished_blanks().value().at(0), five);
  ASSERT_TRUE(store->ask_blank(six, "the newest counts"));
  EXPECT_EQ(store->unfinished_blanks().value().at(1), six);
  const places::BusDevice five_here{five.device, {"m", "b"}};
  ASSERT_TRUE(store->drop_blank(five_here, "gone for good"));
  EXPECT_EQ(store->drop_blank(five_here, "again").error().code, Errc::not_found);
  EXPECT_EQ(store->unfinished_blanks().value(), std::vector{six});
  EXPECT_EQ(store->history_of(five_here).value().back().event, "blank dropped");
}

// Schema 3 had no marks, and its history is asked by device from now on.
TEST(Store, MigratesSchemaThreeAndKnowsWhereADeviceSat) {
  const Folder folder;
  {
    SQLite::Database raw(folder.file(), SQLite::OPEN_READWRITE | SQLite::OPEN_CREATE);
    create_schema(raw, 3);
    raw.exec("INSERT INTO slots (machine, bus, name) VALUES ('m', 'b', 'left')");
    for (const char* line : {"(7, 1, 'asked', 1, 2, 0, 5, 2, 'r')", "(8, 1, 'confirmed', 1, 2, 0, 5, 2, 's')",
                             "(9, 1, 'cleared', 1, 2, 0, 5, 255, 't')"}) {
      raw.exec(
          std::string("INSERT INTO history (stamp_ms, slot, event, vendor, product, revision, serial, node_id, reason) "
                      "VALUES ") +
          line);
    }
  }
  const places::BusName here{"m", "b"};
  const places::BusDevice old{{1, 2, 0, 5}, here};
  const places::BusDevice other{{1, 2, 0, 6}, here};
  {
    auto store = must_open(folder.file());
    ASSERT_NE(store, nullptr);
    EXPECT_TRUE(store->marked(places::Mark::restore).value().empty());
    EXPECT_EQ(store->history_of(old).value().size(), 3U);
    EXPECT_TRUE(store->history_of(other).value().empty());
    EXPECT_EQ(former_seat(store->history_of(old).value()), (places::FormerSeat{SlotId{1}, NodeId(2), 9}));
    ASSERT_TRUE(store->mark(places::Mark::restore, old, NodeId(2), "used"));
    ASSERT_TRUE(store->mark(places::Mark::fixed, other, NodeId(9), "11h refused"));
    ASSERT_TRUE(store->mark(places::Mark::fixed, other, NodeId(10), "switch turned"));
  }
  auto store = must_open(folder.file());
  EXPECT_EQ(store->marked(places::Mark::restore).value(), (std::vector<places::Marked>{{old.device, NodeId(2), here}}));
  EXPECT_EQ(store->marked(places::Mark::fixed).value(),
            (std::vector<places::Marked>{{other.device, NodeId(10), here}}));
  ASSERT_TRUE(store->unmark(places::Mark::restore, old, "done"));
  EXPECT_TRUE(store->marked(places::Mark::restore).value().empty());
  EXPECT_FALSE(former_seat(store->history_of(old).value())) << "it has its factory settings: as good as new";
}

// Schema 6: each loan and where it is; a store of before knew the first of a search only, of any bus.
TEST(Store, LoansAreKeptAndOldMarksBecomeLoans) {
  const Folder folder;
  const LssAddress lent{1, 2, 3, 4};
  const LssAddress second{1, 2, 3, 5};
  const places::BusName here{"m", "b"};
  {
    SQLite::Database raw(folder.file(), SQLite::OPEN_READWRITE | SQLite::OPEN_CREATE);
    create_schema(raw, 5);
    raw.exec("INSERT INTO marks VALUES (1, 2, 3, 4, 3, 126)");
  }
  {
    const auto store = must_open(folder.file());
    EXPECT_EQ(store->lent().value(), (std::vector<places::LentId>{{lent, "", "", NodeId(126)}}));
    ASSERT_TRUE(store->lend({second, "m", "b", NodeId(7)}));
    ASSERT_TRUE(store->lend({second, "m", "b", NodeId(8)}));
    ASSERT_TRUE(store->give_back({lent, here}));
    ASSERT_TRUE(store->give_back({lent, here})) << "idempotent";
    EXPECT_TRUE(store->history_of({second, here}).value().empty()) << "each search lends: no line of the history";
  }
  EXPECT_EQ(must_open(folder.file())->lent().value(), (std::vector<places::LentId>{{second, "m", "b", NodeId(8)}}));
}

// Schema 6 took an LSS address for one device in the whole store. Nothing is lost when it is brought to today's, and
// twins on two buses are two devices from then on.
TEST(Store, MigratesSchemaSixAndKnowsADeviceByItsBus) {
  const Folder folder;
  {
    SQLite::Database raw(folder.file(), SQLite::OPEN_READWRITE | SQLite::OPEN_CREATE);
    create_schema(raw, 6);
    raw.exec(
        "INSERT INTO slots (machine, bus, name) VALUES ('m', 'a', 'left'), ('m', 'b', 'right'), ('m', 'b', 'more');"
        "INSERT INTO seats VALUES (1, 'confirmed', 1, 2, 0, 5, 2), (1, 'asked', 1, 2, 0, 5, 3);"
        "INSERT INTO blanks (vendor, product, revision, serial, machine, bus, node_id) VALUES"
        " (1, 2, 0, 7, 'm', 'a', 9), (1, 2, 0, 8, '', '', 255), (1, 2, 0, 9, '', 'b', 11);"
        "INSERT INTO marks VALUES (1, 2, 0, 5, 1, 2);"
        "INSERT INTO loans VALUES (1, 2, 0, 7, 'm', 'a', 126), (1, 2, 0, 8, '', '', 125);"
        "INSERT INTO history (stamp_ms, slot, event, vendor, product, revision, serial, node_id, reason) VALUES"
        " (1, 1, 'confirmed', 1, 2, 0, 5, 2, 'heard'), (2, NULL, 'fixed node-ID', 1, 2, 0, 5, 2, 'refused');");
  }
  const LssAddress five{1, 2, 0, 5};
  const Assignment seat{five, NodeId(2)};
  {
    auto store = must_open(folder.file());
    ASSERT_NE(store, nullptr);
    EXPECT_EQ(store->load(SlotId{1}).value().confirmed, seat);
    EXPECT_EQ(store->load(SlotId{1}).value().intended, (Assignment{five, NodeId(3)}));
    using Blanks = std::vector<places::UnfinishedBlank>;
    EXPECT_EQ(store->unfinished_blanks().value(), (Blanks{{{1, 2, 0, 7}, "m", "a", NodeId(9)},
                                                          {{1, 2, 0, 8}, "", "", NodeId()},
                                                          {{1, 2, 0, 9}, "", "", NodeId(11)}}));
    using Lent = std::vector<places::LentId>;
    EXPECT_EQ(store->lent().value(),
              (Lent{{{1, 2, 0, 7}, "m", "a", NodeId(126)}, {{1, 2, 0, 8}, "", "", NodeId(125)}}));
    EXPECT_TRUE(store->is_marked(places::Mark::fixed, {five, {"m", "b"}}).value()) << "a mark of before is of any bus";
    EXPECT_EQ(store->history_of({five, {"m", "a"}}).value().size(), 2U);
    EXPECT_EQ(store->history_of({five, {"m", "b"}}).value().size(), 1U) << "where it was marked no line says";
    // The twin.
    ASSERT_TRUE(store->ask(SlotId{2}, seat, "its twin"));
    ASSERT_TRUE(store->confirm(SlotId{2}, seat, "its twin"));
    EXPECT_EQ(store->ask(SlotId{3}, {five, NodeId(4)}, "once more").error().code, Errc::duplicate);
  }
  auto store = must_open(folder.file());
  EXPECT_EQ(store->load(SlotId{1}).value().confirmed, seat);
  EXPECT_EQ(store->load(SlotId{2}).value().confirmed, seat);
}

// Schema 7 took devices without a serial number for one: each of them is known by its node-ID from then on.
TEST(Store, MigratesSchemaSevenAndKnowsADeviceWithoutASerialNumberByItsNodeId) {
  const Folder folder;
  {
    SQLite::Database raw(folder.file(), SQLite::OPEN_READWRITE | SQLite::OPEN_CREATE);
    create_schema(raw, 7);
    raw.exec(
        "INSERT INTO slots (machine, bus, name) VALUES ('m', 'a', 'left'), ('m', 'a', 'right'), ('m', 'a', 'more');"
        "INSERT INTO seats VALUES (1, 'confirmed', 1, 2, 3, 0, 5), (2, 'confirmed', 1, 2, 3, 7, 6);"
        "INSERT INTO configurations VALUES (1, 'configured', 1, 2, 3, 0, 11, 12), (2, 'configured', 1, 2, 3, 7, 13, "
        "14);"
        "INSERT INTO blanks (vendor, product, revision, serial, machine, bus, node_id) VALUES"
        " (1, 2, 3, 0, 'm', 'a', 9), (1, 2, 4, 0, 'm', 'a', 255);"
        "INSERT INTO marks VALUES (1, 2, 3, 0, 1, 'm', 'a', 5), (1, 2, 3, 7, 1, 'm', 'a', 6);"
        "INSERT INTO loans VALUES (1, 2, 3, 0, 'm', 'a', 126);"
        "INSERT INTO history (stamp_ms, slot, event, vendor, product, revision, serial, node_id, reason) VALUES"
        " (1, 1, 'confirmed', 1, 2, 3, 0, 5, 'heard'), (2, 2, 'confirmed', 1, 2, 3, 7, 6, 'heard');");
  }
  const Identity kind(1, 2, 3, 0);
  const Identity left = kind.with(NodeId(5));
  const Identity seven(1, 2, 3, 7);
  for (int time = 0; time < 2; ++time) {
    auto store = must_open(folder.file());
    ASSERT_NE(store, nullptr);
    const auto first = store->load(SlotId{1}).value();
    EXPECT_EQ(first.confirmed, (Assignment{left, NodeId(5)}));
    EXPECT_EQ(first.configured->device, left) << "it is not configured once more";
    EXPECT_EQ(store->load(SlotId{2}).value().confirmed, (Assignment{seven, NodeId(6)}));
    EXPECT_EQ(store->load(SlotId{2}).value().configured->device, seven);
    EXPECT_EQ(store->unfinished_blanks().value().front().device, kind.with(NodeId(9)));
    EXPECT_EQ(store->unfinished_blanks().value().back().device, Identity(1, 2, 4, 0));
    EXPECT_EQ(store->lent().value().front().device, kind);
    const places::BusName here{"m", "a"};
    EXPECT_TRUE(store->is_marked(places::Mark::fixed, {left, here}).value());
    EXPECT_FALSE(store->is_marked(places::Mark::fixed, {kind.with(NodeId(6)), here}).value());
    EXPECT_TRUE(store->is_marked(places::Mark::fixed, {seven, here}).value());
    EXPECT_EQ(store->history(std::nullopt).value().size(), 2U);
  }
  // Its equals have slots of their own; two of one node-ID have not.
  auto store = must_open(folder.file());
  EXPECT_EQ(store->ask(SlotId{3}, {left, NodeId(5)}, "once more").error().code, Errc::duplicate);
  ASSERT_TRUE(store->ask(SlotId{3}, {kind.with(NodeId(8)), NodeId(8)}, "its equal"));
  Identity less = kind.with(NodeId(8));
  less.unknown = 0b1110;
  EXPECT_EQ(store->load(SlotId{3}).value().intended->device, kind.with(NodeId(8)));
  ASSERT_TRUE(store->clear(SlotId{3}, "x"));
  ASSERT_TRUE(store->ask(SlotId{3}, {less, NodeId(8)}, "it says less"));
  EXPECT_EQ(store->load(SlotId{3}).value().intended->device, less);
  EXPECT_EQ(store->history_of({less, {"m", "a"}}).value().size(), 1U);
}

// Many twins: whether a device sits in another slot of its bus is looked up, not searched for in all seats.
TEST(Store, TwinsAreLookedUpByAnIndex) {
  const Folder folder;
  must_open(folder.file());
  {
    SQLite::Database raw(folder.file(), SQLite::OPEN_READWRITE);
    raw.exec(
        "WITH RECURSIVE n(i) AS (SELECT 1 UNION ALL SELECT i + 1 FROM n LIMIT 50000) INSERT INTO slots (machine, bus, "
        "name) SELECT 'm', 'b', i FROM n;"
        "INSERT INTO seats SELECT id, 'confirmed', 1, 2, 0, id, 255, 2 FROM slots WHERE id < 49999;");
  }
  unsigned asked = 0;  // once in 100,000 steps
  auto opened = Database::open(folder.file(), {.ended = [&] { return ++asked > 200; }});
  ASSERT_TRUE(opened) << opened.error().message;
  asked = 0;
  for (std::uint32_t i = 0; i < 50; ++i) {
    ASSERT_TRUE((*opened)->ask(SlotId{50'000}, {{9, 9, 9, 9}, NodeId(2)}, "x"));
    EXPECT_EQ((*opened)->ask(SlotId{49'999}, {{1, 2, 0, 1 + i}, NodeId(2)}, "x").error().code, Errc::duplicate);
  }
  EXPECT_LE(asked, 2U) << "100 look-ups in 50,000 seats";
}

}  // namespace
}  // namespace berth::store::database_tests
