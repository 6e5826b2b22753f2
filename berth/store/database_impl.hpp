/// The implementation of `Database`. Private to room `store`.
#pragma once

#include <SQLiteCpp/Database.h>
#include <SQLiteCpp/Statement.h>
#include <SQLiteCpp/Transaction.h>
#include <sqlite3.h>

#include <functional>
#include <map>
#include <optional>
#include <string>

#include "berth/store/database.hpp"
#include "berth/store/file_lock.hpp"
#include "berth/store/schema.hpp"

namespace berth::store {

/// The meaning of an SQLite error code for users, and what to do; `what`: SQLite's own text, for other codes.
[[nodiscard]] std::string cause_of(int code, const char* what);

class Query;

struct Database::Impl {
  FileLock lock;
  std::function<bool()> ended{};  ///< see `OpenOptions`; before `db`, which asks it
  std::optional<SQLite::Database> db;
  std::map<const char*, SQLite::Statement> statements;  ///< by the address of their text; after `db`, so destroyed
                                                        ///< before it
  const SlotStore* owner = nullptr;                     // its clock gives history lines their time

  /// The prepared statement for a text that occurs once in the program.
  SQLite::Statement& statement(const char* sql);
  [[nodiscard]] std::optional<places::SlotId> find_slot(const places::SlotName& name);
  places::SlotId add_slot(const places::SlotName& name);
  /// None: there is no such slot.
  [[nodiscard]] std::optional<places::BusName> bus_of(places::SlotId slot);
  [[nodiscard]] std::optional<places::Assignment> seat(places::SlotId slot, std::string_view fact);
  void put_seat(places::SlotId slot, std::string_view fact, const places::Assignment& seat);
  [[nodiscard]] static std::vector<places::SlotRecord> records_of(Query& query);
  static void add_configurations(Query& query, std::vector<places::SlotRecord>& records);
  /// Adds a line to the history, with the last time given. A slot's line gets the slot's bus.
  void log(const places::HistoryEntry& line);
  void log(places::SlotId slot, std::string_view event, const std::optional<Identity>& device, NodeId id,
           std::string_view reason);
  void log(const places::BusDevice& who, std::string_view event, NodeId id, std::string_view reason);
  /// Runs a statement whose parameters are the device, or the device and its bus.
  template <class Device>
  void run_on(const char* sql, const Device& device);

  /// The file, what was done, and the cause.
  [[nodiscard]] tl::unexpected<Error> failed(const SQLite::Exception& error, const char* what) const;

  /// Runs `body` in one transaction: committed and synced if it returns a value, else rolled back.
  template <class Body>
  auto write(const char* what, Body body) -> decltype(body());
  /// Runs `body`, which only reads.
  template <class Body>
  auto read(const char* what, Body body) -> decltype(body());
};

}  // namespace berth::store
