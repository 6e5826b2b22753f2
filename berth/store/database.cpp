#include "berth/store/database.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <mutex>
#include <set>
#include <utility>

#include "berth/store/database_impl.hpp"

namespace berth::store {
namespace {

using places::Assignment;
using places::HistoryEntry;
using places::SlotId;
using places::SlotName;
using places::SlotRecord;

// Each text stands once: the prepared statement is known by its address.
constexpr const char* find_slot_sql = "SELECT id FROM slots WHERE machine = ? AND bus = ? AND name = ?";
constexpr const char* add_slot_sql = "INSERT INTO slots (machine, bus, name) VALUES (?, ?, ?)";
constexpr const char* has_slot_sql = "SELECT 1 FROM slots WHERE id = ?";
constexpr const char* load_sql =
    "SELECT s.id, s.machine, s.bus, s.name, t.fact, t.vendor, t.product, t.revision, t.serial, t.node_id "
    "FROM slots s LEFT JOIN seats t ON t.slot = s.id WHERE s.machine = ? ORDER BY s.id, t.fact";
constexpr const char* load_slot_sql =
    "SELECT s.id, s.machine, s.bus, s.name, t.fact, t.vendor, t.product, t.revision, t.serial, t.node_id "
    "FROM slots s LEFT JOIN seats t ON t.slot = s.id WHERE s.id = ? ORDER BY t.fact";
constexpr const char* other_seat_sql =
    // With `fact`, which is the first column of the index.
    "SELECT 1 FROM seats WHERE fact IN ('asked', 'confirmed') AND vendor = ? AND product = ? AND revision = ? AND "
    "serial = ? AND slot <> ?";
constexpr const char* get_seat_sql =
    "SELECT vendor, product, revision, serial, node_id FROM seats WHERE slot = ? AND fact = ?";
constexpr const char* put_seat_sql =
    "INSERT INTO seats (vendor, product, revision, serial, node_id, slot, fact) VALUES (?, ?, ?, ?, ?, ?, ?) "
    "ON CONFLICT (slot, fact) DO UPDATE SET vendor = excluded.vendor, product = excluded.product, "
    "revision = excluded.revision, serial = excluded.serial, node_id = excluded.node_id";
constexpr const char* configurations_sql =
    "SELECT c.slot, c.stage, c.vendor, c.product, c.revision, c.serial, c.days, c.ms FROM configurations c "
    "JOIN slots s ON s.id = c.slot WHERE s.machine = ? ORDER BY c.slot";
constexpr const char* configuration_sql =
    "SELECT slot, stage, vendor, product, revision, serial, days, ms FROM configurations WHERE slot = ?";
constexpr const char* put_configuration_sql =
    "INSERT OR REPLACE INTO configurations (vendor, product, revision, serial, slot, stage, days, ms) "
    "VALUES (?, ?, ?, ?, ?, ?, ?, ?)";
constexpr const char* drop_configuration_sql = "DELETE FROM configurations WHERE slot = ?";
constexpr const char* drop_asked_sql = "DELETE FROM seats WHERE slot = ? AND fact = 'asked'";
constexpr const char* drop_seats_sql = "DELETE FROM seats WHERE slot = ?";
constexpr const char* put_blank_sql =
    "INSERT INTO blanks (vendor, product, revision, serial, machine, bus, node_id) VALUES (?, ?, ?, ?, ?, ?, ?) "
    "ON CONFLICT DO UPDATE SET machine = excluded.machine, bus = excluded.bus, node_id = excluded.node_id";
constexpr const char* drop_blank_sql =
    "DELETE FROM blanks WHERE vendor = ? AND product = ? AND revision = ? AND serial = ?";
constexpr const char* blanks_sql =
    "SELECT vendor, product, revision, serial, machine, bus, node_id FROM blanks ORDER BY id";
constexpr const char* get_blank_sql =
    "SELECT node_id FROM blanks WHERE vendor = ? AND product = ? AND revision = ? AND serial = ?";
// Kept as the numbers of `places::Mark`, which are never given to another.
constexpr const char* put_mark_sql =
    "INSERT OR REPLACE INTO marks (vendor, product, revision, serial, mark, node_id) VALUES (?, ?, ?, ?, ?, ?)";
constexpr const char* drop_mark_sql =
    "DELETE FROM marks WHERE vendor = ? AND product = ? AND revision = ? AND serial = ? AND mark = ?";
constexpr const char* marked_sql =
    "SELECT vendor, product, revision, serial, node_id FROM marks WHERE mark = ? ORDER BY 1, 2, 3, 4";
constexpr const char* is_marked_sql =
    "SELECT 1 FROM marks WHERE vendor = ? AND product = ? AND revision = ? AND serial = ? AND mark = ?";
constexpr const char* put_loan_sql =
    "INSERT OR REPLACE INTO loans (vendor, product, revision, serial, machine, bus, node_id) VALUES (?, ?, ?, ?, ?, ?, "
    "?)";
constexpr const char* drop_loan_sql =
    "DELETE FROM loans WHERE vendor = ? AND product = ? AND revision = ? AND serial = ?";
constexpr const char* loans_sql =
    "SELECT vendor, product, revision, serial, machine, bus, node_id FROM loans ORDER BY 1, 2, 3, 4";
constexpr const char* log_sql =
    "INSERT INTO history (vendor, product, revision, serial, stamp_ms, slot, event, node_id, reason) "
    "VALUES (?, ?, ?, ?, ?, ?, ?, ?, ?)";
constexpr const char* history_sql =
    "SELECT vendor, product, revision, serial, sequence, stamp_ms, slot, event, node_id, reason FROM history "
    "ORDER BY sequence";
constexpr const char* history_of_slot_sql =
    "SELECT vendor, product, revision, serial, sequence, stamp_ms, slot, event, node_id, reason FROM history "
    "WHERE slot = ? ORDER BY sequence";
constexpr const char* history_of_device_sql =
    "SELECT vendor, product, revision, serial, sequence, stamp_ms, slot, event, node_id, reason FROM history "
    "WHERE vendor = ? AND product = ? AND revision = ? AND serial = ? ORDER BY sequence";
constexpr const char* devices_sql =
    "SELECT vendor, product, revision, serial, first_ms, last_ms, lines FROM devices ORDER BY 1, 2, 3, 4";

}  // namespace

/// A prepared statement in use: parameters in order, reset at the end.
class Query {
 public:
  explicit Query(SQLite::Statement& statement) : statement_(statement) {}
  ~Query() { statement_.tryReset(); }
  Query(const Query&) = delete;
  Query& operator=(const Query&) = delete;

  Query& operator<<(std::int64_t value) {
    statement_.bind(next_++, value);
    return *this;
  }
  Query& operator<<(std::string_view value) {
    statement_.bind(next_++, std::string(value));
    return *this;
  }
  Query& operator<<(const LssAddress& a) {
    for (unsigned i = 0; i < 4; ++i) *this << static_cast<std::int64_t>(a.part(i));
    return *this;
  }
  Query& skip(int parameters) {  // NULL
    for (int i = 0; i < parameters; ++i) statement_.bind(next_++);
    return *this;
  }

  bool row() { return statement_.executeStep(); }
  void run() { statement_.exec(); }
  [[nodiscard]] bool null(int column) { return statement_.getColumn(column).isNull(); }
  [[nodiscard]] std::int64_t number(int column) { return statement_.getColumn(column).getInt64(); }
  [[nodiscard]] std::string text(int column) { return statement_.getColumn(column).getString(); }
  [[nodiscard]] LssAddress address(int column) {
    const auto part = [&](int i) { return static_cast<std::uint32_t>(number(column + i)); };
    return {part(0), part(1), part(2), part(3)};
  }
  [[nodiscard]] NodeId node_id(int column) { return NodeId(static_cast<std::uint8_t>(number(column))); }

 private:
  SQLite::Statement& statement_;
  int next_ = 1;
};

namespace {

/// The rows of the history's queries.
std::vector<HistoryEntry> lines_of(Query& query) {
  std::vector<HistoryEntry> lines;
  while (query.row()) {
    HistoryEntry line;
    if (!query.null(0)) line.device = query.address(0);
    line.sequence = query.number(4);
    line.stamp_ms = query.number(5);
    if (!query.null(6)) line.slot = SlotId{query.number(6)};
    line.event = query.text(7);
    line.id = query.node_id(8);
    line.reason = query.text(9);
    lines.push_back(std::move(line));
  }
  return lines;
}

/// An error's text is static: of each file and cause there is one, for as long as the process.
const char* kept(std::string text) {
  static std::mutex one_at_a_time;
  static std::set<std::string> texts;
  const std::lock_guard held(one_at_a_time);
  return texts.insert(std::move(text)).first->c_str();
}

}  // namespace

std::string cause_of(int code, const char* what) {
  switch (code & 0xFF) {
    case SQLITE_FULL: return "the disk is full; make room on it";
    case SQLITE_READONLY:
    case SQLITE_PERM: return "the file or its folder is read-only; make both writable";
    case SQLITE_CANTOPEN: return "it cannot be opened for writing; is its folder there and writable?";
    case SQLITE_BUSY:
    case SQLITE_LOCKED: return "another program has it open; close that";
    case SQLITE_CORRUPT:
    case SQLITE_NOTADB: return fmt::format("it is damaged ({}); restore a copy", what);
    case SQLITE_IOERR: return fmt::format("the disk fails ({}); look at the disk and its cable", what);
    default: return what;
  }
}

tl::unexpected<Error> Database::Impl::failed(const SQLite::Exception& error, const char* what) const {
  const int code = error.getExtendedErrorCode();
  const char* const text = kept(fmt::format("{}: {}: {}", db->getFilename(), what, cause_of(code, error.what())));
  return fail(Error{.code = Errc::io, .detail = static_cast<std::uint32_t>(code), .text = text});
}

SQLite::Statement& Database::Impl::statement(const char* sql) {
  const auto it = statements.find(sql);
  if (it != statements.end()) return it->second;
  return statements.emplace(std::piecewise_construct, std::forward_as_tuple(sql), std::forward_as_tuple(*db, sql))
      .first->second;
}

std::optional<SlotId> Database::Impl::find_slot(const SlotName& name) {
  Query query(statement(find_slot_sql));
  query << name.machine << name.bus << name.name;
  if (!query.row()) return std::nullopt;
  return SlotId{query.number(0)};
}

SlotId Database::Impl::add_slot(const SlotName& name) {
  {
    Query query(statement(add_slot_sql));
    query << name.machine << name.bus << name.name;
    query.run();
  }
  const SlotId slot{db->getLastInsertRowid()};
  log(slot, "declared", std::nullopt, NodeId(), name.name);
  return slot;
}

bool Database::Impl::has_slot(SlotId slot) {
  Query query(statement(has_slot_sql));
  query << slot.value;
  return query.row();
}

std::optional<Assignment> Database::Impl::seat(SlotId slot, std::string_view fact) {
  Query query(statement(get_seat_sql));
  query << slot.value << fact;
  if (!query.row()) return std::nullopt;
  return Assignment{query.address(0), query.node_id(4)};
}

void Database::Impl::put_seat(SlotId slot, std::string_view fact, const Assignment& seat) {
  Query query(statement(put_seat_sql));
  query << seat.device << std::int64_t{seat.id.value()} << slot.value << fact;
  query.run();
}

std::vector<SlotRecord> Database::Impl::records_of(Query& query) {
  std::vector<SlotRecord> records;
  while (query.row()) {
    const SlotId slot{query.number(0)};
    if (records.empty() || records.back().slot != slot) {
      records.push_back({slot, {query.text(1), query.text(2), query.text(3)}, std::nullopt, std::nullopt, {}});
    }
    if (query.null(4)) continue;
    auto& fact = query.text(4) == "asked" ? records.back().intended : records.back().confirmed;
    fact = Assignment{query.address(5), query.node_id(9)};
  }
  return records;
}

// Both in the order of their slots.
void Database::Impl::add_configurations(Query& query, std::vector<SlotRecord>& records) {
  using Stage = places::Configured::Stage;
  auto it = records.begin();
  while (query.row()) {
    const SlotId slot{query.number(0)};
    while (it != records.end() && it->slot < slot) ++it;
    if (it == records.end() || it->slot != slot) continue;
    const auto text = query.text(1);
    const auto stage = text == name(Stage::done)          ? Stage::done
                       : text == name(Stage::power_cycle) ? Stage::power_cycle
                                                          : Stage::writing;
    const auto number = [&](int column) { return static_cast<std::uint32_t>(query.number(column)); };
    it->configured = places::Configured{stage, query.address(2), number(6), number(7)};
  }
}

void Database::Impl::log(std::optional<SlotId> slot, std::string_view event, const std::optional<LssAddress>& device,
                         NodeId id, std::string_view reason) {
  Query query(statement(log_sql));
  if (device) {
    query << *device;
  } else {
    query.skip(4);
  }
  query << stamp_ms;
  if (slot) {
    query << slot->value;
  } else {
    query.skip(1);
  }
  query << event << std::int64_t{id.value()} << reason;
  query.run();
}

template <class Body>
auto Database::Impl::write(const char* what, Body body) -> decltype(body()) {
  try {
    SQLite::Transaction transaction(*db, SQLite::TransactionBehavior::IMMEDIATE);
    auto result = body();
    if (result) transaction.commit();
    return result;
  } catch (const SQLite::Exception& error) {
    return failed(error, what);
  }
}

template <class Body>
auto Database::Impl::read(const char* what, Body body) -> decltype(body()) {
  try {
    return body();
  } catch (const SQLite::Exception& error) {
    return failed(error, what);
  }
}

Database::Database(std::unique_ptr<Impl> impl) noexcept : impl_(std::move(impl)) {}
Database::~Database() = default;

void Database::stamp(std::int64_t now_ms) noexcept { impl_->stamp_ms = now_ms; }

Result<SlotId> Database::declare(const SlotName& name) {
  const auto slots = declare_all({name});
  if (!slots) return fail(slots.error());
  return slots->front();
}

Result<std::vector<SlotId>> Database::declare_all(const std::vector<SlotName>& names) {
  // A start that changes nothing writes nothing.
  const auto known = impl_->read("looking for slots", [&]() -> Result<std::vector<SlotId>> {
    std::vector<SlotId> slots;
    for (const auto& name : names) {
      const auto slot = impl_->find_slot(name);
      if (!slot) break;
      slots.push_back(*slot);
    }
    return slots;
  });
  if (!known || known->size() == names.size()) return known;
  return impl_->write("adding slots", [&]() -> Result<std::vector<SlotId>> {
    std::vector<SlotId> slots;
    for (const auto& name : names) {
      const auto slot = impl_->find_slot(name);
      slots.push_back(slot ? *slot : impl_->add_slot(name));
    }
    return slots;
  });
}

Result<std::vector<SlotRecord>> Database::load(std::string_view machine) {
  return impl_->read("loading the slots", [&]() -> Result<std::vector<SlotRecord>> {
    Query slots(impl_->statement(load_sql));
    slots << machine;
    auto records = Impl::records_of(slots);
    Query configurations(impl_->statement(configurations_sql));
    configurations << machine;
    Impl::add_configurations(configurations, records);
    return records;
  });
}

Result<SlotRecord> Database::load(SlotId slot) {
  return impl_->read("loading a slot", [&]() -> Result<SlotRecord> {
    Query slots(impl_->statement(load_slot_sql));
    slots << slot.value;
    auto records = Impl::records_of(slots);
    if (records.empty()) return fail(Errc::not_found, "no such slot");
    Query configuration(impl_->statement(configuration_sql));
    configuration << slot.value;
    Impl::add_configurations(configuration, records);
    return records.front();
  });
}

Result<void> Database::ask(SlotId slot, const Assignment& seat, std::string_view reason) {
  return impl_->write("writing an intention", [&]() -> Result<void> {
    if (!impl_->has_slot(slot)) return fail(Errc::not_found, "no such slot");
    {
      Query query(impl_->statement(other_seat_sql));
      query << seat.device << slot.value;
      if (query.row()) return fail(Errc::duplicate, "the device sits in another slot");
    }
    for (const char* const fact : {"asked", "confirmed"}) {
      const auto other = impl_->seat(slot, fact);
      if (other && other->device != seat.device) return fail(Errc::duplicate, "the slot is another device's");
    }
    impl_->put_seat(slot, "asked", seat);
    impl_->log(slot, "asked", seat.device, seat.id, reason);
    return {};
  });
}

Result<void> Database::confirm(SlotId slot, const Assignment& seat, std::string_view reason) {
  return impl_->write("writing a binding", [&]() -> Result<void> {
    if (!impl_->has_slot(slot)) return fail(Errc::not_found, "no such slot");
    if (impl_->seat(slot, "asked") != seat) return fail(Errc::mismatch, "confirmed something that was not asked for");
    {
      Query query(impl_->statement(drop_asked_sql));
      query << slot.value;
      query.run();
    }
    impl_->put_seat(slot, "confirmed", seat);
    {
      Query query(impl_->statement(drop_blank_sql));
      query << seat.device;
      query.run();
    }
    impl_->log(slot, "confirmed", seat.device, seat.id, reason);
    return {};
  });
}

Result<void> Database::clear(SlotId slot, std::string_view reason) {
  return impl_->write("clearing a slot", [&]() -> Result<void> {
    if (!impl_->has_slot(slot)) return fail(Errc::not_found, "no such slot");
    auto who = impl_->seat(slot, "asked");
    if (!who) who = impl_->seat(slot, "confirmed");
    impl_->log(slot, "cleared", who ? std::optional(who->device) : std::nullopt, NodeId(), reason);
    for (const char* const sql : {drop_seats_sql, drop_configuration_sql}) {
      Query query(impl_->statement(sql));
      query << slot.value;
      query.run();
    }
    return {};
  });
}

Result<void> Database::configure(SlotId slot, const places::Configured& configured, std::string_view reason) {
  return impl_->write("writing a configuration", [&]() -> Result<void> {
    if (!impl_->has_slot(slot)) return fail(Errc::not_found, "no such slot");
    {
      Query query(impl_->statement(put_configuration_sql));
      query << configured.device << slot.value << name(configured.stage) << std::int64_t{configured.days}
            << std::int64_t{configured.ms};
      query.run();
    }
    const auto confirmed = impl_->seat(slot, "confirmed");
    impl_->log(slot, name(configured.stage), configured.device, confirmed ? confirmed->id : NodeId(), reason);
    return {};
  });
}

Result<void> Database::ask_blank(const places::UnfinishedBlank& blank, std::string_view reason) {
  return impl_->write("writing an intention", [&]() -> Result<void> {
    {
      Query query(impl_->statement(put_blank_sql));
      query << blank.device << blank.machine << blank.bus << std::int64_t{blank.id.value()};
      query.run();
    }
    impl_->log(std::nullopt, "blank asked", blank.device, blank.id, reason);
    return {};
  });
}

Result<void> Database::confirm_blank(const LssAddress& device, std::string_view reason) {
  return impl_->write("writing that a device is blank", [&]() -> Result<void> {
    {
      Query query(impl_->statement(drop_blank_sql));
      query << device;
      query.run();
    }
    impl_->log(std::nullopt, "blanked", device, NodeId(), reason);
    return {};
  });
}

Result<void> Database::drop_blank(const LssAddress& device, std::string_view reason) {
  return impl_->write("dropping an intention", [&]() -> Result<void> {
    std::optional<NodeId> id;
    {
      Query query(impl_->statement(get_blank_sql));
      query << device;
      if (query.row()) id = query.node_id(0);
    }
    if (!id) return fail(Errc::not_found, "no unfinished intention of this device");
    {
      Query query(impl_->statement(drop_blank_sql));
      query << device;
      query.run();
    }
    impl_->log(std::nullopt, "blank dropped", device, *id, reason);
    return {};
  });
}

Result<std::vector<places::UnfinishedBlank>> Database::unfinished_blanks() {
  return impl_->read("loading intentions", [&]() -> Result<std::vector<places::UnfinishedBlank>> {
    std::vector<places::UnfinishedBlank> blanks;
    Query query(impl_->statement(blanks_sql));
    while (query.row()) blanks.push_back({query.address(0), query.text(4), query.text(5), query.node_id(6)});
    return blanks;
  });
}

Result<void> Database::mark(places::Mark mark, const LssAddress& device, NodeId id, std::string_view reason) {
  return impl_->write("marking a device", [&]() -> Result<void> {
    {
      Query query(impl_->statement(put_mark_sql));
      query << device << static_cast<std::int64_t>(mark) << std::int64_t{id.value()};
      query.run();
    }
    impl_->log(std::nullopt, name(mark), device, id, reason);
    return {};
  });
}

Result<void> Database::unmark(places::Mark mark, const LssAddress& device, std::string_view reason) {
  return impl_->write("taking a mark away", [&]() -> Result<void> {
    {
      Query query(impl_->statement(drop_mark_sql));
      query << device << static_cast<std::int64_t>(mark);
      query.run();
    }
    impl_->log(std::nullopt, name_of_end(mark), device, NodeId(), reason);
    return {};
  });
}

Result<std::vector<places::Marked>> Database::marked(places::Mark mark) {
  return impl_->read("loading marks", [&]() -> Result<std::vector<places::Marked>> {
    std::vector<places::Marked> devices;
    Query query(impl_->statement(marked_sql));
    query << static_cast<std::int64_t>(mark);
    while (query.row()) devices.push_back({query.address(0), query.node_id(4)});
    return devices;
  });
}

Result<bool> Database::is_marked(places::Mark mark, const LssAddress& device) {
  return impl_->read("loading a mark", [&]() -> Result<bool> {
    Query query(impl_->statement(is_marked_sql));
    query << device << static_cast<std::int64_t>(mark);
    return query.row();
  });
}

Result<void> Database::lend(const places::LentId& lent) {
  return impl_->write("writing a loan", [&]() -> Result<void> {
    Query query(impl_->statement(put_loan_sql));
    query << lent.device << lent.machine << lent.bus << std::int64_t{lent.id.value()};
    query.run();
    return {};
  });
}

Result<void> Database::give_back(const LssAddress& device) {
  return impl_->write("writing that a loan ended", [&]() -> Result<void> {
    Query query(impl_->statement(drop_loan_sql));
    query << device;
    query.run();
    return {};
  });
}

Result<std::vector<places::LentId>> Database::lent() {
  return impl_->read("loading loans", [&]() -> Result<std::vector<places::LentId>> {
    std::vector<places::LentId> all;
    Query query(impl_->statement(loans_sql));
    while (query.row()) all.push_back({query.address(0), query.text(4), query.text(5), query.node_id(6)});
    return all;
  });
}

Result<void> Database::note(const HistoryEntry& entry) {
  return impl_->write("writing history", [&]() -> Result<void> {
    impl_->log(entry.slot, entry.event, entry.device, entry.id, entry.reason);
    return {};
  });
}

Result<std::vector<HistoryEntry>> Database::history(std::optional<SlotId> slot) {
  return impl_->read("loading history", [&]() -> Result<std::vector<HistoryEntry>> {
    Query query(impl_->statement(slot ? history_of_slot_sql : history_sql));
    if (slot) query << slot->value;
    return lines_of(query);
  });
}

Result<std::vector<HistoryEntry>> Database::history_of(const LssAddress& device) {
  return impl_->read("loading a device's history", [&]() -> Result<std::vector<HistoryEntry>> {
    Query query(impl_->statement(history_of_device_sql));
    query << device;
    return lines_of(query);
  });
}

Result<std::vector<DeviceSeen>> Database::devices() {
  return impl_->read("loading devices", [&]() -> Result<std::vector<DeviceSeen>> {
    std::vector<DeviceSeen> devices;
    Query query(impl_->statement(devices_sql));
    while (query.row()) devices.push_back({query.address(0), query.number(4), query.number(5), query.number(6)});
    return devices;
  });
}

}  // namespace berth::store
