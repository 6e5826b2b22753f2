#include "berth/store/database.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <utility>

#include "berth/base/kept.hpp"
#include "berth/store/database_impl.hpp"

namespace berth::store {
namespace {

using places::Assignment;
using places::BusDevice;
using places::HistoryEntry;
using places::SlotId;
using places::SlotName;
using places::SlotRecord;

// Each text occurs once: its address identifies the prepared statement.
constexpr const char* find_slot_sql = "SELECT id FROM slots WHERE machine = ? AND bus = ? AND name = ?";
constexpr const char* add_slot_sql = "INSERT INTO slots (machine, bus, name) VALUES (?, ?, ?)";
constexpr const char* bus_of_slot_sql = "SELECT machine, bus FROM slots WHERE id = ?";
constexpr const char* load_sql =
    "SELECT s.id, s.machine, s.bus, s.name, t.fact, t.vendor, t.product, t.revision, t.serial, t.apart, t.node_id "
    "FROM slots s LEFT JOIN seats t ON t.slot = s.id WHERE s.machine = ? ORDER BY s.id, t.fact";
constexpr const char* load_slot_sql =
    "SELECT s.id, s.machine, s.bus, s.name, t.fact, t.vendor, t.product, t.revision, t.serial, t.apart, t.node_id "
    "FROM slots s LEFT JOIN seats t ON t.slot = s.id WHERE s.id = ? ORDER BY t.fact";
// The device's other slot on this slot's bus. Uses the index of the addresses: a device has few twins.
constexpr const char* other_seat_sql =
    "SELECT o.machine, o.bus, o.name FROM slots s CROSS JOIN seats t CROSS JOIN slots o WHERE t.vendor = ? AND "
    "t.product = ? AND t.revision = ? AND t.serial = ? AND t.apart = ? AND s.id = ? AND o.id = t.slot AND "
    "o.id <> s.id AND "
    "o.machine = s.machine AND o.bus = s.bus LIMIT 1";
constexpr const char* get_seat_sql =
    "SELECT vendor, product, revision, serial, apart, node_id FROM seats WHERE slot = ? AND fact = ?";
constexpr const char* put_seat_sql =
    "INSERT INTO seats (vendor, product, revision, serial, apart, node_id, slot, fact) VALUES (?, ?, ?, ?, ?, ?, ?, ?) "
    "ON CONFLICT (slot, fact) DO UPDATE SET vendor = excluded.vendor, product = excluded.product, "
    "revision = excluded.revision, serial = excluded.serial, apart = excluded.apart, node_id = excluded.node_id";
constexpr const char* configurations_sql =
    "SELECT c.slot, c.stage, c.vendor, c.product, c.revision, c.serial, c.apart, c.days, c.ms FROM configurations c "
    "JOIN slots s ON s.id = c.slot WHERE s.machine = ? ORDER BY c.slot";
constexpr const char* configuration_sql =
    "SELECT slot, stage, vendor, product, revision, serial, apart, days, ms FROM configurations WHERE slot = ?";
constexpr const char* put_configuration_sql =
    "INSERT OR REPLACE INTO configurations (vendor, product, revision, serial, apart, slot, stage, days, ms) "
    "VALUES (?, ?, ?, ?, ?, ?, ?, ?, ?)";
constexpr const char* drop_configuration_sql = "DELETE FROM configurations WHERE slot = ?";
constexpr const char* drop_asked_sql = "DELETE FROM seats WHERE slot = ? AND fact = 'asked'";
constexpr const char* drop_seats_sql = "DELETE FROM seats WHERE slot = ?";
constexpr const char* put_blank_sql =
    "INSERT INTO blanks (vendor, product, revision, serial, apart, machine, bus, node_id) "
    "VALUES (?, ?, ?, ?, ?, ?, ?, ?) "
    "ON CONFLICT DO UPDATE SET node_id = excluded.node_id";
// A row without a bus applies to any bus. It is deleted as soon as a row of the device is written or deleted for one
// bus.
constexpr const char* drop_blank_of_any_bus_sql =
    "DELETE FROM blanks WHERE vendor = ? AND product = ? AND revision = ? AND serial = ? AND apart = ? AND "
    "bus = ''";
constexpr const char* drop_blank_sql =
    "DELETE FROM blanks WHERE vendor = ? AND product = ? AND revision = ? AND serial = ? AND apart = ? AND "
    "(machine = ? AND bus = ? OR bus = '')";
constexpr const char* blanks_sql =
    "SELECT vendor, product, revision, serial, apart, machine, bus, node_id FROM blanks ORDER BY id";
constexpr const char* get_blank_sql =
    "SELECT node_id FROM blanks WHERE vendor = ? AND product = ? AND revision = ? AND serial = ? AND apart = ? AND "
    "(machine = ? AND bus = ? OR bus = '') ORDER BY id LIMIT 1";
// Stored as the numbers of `places::Mark`, which are never reused.
constexpr const char* put_mark_sql =
    "INSERT OR REPLACE INTO marks (vendor, product, revision, serial, apart, machine, bus, mark, node_id) "
    "VALUES (?, ?, ?, ?, ?, ?, ?, ?, ?)";
constexpr const char* drop_mark_of_any_bus_sql =
    "DELETE FROM marks WHERE vendor = ? AND product = ? AND revision = ? AND serial = ? AND apart = ? AND mark = ? AND "
    "bus = ''";
constexpr const char* drop_mark_sql =
    "DELETE FROM marks WHERE vendor = ? AND product = ? AND revision = ? AND serial = ? AND apart = ? AND "
    "(machine = ? AND bus = ? OR bus = '') AND mark = ?";
constexpr const char* marked_sql =
    "SELECT vendor, product, revision, serial, apart, node_id, machine, bus FROM marks WHERE mark = ? "
    "ORDER BY 1, 2, 3, 4, 5, 7, 8";
constexpr const char* is_marked_sql =
    "SELECT 1 FROM marks WHERE vendor = ? AND product = ? AND revision = ? AND serial = ? AND apart = ? AND "
    "(machine = ? AND bus = ? OR bus = '') AND mark = ?";
constexpr const char* put_loan_sql =
    "INSERT OR REPLACE INTO loans (vendor, product, revision, serial, apart, machine, bus, node_id) "
    "VALUES (?, ?, ?, ?, ?, ?, ?, ?)";
constexpr const char* drop_loan_of_any_bus_sql =
    "DELETE FROM loans WHERE vendor = ? AND product = ? AND revision = ? AND serial = ? AND apart = ? AND "
    "bus = ''";
constexpr const char* drop_loan_sql =
    "DELETE FROM loans WHERE vendor = ? AND product = ? AND revision = ? AND serial = ? AND apart = ? AND "
    "(machine = ? AND bus = ? OR bus = '')";
constexpr const char* loans_sql =
    "SELECT vendor, product, revision, serial, apart, machine, bus, node_id FROM loans "
    "ORDER BY 1, 2, 3, 4, 5, 6, 7";
constexpr const char* log_sql =
    "INSERT INTO history (vendor, product, revision, serial, apart, stamp_ms, slot, event, node_id, reason, machine, "
    "bus) VALUES (?, ?, ?, ?, ?, ?, ?, ?, ?, ?, ?, ?)";
// A line about a slot has the slot's bus; a line without a slot stores its bus itself.
constexpr const char* history_sql =
    "SELECT h.vendor, h.product, h.revision, h.serial, h.apart, h.sequence, h.stamp_ms, h.slot, h.event, h.node_id, "
    "h.reason, coalesce(s.machine, h.machine), coalesce(s.bus, h.bus) FROM history h LEFT JOIN slots s ON s.id = "
    "h.slot "
    "ORDER BY h.sequence";
constexpr const char* history_of_slot_sql =
    "SELECT h.vendor, h.product, h.revision, h.serial, h.apart, h.sequence, h.stamp_ms, h.slot, h.event, h.node_id, "
    "h.reason, coalesce(s.machine, h.machine), coalesce(s.bus, h.bus) FROM history h LEFT JOIN slots s ON s.id = "
    "h.slot "
    "WHERE h.slot = ? ORDER BY h.sequence";
constexpr const char* history_of_device_sql =
    "SELECT h.vendor, h.product, h.revision, h.serial, h.apart, h.sequence, h.stamp_ms, h.slot, h.event, h.node_id, "
    "h.reason, coalesce(s.machine, h.machine), coalesce(s.bus, h.bus) FROM history h LEFT JOIN slots s ON s.id = "
    "h.slot "
    "WHERE h.vendor = ? AND h.product = ? AND h.revision = ? AND h.serial = ? AND h.apart = ? ORDER BY h.sequence";
constexpr const char* devices_sql =
    "SELECT vendor, product, revision, serial, apart, first_ms, last_ms, lines FROM devices "
    "ORDER BY 1, 2, 3, 4, 5";

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
  /// Five parameters: the address, and what distinguishes the device from others with it (`apart`).
  Query& operator<<(const Identity& device) {
    for (unsigned i = 0; i < 4; ++i) *this << static_cast<std::int64_t>(device.address.part(i));
    return *this << (std::int64_t{device.unknown} << 8 | device.at.value());
  }
  Query& operator<<(const BusDevice& who) { return *this << who.device << who.on.machine << who.on.bus; }
  Query& skip(int parameters) {  // NULL
    for (int i = 0; i < parameters; ++i) statement_.bind(next_++);
    return *this;
  }

  bool row() { return statement_.executeStep(); }
  void run() { statement_.exec(); }
  [[nodiscard]] bool null(int column) { return statement_.getColumn(column).isNull(); }
  [[nodiscard]] std::int64_t number(int column) { return statement_.getColumn(column).getInt64(); }
  [[nodiscard]] std::string text(int column) { return statement_.getColumn(column).getString(); }
  [[nodiscard]] Identity identity(int column) {
    const auto part = [&](int i) { return static_cast<std::uint32_t>(number(column + i)); };
    Identity device(part(0), part(1), part(2), part(3));
    device.unknown = static_cast<std::uint8_t>(part(4) >> 8 & Identity::all_unknown);
    device.at = NodeId::make(part(4) & 0xFFU).value_or(NodeId());
    return device;
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
    if (!query.null(0)) line.device = query.identity(0);
    line.sequence = query.number(5);
    line.stamp_ms = query.number(6);
    if (!query.null(7)) line.slot = SlotId{query.number(7)};
    line.event = query.text(8);
    line.id = query.node_id(9);
    line.reason = query.text(10);
    line.on = {query.text(11), query.text(12)};
    lines.push_back(std::move(line));
  }
  return lines;
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

std::optional<places::BusName> Database::Impl::bus_of(SlotId slot) {
  Query query(statement(bus_of_slot_sql));
  query << slot.value;
  if (!query.row()) return std::nullopt;
  return places::BusName{query.text(0), query.text(1)};
}

std::optional<Assignment> Database::Impl::seat(SlotId slot, std::string_view fact) {
  Query query(statement(get_seat_sql));
  query << slot.value << fact;
  if (!query.row()) return std::nullopt;
  return Assignment{query.identity(0), query.node_id(5)};
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
    fact = Assignment{query.identity(5), query.node_id(10)};
  }
  return records;
}

// The query's rows and `records` are both in the order of their slots.
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
    it->configured = places::Configured{stage, query.identity(2), number(7), number(8)};
  }
}

void Database::Impl::log(const HistoryEntry& line) {
  Query query(statement(log_sql));
  if (line.device) {
    query << *line.device;
  } else {
    query.skip(4) << std::int64_t{NodeId::unconfigured_value};
  }
  query << owner->now_ms();
  if (line.slot) {
    query << line.slot->value;
  } else {
    query.skip(1);
  }
  const places::BusName on = line.slot ? places::BusName() : line.on;
  query << line.event << std::int64_t{line.id.value()} << line.reason << on.machine << on.bus;
  query.run();
}

void Database::Impl::log(SlotId slot, std::string_view event, const std::optional<Identity>& device, NodeId id,
                         std::string_view reason) {
  log({0, 0, slot, std::string(event), device, id, std::string(reason), {}});
}

void Database::Impl::log(const BusDevice& who, std::string_view event, NodeId id, std::string_view reason) {
  log({0, 0, std::nullopt, std::string(event), who.device, id, std::string(reason), who.on});
}

template <class Device>
void Database::Impl::run_on(const char* sql, const Device& device) {
  Query query(statement(sql));
  query << device;
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

Database::Database(std::unique_ptr<Impl> impl) noexcept : impl_(std::move(impl)) { impl_->owner = this; }
Database::~Database() = default;

Result<SlotId> Database::declare(const SlotName& name) {
  const auto slots = declare_all({name});
  if (!slots) return fail(slots.error());
  return slots->front();
}

Result<std::vector<SlotId>> Database::declare_all(const std::vector<SlotName>& names) {
  // Looks first, so that a start without new slots writes nothing.
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
    if (!impl_->bus_of(slot)) return fail(Errc::not_found, "no such slot");
    {
      Query query(impl_->statement(other_seat_sql));
      query << seat.device << slot.value;
      if (query.row()) return fail(places::sits_in({query.text(0), query.text(1), query.text(2)}));
    }
    for (const char* const fact : {"asked", "confirmed"}) {
      const auto other = impl_->seat(slot, fact);
      if (other && !places::is_of(other->device, seat)) return fail(places::owned_by_another());
    }
    impl_->put_seat(slot, "asked", seat);
    impl_->log(slot, "asked", seat.device, seat.id, reason);
    return {};
  });
}

Result<void> Database::confirm(SlotId slot, const Assignment& seat, std::string_view reason) {
  return impl_->write("writing a binding", [&]() -> Result<void> {
    const auto on = impl_->bus_of(slot);
    if (!on) return fail(Errc::not_found, "no such slot");
    if (impl_->seat(slot, "asked") != seat)
      return fail(Errc::mismatch, "the confirmation differs from the stored intention");
    {
      Query query(impl_->statement(drop_asked_sql));
      query << slot.value;
      query.run();
    }
    impl_->put_seat(slot, "confirmed", seat);
    impl_->run_on(drop_blank_sql, BusDevice{seat.device, *on});
    impl_->log(slot, "confirmed", seat.device, seat.id, reason);
    return {};
  });
}

Result<void> Database::clear(SlotId slot, std::string_view reason) {
  return impl_->write("clearing a slot", [&]() -> Result<void> {
    if (!impl_->bus_of(slot)) return fail(Errc::not_found, "no such slot");
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
    if (!impl_->bus_of(slot)) return fail(Errc::not_found, "no such slot");
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
    impl_->run_on(drop_blank_of_any_bus_sql, blank.device);
    {
      Query query(impl_->statement(put_blank_sql));
      query << blank.who() << std::int64_t{blank.id.value()};
      query.run();
    }
    impl_->log(blank.who(), "blank asked", blank.id, reason);
    return {};
  });
}

Result<void> Database::confirm_blank(const BusDevice& who, std::string_view reason) {
  return impl_->write("writing that a device is blank", [&]() -> Result<void> {
    impl_->run_on(drop_blank_sql, who);
    impl_->log(who, "blanked", NodeId(), reason);
    return {};
  });
}

Result<void> Database::drop_blank(const BusDevice& who, std::string_view reason) {
  return impl_->write("dropping an intention", [&]() -> Result<void> {
    std::optional<NodeId> id;
    {
      Query query(impl_->statement(get_blank_sql));
      query << who;
      if (query.row()) id = query.node_id(0);
    }
    if (!id) return fail(Errc::not_found, "no unfinished intention of this device");
    impl_->run_on(drop_blank_sql, who);
    impl_->log(who, "blank dropped", *id, reason);
    return {};
  });
}

Result<std::vector<places::UnfinishedBlank>> Database::unfinished_blanks() {
  return impl_->read("loading intentions", [&]() -> Result<std::vector<places::UnfinishedBlank>> {
    std::vector<places::UnfinishedBlank> blanks;
    Query query(impl_->statement(blanks_sql));
    while (query.row()) blanks.push_back({query.identity(0), query.text(5), query.text(6), query.node_id(7)});
    return blanks;
  });
}

Result<void> Database::mark(places::Mark mark, const BusDevice& who, NodeId id, std::string_view reason) {
  return impl_->write("marking a device", [&]() -> Result<void> {
    {
      Query query(impl_->statement(drop_mark_of_any_bus_sql));
      query << who.device << static_cast<std::int64_t>(mark);
      query.run();
    }
    {
      Query query(impl_->statement(put_mark_sql));
      query << who << static_cast<std::int64_t>(mark) << std::int64_t{id.value()};
      query.run();
    }
    impl_->log(who, name(mark), id, reason);
    return {};
  });
}

Result<void> Database::unmark(places::Mark mark, const BusDevice& who, std::string_view reason) {
  return impl_->write("taking a mark away", [&]() -> Result<void> {
    {
      Query query(impl_->statement(drop_mark_sql));
      query << who << static_cast<std::int64_t>(mark);
      query.run();
    }
    impl_->log(who, name_of_end(mark), NodeId(), reason);
    return {};
  });
}

Result<std::vector<places::Marked>> Database::marked(places::Mark mark) {
  return impl_->read("loading marks", [&]() -> Result<std::vector<places::Marked>> {
    std::vector<places::Marked> devices;
    Query query(impl_->statement(marked_sql));
    query << static_cast<std::int64_t>(mark);
    while (query.row()) devices.push_back({query.identity(0), query.node_id(5), {query.text(6), query.text(7)}});
    return devices;
  });
}

Result<bool> Database::is_marked(places::Mark mark, const BusDevice& who) {
  return impl_->read("loading a mark", [&]() -> Result<bool> {
    Query query(impl_->statement(is_marked_sql));
    query << who << static_cast<std::int64_t>(mark);
    return query.row();
  });
}

Result<void> Database::lend(const places::LentId& lent) {
  return impl_->write("writing a loan", [&]() -> Result<void> {
    impl_->run_on(drop_loan_of_any_bus_sql, lent.device);
    Query query(impl_->statement(put_loan_sql));
    query << lent.who() << std::int64_t{lent.id.value()};
    query.run();
    return {};
  });
}

Result<void> Database::give_back(const BusDevice& who) {
  return impl_->write("writing that a loan ended", [&]() -> Result<void> {
    impl_->run_on(drop_loan_sql, who);
    return {};
  });
}

Result<std::vector<places::LentId>> Database::lent() {
  return impl_->read("loading loans", [&]() -> Result<std::vector<places::LentId>> {
    std::vector<places::LentId> all;
    Query query(impl_->statement(loans_sql));
    while (query.row()) all.push_back({query.identity(0), query.text(5), query.text(6), query.node_id(7)});
    return all;
  });
}

Result<void> Database::note(const HistoryEntry& entry) {
  return impl_->write("writing history", [&]() -> Result<void> {
    impl_->log(entry);
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

Result<std::vector<HistoryEntry>> Database::history_of(const BusDevice& who) {
  return impl_->read("loading a device's history", [&]() -> Result<std::vector<HistoryEntry>> {
    Query query(impl_->statement(history_of_device_sql));
    query << who.device;
    auto lines = lines_of(query);
    std::erase_if(lines, [&](const HistoryEntry& line) { return !line.on.covers(who.on); });
    return lines;
  });
}

Result<std::vector<DeviceSeen>> Database::devices() {
  return impl_->read("loading devices", [&]() -> Result<std::vector<DeviceSeen>> {
    std::vector<DeviceSeen> devices;
    Query query(impl_->statement(devices_sql));
    while (query.row()) devices.push_back({query.identity(0), query.number(5), query.number(6), query.number(7)});
    return devices;
  });
}

}  // namespace berth::store
