#include "berth/store/schema.hpp"

#include <SQLiteCpp/Database.h>
#include <SQLiteCpp/Statement.h>
#include <SQLiteCpp/Transaction.h>
#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <compare>
#include <map>
#include <ranges>
#include <set>

#include "berth/store/database.hpp"

namespace berth::store {
namespace {

// One text per version, applied to the tables of the version before. Texts of released versions never change: a new
// table or column is a new version.
constexpr std::array<const char*, schema_version> steps{
    // 1: slots with ids of their own, intention and confirmation as two facts, and the history.
    R"(
CREATE TABLE slots (
  id      INTEGER PRIMARY KEY AUTOINCREMENT,
  machine TEXT NOT NULL,
  bus     TEXT NOT NULL,
  name    TEXT NOT NULL,
  UNIQUE (machine, bus, name)
) STRICT;
CREATE TABLE seats (
  slot     INTEGER NOT NULL REFERENCES slots (id),
  fact     TEXT NOT NULL CHECK (fact IN ('asked', 'confirmed')),
  vendor   INTEGER NOT NULL CHECK (vendor BETWEEN 0 AND 4294967295),
  product  INTEGER NOT NULL CHECK (product BETWEEN 0 AND 4294967295),
  revision INTEGER NOT NULL CHECK (revision BETWEEN 0 AND 4294967295),
  serial   INTEGER NOT NULL CHECK (serial BETWEEN 0 AND 4294967295),
  node_id  INTEGER NOT NULL CHECK (node_id BETWEEN 0 AND 255),
  PRIMARY KEY (slot, fact),
  UNIQUE (fact, vendor, product, revision, serial)
) STRICT;
CREATE TABLE blanks (
  id       INTEGER PRIMARY KEY AUTOINCREMENT,
  vendor   INTEGER NOT NULL,
  product  INTEGER NOT NULL,
  revision INTEGER NOT NULL,
  serial   INTEGER NOT NULL,
  UNIQUE (vendor, product, revision, serial)
) STRICT;
CREATE TABLE history (
  sequence INTEGER PRIMARY KEY AUTOINCREMENT,
  stamp_ms INTEGER NOT NULL,
  slot     INTEGER,
  event    TEXT NOT NULL,
  vendor   INTEGER,
  product  INTEGER,
  revision INTEGER,
  serial   INTEGER,
  node_id  INTEGER NOT NULL,
  reason   TEXT NOT NULL
) STRICT;
CREATE TRIGGER history_is_never_changed BEFORE UPDATE ON history
BEGIN SELECT RAISE(ABORT, 'the history is never rewritten'); END;
CREATE TRIGGER history_is_never_shortened BEFORE DELETE ON history
BEGIN SELECT RAISE(ABORT, 'the history is never rewritten'); END;
)",
    // 2: all devices ever named, updated by a trigger of the history; an index for the history of one slot.
    R"(
CREATE TABLE devices (
  vendor   INTEGER NOT NULL,
  product  INTEGER NOT NULL,
  revision INTEGER NOT NULL,
  serial   INTEGER NOT NULL,
  first_ms INTEGER NOT NULL,
  last_ms  INTEGER NOT NULL,
  lines    INTEGER NOT NULL,
  PRIMARY KEY (vendor, product, revision, serial)
) STRICT, WITHOUT ROWID;
INSERT INTO devices
  SELECT vendor, product, revision, serial, 0, 0, count(*) FROM history WHERE vendor IS NOT NULL GROUP BY 1, 2, 3, 4;
UPDATE devices SET
  first_ms = (SELECT stamp_ms FROM history h WHERE (h.vendor, h.product, h.revision, h.serial) =
    (devices.vendor, devices.product, devices.revision, devices.serial) ORDER BY sequence LIMIT 1),
  last_ms = (SELECT stamp_ms FROM history h WHERE (h.vendor, h.product, h.revision, h.serial) =
    (devices.vendor, devices.product, devices.revision, devices.serial) ORDER BY sequence DESC LIMIT 1);
CREATE TRIGGER history_names_devices AFTER INSERT ON history WHEN NEW.vendor IS NOT NULL
BEGIN
  INSERT INTO devices VALUES (NEW.vendor, NEW.product, NEW.revision, NEW.serial, NEW.stamp_ms, NEW.stamp_ms, 1)
    ON CONFLICT DO UPDATE SET last_ms = NEW.stamp_ms, lines = lines + 1;
END;
CREATE INDEX history_of_slot ON history (slot);
)",
    // 3: progress of configuring each slot's device.
    R"(
CREATE TABLE configurations (
  slot     INTEGER PRIMARY KEY REFERENCES slots (id),
  stage    TEXT NOT NULL CHECK (stage IN ('configuring', 'power cycle needed', 'configured')),
  vendor   INTEGER NOT NULL CHECK (vendor BETWEEN 0 AND 4294967295),
  product  INTEGER NOT NULL CHECK (product BETWEEN 0 AND 4294967295),
  revision INTEGER NOT NULL CHECK (revision BETWEEN 0 AND 4294967295),
  serial   INTEGER NOT NULL CHECK (serial BETWEEN 0 AND 4294967295),
  days     INTEGER NOT NULL CHECK (days BETWEEN 0 AND 4294967295),
  ms       INTEGER NOT NULL CHECK (ms BETWEEN 0 AND 4294967295)
) STRICT;
)",
    // 4: marks of devices, besides their seats (the numbers of `places::Mark`); an index for the history of one device.
    R"(
CREATE TABLE marks (
  vendor   INTEGER NOT NULL CHECK (vendor BETWEEN 0 AND 4294967295),
  product  INTEGER NOT NULL CHECK (product BETWEEN 0 AND 4294967295),
  revision INTEGER NOT NULL CHECK (revision BETWEEN 0 AND 4294967295),
  serial   INTEGER NOT NULL CHECK (serial BETWEEN 0 AND 4294967295),
  mark     INTEGER NOT NULL,
  node_id  INTEGER NOT NULL CHECK (node_id BETWEEN 0 AND 255),
  PRIMARY KEY (vendor, product, revision, serial, mark)
) STRICT, WITHOUT ROWID;
CREATE INDEX history_of_device ON history (vendor, product, revision, serial) WHERE vendor IS NOT NULL;
)",
    // 5: the bus on which a blanking was begun, and the node-ID that it takes away; older rows apply to any bus.
    R"(
ALTER TABLE blanks ADD COLUMN machine TEXT NOT NULL DEFAULT '';
ALTER TABLE blanks ADD COLUMN bus TEXT NOT NULL DEFAULT '';
ALTER TABLE blanks ADD COLUMN node_id INTEGER NOT NULL DEFAULT 255 CHECK (node_id BETWEEN 0 AND 255);
)",
    // 6: all lent node-IDs, with their buses; before, only a search's first loan was stored, as mark 3.
    R"(
CREATE TABLE loans (
  vendor   INTEGER NOT NULL CHECK (vendor BETWEEN 0 AND 4294967295),
  product  INTEGER NOT NULL CHECK (product BETWEEN 0 AND 4294967295),
  revision INTEGER NOT NULL CHECK (revision BETWEEN 0 AND 4294967295),
  serial   INTEGER NOT NULL CHECK (serial BETWEEN 0 AND 4294967295),
  machine  TEXT NOT NULL,
  bus      TEXT NOT NULL,
  node_id  INTEGER NOT NULL CHECK (node_id BETWEEN 0 AND 255),
  PRIMARY KEY (vendor, product, revision, serial)
) STRICT, WITHOUT ROWID;
INSERT INTO loans SELECT vendor, product, revision, serial, '', '', node_id FROM marks WHERE mark = 3;
DELETE FROM marks WHERE mark = 3;
)",
    // 7: machine, bus and LSS address identify a device. Tables whose keys change are made anew. A row without a
    // machine applies to any bus. So do all older marks, and all older lines of the history about devices without
    // slots.
    R"(
CREATE TABLE seats_of_buses (
  slot     INTEGER NOT NULL REFERENCES slots (id),
  fact     TEXT NOT NULL CHECK (fact IN ('asked', 'confirmed')),
  vendor   INTEGER NOT NULL CHECK (vendor BETWEEN 0 AND 4294967295),
  product  INTEGER NOT NULL CHECK (product BETWEEN 0 AND 4294967295),
  revision INTEGER NOT NULL CHECK (revision BETWEEN 0 AND 4294967295),
  serial   INTEGER NOT NULL CHECK (serial BETWEEN 0 AND 4294967295),
  node_id  INTEGER NOT NULL CHECK (node_id BETWEEN 0 AND 255),
  PRIMARY KEY (slot, fact)
) STRICT;
INSERT INTO seats_of_buses SELECT slot, fact, vendor, product, revision, serial, node_id FROM seats;
DROP TABLE seats;
ALTER TABLE seats_of_buses RENAME TO seats;
CREATE INDEX seats_of_device ON seats (vendor, product, revision, serial);
CREATE TABLE blanks_of_buses (
  id       INTEGER PRIMARY KEY,
  vendor   INTEGER NOT NULL CHECK (vendor BETWEEN 0 AND 4294967295),
  product  INTEGER NOT NULL CHECK (product BETWEEN 0 AND 4294967295),
  revision INTEGER NOT NULL CHECK (revision BETWEEN 0 AND 4294967295),
  serial   INTEGER NOT NULL CHECK (serial BETWEEN 0 AND 4294967295),
  machine  TEXT NOT NULL,
  bus      TEXT NOT NULL,
  node_id  INTEGER NOT NULL CHECK (node_id BETWEEN 0 AND 255),
  UNIQUE (vendor, product, revision, serial, machine, bus)
) STRICT;
INSERT INTO blanks_of_buses SELECT id, vendor, product, revision, serial, machine,
  CASE machine WHEN '' THEN '' ELSE bus END, node_id FROM blanks;
DROP TABLE blanks;
ALTER TABLE blanks_of_buses RENAME TO blanks;
CREATE TABLE marks_of_buses (
  vendor   INTEGER NOT NULL CHECK (vendor BETWEEN 0 AND 4294967295),
  product  INTEGER NOT NULL CHECK (product BETWEEN 0 AND 4294967295),
  revision INTEGER NOT NULL CHECK (revision BETWEEN 0 AND 4294967295),
  serial   INTEGER NOT NULL CHECK (serial BETWEEN 0 AND 4294967295),
  mark     INTEGER NOT NULL,
  machine  TEXT NOT NULL,
  bus      TEXT NOT NULL,
  node_id  INTEGER NOT NULL CHECK (node_id BETWEEN 0 AND 255),
  PRIMARY KEY (vendor, product, revision, serial, mark, machine, bus)
) STRICT, WITHOUT ROWID;
INSERT INTO marks_of_buses SELECT vendor, product, revision, serial, mark, '', '', node_id FROM marks;
DROP TABLE marks;
ALTER TABLE marks_of_buses RENAME TO marks;
CREATE TABLE loans_of_buses (
  vendor   INTEGER NOT NULL CHECK (vendor BETWEEN 0 AND 4294967295),
  product  INTEGER NOT NULL CHECK (product BETWEEN 0 AND 4294967295),
  revision INTEGER NOT NULL CHECK (revision BETWEEN 0 AND 4294967295),
  serial   INTEGER NOT NULL CHECK (serial BETWEEN 0 AND 4294967295),
  machine  TEXT NOT NULL,
  bus      TEXT NOT NULL,
  node_id  INTEGER NOT NULL CHECK (node_id BETWEEN 0 AND 255),
  PRIMARY KEY (vendor, product, revision, serial, machine, bus)
) STRICT, WITHOUT ROWID;
INSERT INTO loans_of_buses SELECT vendor, product, revision, serial, machine,
  CASE machine WHEN '' THEN '' ELSE bus END, node_id FROM loans;
DROP TABLE loans;
ALTER TABLE loans_of_buses RENAME TO loans;
ALTER TABLE history ADD COLUMN machine TEXT NOT NULL DEFAULT '';
ALTER TABLE history ADD COLUMN bus TEXT NOT NULL DEFAULT '';
)",
    // 8: a node-ID identifies a device without a serial number, and parts that a device does not report are unknown.
    // `apart`: 256 times the unknown parts (bit 0 vendor-ID to bit 3 serial number), plus the node-ID that
    // distinguishes the device from its equals, else 255. Before, unknown parts were 0; rows of such devices stay
    // unchanged.
    R"(
CREATE TABLE seats_of_devices (
  slot     INTEGER NOT NULL REFERENCES slots (id),
  fact     TEXT NOT NULL CHECK (fact IN ('asked', 'confirmed')),
  vendor   INTEGER NOT NULL CHECK (vendor BETWEEN 0 AND 4294967295),
  product  INTEGER NOT NULL CHECK (product BETWEEN 0 AND 4294967295),
  revision INTEGER NOT NULL CHECK (revision BETWEEN 0 AND 4294967295),
  serial   INTEGER NOT NULL CHECK (serial BETWEEN 0 AND 4294967295),
  apart    INTEGER NOT NULL CHECK (apart BETWEEN 0 AND 4095),
  node_id  INTEGER NOT NULL CHECK (node_id BETWEEN 0 AND 255),
  PRIMARY KEY (slot, fact)
) STRICT;
INSERT INTO seats_of_devices SELECT slot, fact, vendor, product, revision, serial,
  CASE WHEN serial = 0 AND node_id BETWEEN 1 AND 127 THEN node_id ELSE 255 END, node_id FROM seats;
DROP TABLE seats;
ALTER TABLE seats_of_devices RENAME TO seats;
CREATE INDEX seats_of_device ON seats (vendor, product, revision, serial, apart);
CREATE TABLE configurations_of_devices (
  slot     INTEGER PRIMARY KEY REFERENCES slots (id),
  stage    TEXT NOT NULL CHECK (stage IN ('configuring', 'power cycle needed', 'configured')),
  vendor   INTEGER NOT NULL CHECK (vendor BETWEEN 0 AND 4294967295),
  product  INTEGER NOT NULL CHECK (product BETWEEN 0 AND 4294967295),
  revision INTEGER NOT NULL CHECK (revision BETWEEN 0 AND 4294967295),
  serial   INTEGER NOT NULL CHECK (serial BETWEEN 0 AND 4294967295),
  apart    INTEGER NOT NULL CHECK (apart BETWEEN 0 AND 4095),
  days     INTEGER NOT NULL CHECK (days BETWEEN 0 AND 4294967295),
  ms       INTEGER NOT NULL CHECK (ms BETWEEN 0 AND 4294967295)
) STRICT;
INSERT INTO configurations_of_devices SELECT slot, stage, vendor, product, revision, serial,
  coalesce((SELECT apart FROM seats s WHERE s.slot = c.slot AND c.serial = 0 ORDER BY fact DESC LIMIT 1), 255), days, ms
  FROM configurations c;
DROP TABLE configurations;
ALTER TABLE configurations_of_devices RENAME TO configurations;
CREATE TABLE blanks_of_devices (
  id       INTEGER PRIMARY KEY,
  vendor   INTEGER NOT NULL CHECK (vendor BETWEEN 0 AND 4294967295),
  product  INTEGER NOT NULL CHECK (product BETWEEN 0 AND 4294967295),
  revision INTEGER NOT NULL CHECK (revision BETWEEN 0 AND 4294967295),
  serial   INTEGER NOT NULL CHECK (serial BETWEEN 0 AND 4294967295),
  apart    INTEGER NOT NULL CHECK (apart BETWEEN 0 AND 4095),
  machine  TEXT NOT NULL,
  bus      TEXT NOT NULL,
  node_id  INTEGER NOT NULL CHECK (node_id BETWEEN 0 AND 255),
  UNIQUE (vendor, product, revision, serial, apart, machine, bus)
) STRICT;
INSERT INTO blanks_of_devices SELECT id, vendor, product, revision, serial,
  CASE WHEN serial = 0 AND node_id BETWEEN 1 AND 127 THEN node_id ELSE 255 END, machine, bus, node_id FROM blanks;
DROP TABLE blanks;
ALTER TABLE blanks_of_devices RENAME TO blanks;
CREATE TABLE marks_of_devices (
  vendor   INTEGER NOT NULL CHECK (vendor BETWEEN 0 AND 4294967295),
  product  INTEGER NOT NULL CHECK (product BETWEEN 0 AND 4294967295),
  revision INTEGER NOT NULL CHECK (revision BETWEEN 0 AND 4294967295),
  serial   INTEGER NOT NULL CHECK (serial BETWEEN 0 AND 4294967295),
  apart    INTEGER NOT NULL CHECK (apart BETWEEN 0 AND 4095),
  mark     INTEGER NOT NULL,
  machine  TEXT NOT NULL,
  bus      TEXT NOT NULL,
  node_id  INTEGER NOT NULL CHECK (node_id BETWEEN 0 AND 255),
  PRIMARY KEY (vendor, product, revision, serial, apart, mark, machine, bus)
) STRICT, WITHOUT ROWID;
INSERT INTO marks_of_devices SELECT vendor, product, revision, serial,
  CASE WHEN serial = 0 AND node_id BETWEEN 1 AND 127 THEN node_id ELSE 255 END, mark, machine, bus, node_id FROM marks;
DROP TABLE marks;
ALTER TABLE marks_of_devices RENAME TO marks;
CREATE TABLE loans_of_devices (
  vendor   INTEGER NOT NULL CHECK (vendor BETWEEN 0 AND 4294967295),
  product  INTEGER NOT NULL CHECK (product BETWEEN 0 AND 4294967295),
  revision INTEGER NOT NULL CHECK (revision BETWEEN 0 AND 4294967295),
  serial   INTEGER NOT NULL CHECK (serial BETWEEN 0 AND 4294967295),
  apart    INTEGER NOT NULL CHECK (apart BETWEEN 0 AND 4095),
  machine  TEXT NOT NULL,
  bus      TEXT NOT NULL,
  node_id  INTEGER NOT NULL CHECK (node_id BETWEEN 0 AND 255),
  PRIMARY KEY (vendor, product, revision, serial, apart, machine, bus)
) STRICT, WITHOUT ROWID;
INSERT INTO loans_of_devices SELECT vendor, product, revision, serial, 255, machine, bus, node_id FROM loans;
DROP TABLE loans;
ALTER TABLE loans_of_devices RENAME TO loans;
ALTER TABLE history ADD COLUMN apart INTEGER NOT NULL DEFAULT 255;
DROP INDEX history_of_device;
CREATE INDEX history_of_device ON history (vendor, product, revision, serial, apart) WHERE vendor IS NOT NULL;
DROP TRIGGER history_names_devices;
CREATE TABLE all_devices (
  vendor   INTEGER NOT NULL,
  product  INTEGER NOT NULL,
  revision INTEGER NOT NULL,
  serial   INTEGER NOT NULL,
  apart    INTEGER NOT NULL,
  first_ms INTEGER NOT NULL,
  last_ms  INTEGER NOT NULL,
  lines    INTEGER NOT NULL,
  PRIMARY KEY (vendor, product, revision, serial, apart)
) STRICT, WITHOUT ROWID;
INSERT INTO all_devices SELECT vendor, product, revision, serial, 255, first_ms, last_ms, lines FROM devices;
DROP TABLE devices;
ALTER TABLE all_devices RENAME TO devices;
CREATE TRIGGER history_names_devices AFTER INSERT ON history WHEN NEW.vendor IS NOT NULL
BEGIN
  INSERT INTO devices VALUES
    (NEW.vendor, NEW.product, NEW.revision, NEW.serial, NEW.apart, NEW.stamp_ms, NEW.stamp_ms, 1)
    ON CONFLICT DO UPDATE SET last_ms = NEW.stamp_ms, lines = lines + 1;
END;
)"};

/// An element of a schema: table, index, trigger or view, also of SQLite's own.
struct Made {
  std::string type;
  std::string name;
  std::string sql;  ///< "" for an index that SQLite makes with a table
  auto operator<=>(const Made&) const = default;
};

// Returns at most `most`: a foreign schema may have millions.
std::set<Made> schema_of(SQLite::Database& db, std::size_t most) {
  SQLite::Statement query(db, "SELECT type, name, coalesce(sql, '') FROM sqlite_master LIMIT ?");
  query.bind(1, static_cast<std::int64_t>(most));
  std::set<Made> made;
  const auto text = [&](int column) { return query.getColumn(column).getString(); };
  while (query.executeStep()) made.insert({text(0), text(1), text(2)});
  return made;
}

constexpr std::size_t most_made = 100;    // more than any version has
constexpr std::size_t longest_name = 64;  // of a foreign name, in messages

// Without this index, the subqueries of step 2 would search the whole history for each device.
constexpr const char* help_step_2 =
    "CREATE INDEX berth_passing ON history (vendor, product, revision, serial) WHERE vendor IS NOT NULL";

void apply(SQLite::Database& db, int from, int to) {
  SQLite::Transaction transaction(db, SQLite::TransactionBehavior::IMMEDIATE);
  for (int version = from; version < to; ++version) {
    if (version == 1) db.exec(help_step_2);
    db.exec(steps[static_cast<std::size_t>(version)]);
    if (version == 1) db.exec("DROP INDEX berth_passing");
  }
  db.exec(fmt::format("PRAGMA application_id = {}", application_id));
  db.exec(fmt::format("PRAGMA user_version = {}", to));
  transaction.commit();
}

}  // namespace

FileKind classify(std::int64_t application, std::int64_t version, bool has_tables) noexcept {
  if (application == 0 && version == 0 && !has_tables) return FileKind::fresh;
  if (application != application_id || version < 1) return FileKind::foreign;
  return version > schema_version ? FileKind::newer : FileKind::ours;
}

void create_schema(SQLite::Database& db, int version) { apply(db, 0, version); }

void migrate(SQLite::Database& db, int version) {
  if (version < schema_version) apply(db, version, schema_version);
}

namespace {

const std::set<Made>& made_in(int version) {
  static std::map<int, std::set<Made>> known;
  auto& made = known[version];
  if (!made.empty()) return made;
  SQLite::Database model(":memory:", SQLite::OPEN_READWRITE | SQLite::OPEN_CREATE);
  create_schema(model, version);
  made = schema_of(model, most_made);
  return made;
}

}  // namespace

std::string strange(SQLite::Database& db, int version) {
  const auto& wanted = made_in(version);
  const auto there = schema_of(db, most_made);
  for (const auto& made : wanted | std::views::reverse) {  // tables before their indices
    const auto same_name = [&](const Made& other) { return other.type == made.type && other.name == made.name; };
    if (std::ranges::none_of(there, same_name)) return fmt::format("no such {}: {}", made.type, made.name);
  }
  for (const auto& made : there) {
    if (!wanted.contains(made))
      return fmt::format("Berth did not make its {} {}", made.type, made.name.substr(0, longest_name));
  }
  return {};
}

std::string damage(SQLite::Database& db) {
  SQLite::Statement check(db, "PRAGMA quick_check(1)");
  const std::string said = check.executeStep() ? check.getColumn(0).getString() : std::string("no answer");
  return said == "ok" ? std::string() : said;
}

}  // namespace berth::store
