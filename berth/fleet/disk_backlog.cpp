#include "berth/fleet/disk_backlog.hpp"

#include <SQLiteCpp/Database.h>
#include <SQLiteCpp/Statement.h>
#include <fmt/format.h>
#include <sqlite3.h>

#include <cerrno>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <optional>

#include "berth/base/private_file.hpp"
#include "berth/sparkplug/codec.hpp"

namespace berth::fleet {
namespace {

using sparkplug::Kept;

constexpr std::int64_t application = 0x4265'4D51;  // "BeMQ"
constexpr std::int64_t version = 1;
constexpr const char* schema[] = {
    "CREATE TABLE kept (id INTEGER PRIMARY KEY AUTOINCREMENT, device TEXT NOT NULL, change BLOB NOT NULL)",
    "CREATE TABLE numbers (name TEXT PRIMARY KEY, value INTEGER NOT NULL)"};
constexpr const char* counted = "SELECT count(*), coalesce(sum(length(device) + length(change)), 0) FROM kept";
constexpr std::uint64_t row_bytes = 32;  // of a row beside its content
constexpr std::uint64_t least_pages = 64;
constexpr std::uint64_t page_bytes = 4096;  // SQLite's default
constexpr int most_cell = 1 << 20;

sparkplug::Bytes bytes_of(const Kept& kept) {
  sparkplug::Metric metric;
  metric.name = kept.metric;
  metric.at = kept.at;
  metric.type = kept.type;
  metric.value = kept.value;
  sparkplug::set_quality(metric, kept.quality);
  sparkplug::Payload payload;
  payload.metrics.push_back(std::move(metric));
  return sparkplug::encode(payload);
}

// Empty: it is none of Berth's.
std::optional<Kept> kept_of(std::string device, std::span<const std::uint8_t> bytes) {
  auto payload = sparkplug::decode(bytes);
  if (!payload || payload->metrics.size() != 1) return std::nullopt;
  auto& metric = payload->metrics.front();
  if (!metric.name || !metric.type || !metric.at) return std::nullopt;
  return Kept{std::move(device),       *metric.name, *metric.type,
              std::move(metric.value), *metric.at,   sparkplug::quality(metric).value_or(sparkplug::Quality::bad)};
}

std::string cause_of(const SQLite::Exception& error) {
  switch (error.getErrorCode()) {
    case SQLITE_FULL: return "the disk is full; make room";
    case SQLITE_CORRUPT:
    case SQLITE_NOTADB: return "the file is damaged; move it away";
    case SQLITE_READONLY:
    case SQLITE_CANTOPEN:
    case SQLITE_PERM: return "the file cannot be written; make its folder writable";
    case SQLITE_BUSY: return "another process uses it";
    default: return error.what();
  }
}

std::int64_t pragma(SQLite::Database& db, const char* name) {
  return db.execAndGet(fmt::format("PRAGMA {}", name)).getInt64();
}

// Why it is not Berth's; empty: it is.
std::string strange(SQLite::Database& db) {
  if (pragma(db, "application_id") != application) return "this is no backlog of Berth";
  if (pragma(db, "user_version") > version) return "it is of a newer Berth";
  SQLite::Statement tables(db, "SELECT sql FROM sqlite_master WHERE name NOT LIKE 'sqlite_%' ORDER BY name");
  for (const char* const expected : schema) {
    if (!tables.executeStep() || tables.getColumn(0).getString() != expected) return "the file is damaged";
  }
  if (tables.executeStep()) return "this is no backlog of Berth";
  return db.execAndGet("PRAGMA quick_check(1)").getString() == "ok" ? std::string() : "the file is damaged";
}

void make_schema(SQLite::Database& db) {
  db.exec("BEGIN IMMEDIATE");
  for (const char* const table : schema) db.exec(table);
  db.exec(fmt::format("PRAGMA application_id = {}", application));
  db.exec(fmt::format("PRAGMA user_version = {}", version));
  db.exec("COMMIT");
}

// A file that is no SQLite file: SQLite itself notices it late, and might write to it before.
bool has_another_head(const std::string& path) {
  constexpr std::string_view magic("SQLite format 3", 16);
  std::error_code none;
  const auto size = std::filesystem::file_size(path, none);
  if (none || size == 0) return false;
  std::string head(magic.size(), '\0');
  std::ifstream in(path, std::ios::binary);
  in.read(head.data(), static_cast<std::streamsize>(head.size()));
  return !in || head != magic;
}

}  // namespace

struct DiskBacklog::Impl {
  Impl(const std::string& file, std::uint64_t most_bytes)
      : path(file), most(most_bytes), db(file, SQLite::OPEN_READWRITE | SQLite::OPEN_CREATE) {}

  std::string path;
  std::uint64_t most;
  SQLite::Database db;
  std::optional<SQLite::Statement> add, remove, next;
  std::uint64_t count = 0;
  std::uint64_t bytes = 0;
  bool open = false;  // a transaction
  std::string trouble{};

  void prepare() {
    add.emplace(db, "INSERT INTO kept (device, change) VALUES (?, ?)");
    remove.emplace(db, "DELETE FROM kept WHERE id = ? RETURNING length(device) + length(change)");
    next.emplace(db, "SELECT id, device, change FROM kept WHERE id > ? ORDER BY id LIMIT ?");
    count_again();
  }
  void count_again() {
    SQLite::Statement all(db, counted);
    if (!all.executeStep()) return;
    count = static_cast<std::uint64_t>(all.getColumn(0).getInt64());
    bytes = static_cast<std::uint64_t>(all.getColumn(1).getInt64()) + count * row_bytes;
  }
  void begin() {
    if (open) return;
    db.exec("BEGIN IMMEDIATE");
    open = true;
    trouble.clear();
  }
  // What the last transaction would have done is undone.
  void failed(const SQLite::Exception& error) noexcept {
    trouble = fmt::format("{}: {}", path, cause_of(error));
    open = false;
    try {
      for (auto* const statement : {&add, &remove, &next}) (*statement)->reset();
      if (sqlite3_get_autocommit(db.getHandle()) == 0) db.exec("ROLLBACK");
      count_again();
    } catch (const SQLite::Exception&) {
      // The first error says it.
    }
  }
};

DiskBacklog::DiskBacklog(std::unique_ptr<Impl> impl) noexcept : impl_(std::move(impl)) {}

DiskBacklog::~DiskBacklog() { static_cast<void>(settle()); }

tl::expected<std::unique_ptr<DiskBacklog>, std::string> DiskBacklog::open(const std::string& path,
                                                                          std::uint64_t most_bytes) {
  const auto refuse = [&](const std::string& why) {
    return tl::unexpected(fmt::format("{}: {}; it was left as it is: move it away, or name another", path, why));
  };
  if (has_another_head(path)) return refuse("this is no backlog of Berth");
  if (!make_private(path)) return tl::unexpected(fmt::format("{}: {}", path, std::strerror(errno)));
  try {
    auto impl = std::make_unique<Impl>(path, most_bytes);
    auto& db = impl->db;
    sqlite3_db_config(db.getHandle(), SQLITE_DBCONFIG_DEFENSIVE, 1, nullptr);
    sqlite3_limit(db.getHandle(), SQLITE_LIMIT_LENGTH, most_cell);
    db.exec("PRAGMA trusted_schema = OFF");
    db.exec("PRAGMA locking_mode = EXCLUSIVE");
    const bool fresh =
        db.execAndGet("SELECT count(*) FROM sqlite_master").getInt64() == 0 && pragma(db, "application_id") == 0;
    if (!fresh) {
      if (const auto why = strange(db); !why.empty()) return refuse(why);
    }
    db.exec("PRAGMA journal_mode = WAL");
    db.exec("PRAGMA synchronous = FULL");
    db.exec(fmt::format("PRAGMA max_page_count = {}", least_pages + 2 * most_bytes / page_bytes));
    if (fresh) make_schema(db);
    impl->prepare();
    return std::unique_ptr<DiskBacklog>(new DiskBacklog(std::move(impl)));
  } catch (const SQLite::Exception& error) {
    return refuse(cause_of(error));
  }
}

bool DiskBacklog::append(const Kept& change) {
  const auto content = bytes_of(change);
  const std::uint64_t size = change.device.size() + content.size();
  if (impl_->bytes + size + row_bytes > impl_->most) return false;
  try {
    impl_->begin();
    auto& add = *impl_->add;
    add.reset();
    add.bind(1, change.device);
    add.bind(2, content.data(), static_cast<int>(content.size()));
    add.exec();
    impl_->bytes += size + row_bytes;
    ++impl_->count;
    return true;
  } catch (const SQLite::Exception& error) {
    impl_->failed(error);
    return false;
  }
}

std::vector<sparkplug::Backlog::Entry> DiskBacklog::after(std::uint64_t id, std::size_t most) const {
  std::vector<Entry> entries;
  constexpr std::uint64_t last = 0x7FFF'FFFF'FFFF'FFFF;
  if (id >= last) return entries;
  try {
    auto& next = *impl_->next;
    next.reset();
    next.bind(1, static_cast<std::int64_t>(id));
    next.bind(2, static_cast<std::int64_t>(most));
    while (next.executeStep()) {
      const auto cell = next.getColumn(2);
      const auto* const begin = static_cast<const std::uint8_t*>(cell.getBlob());
      auto kept = kept_of(next.getColumn(1).getString(), {begin, static_cast<std::size_t>(cell.getBytes())});
      // What cannot be read is passed over; without a type it fits no metric, and is then dropped.
      entries.push_back({static_cast<std::uint64_t>(next.getColumn(0).getInt64()), kept ? std::move(*kept) : Kept{}});
    }
    next.reset();
  } catch (const SQLite::Exception& error) {
    impl_->failed(error);
  }
  return entries;
}

void DiskBacklog::drop(std::span<const std::uint64_t> ids) {
  if (ids.empty()) return;
  try {
    impl_->begin();
    for (const auto id : ids) {
      auto& remove = *impl_->remove;
      remove.reset();
      remove.bind(1, static_cast<std::int64_t>(id));
      if (!remove.executeStep()) continue;
      impl_->bytes -= static_cast<std::uint64_t>(remove.getColumn(0).getInt64()) + row_bytes;
      --impl_->count;
      remove.reset();
    }
  } catch (const SQLite::Exception& error) {
    impl_->failed(error);
  }
}

std::size_t DiskBacklog::size() const { return impl_->count; }
std::uint64_t DiskBacklog::bytes() const noexcept { return impl_->bytes; }
const std::string& DiskBacklog::trouble() const noexcept { return impl_->trouble; }

bool DiskBacklog::settle() {
  if (!impl_->open) return impl_->trouble.empty();
  try {
    for (auto* const statement : {&impl_->add, &impl_->remove, &impl_->next}) (*statement)->reset();
    impl_->db.exec("COMMIT");
    impl_->open = false;
    return true;
  } catch (const SQLite::Exception& error) {
    impl_->failed(error);
    return false;
  }
}

std::uint8_t DiskBacklog::bd_seq() const {
  try {
    SQLite::Statement number(impl_->db, "SELECT value FROM numbers WHERE name = 'bdSeq'");
    return number.executeStep() ? static_cast<std::uint8_t>(number.getColumn(0).getInt64()) : std::uint8_t{0};
  } catch (const SQLite::Exception&) {
    return 0;
  }
}

bool DiskBacklog::keep_bd_seq(std::uint8_t next) {
  try {
    impl_->begin();
    SQLite::Statement number(impl_->db, "INSERT OR REPLACE INTO numbers (name, value) VALUES ('bdSeq', ?)");
    number.bind(1, static_cast<std::int64_t>(next));
    number.exec();
  } catch (const SQLite::Exception& error) {
    impl_->failed(error);
    return false;
  }
  return settle();
}

}  // namespace berth::fleet
