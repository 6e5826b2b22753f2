// Opens a store. It gets one owner, and nothing is written before the file is known to be Berth's, undamaged and not
// newer.
#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <functional>
#include <optional>

#include "berth/base/bytes.hpp"
#include "berth/base/private_file.hpp"
#include "berth/store/database_impl.hpp"

namespace berth::store {
namespace {

namespace fs = std::filesystem;

tl::unexpected<OpenError> refuse(Errc code, const char* text, std::string message, std::uint32_t detail = 0) {
  return tl::unexpected<OpenError>(OpenError{Error{.code = code, .detail = detail, .text = text}, std::move(message)});
}

std::optional<OpenError> verdict(const std::string& path, FileKind kind, std::int64_t version) {
  if (kind == FileKind::foreign) {
    return refuse(Errc::invalid, "the file is not Berth's",
                  fmt::format("{}: this file is not a Berth store; it was left as it is. Name another file.", path))
        .value();
  }
  if (kind == FileKind::newer) {
    return refuse(Errc::invalid, "the store is of a newer Berth",
                  fmt::format("{}: this store has schema version {}, and this Berth knows up to {}; it was left as it "
                              "is. Use a newer Berth.",
                              path, version, schema_version))
        .value();
  }
  return std::nullopt;
}

bool has_content(const fs::path& path) {
  std::error_code code;
  const auto size = fs::file_size(path, code);
  return !code && size > 0;
}

using Header = std::array<std::uint8_t, 100>;

std::optional<OpenError> look_at(const std::string& path, const Header& header) {
  if (std::memcmp(header.data(), "SQLite format 3", 16) != 0) return verdict(path, FileKind::foreign, 0);
  const auto big_endian = [&](std::size_t at) {
    return static_cast<std::int64_t>(header[at]) << 24 | header[at + 1] << 16 | header[at + 2] << 8 | header[at + 3];
  };
  const auto version = big_endian(60);
  return verdict(path, classify(big_endian(68), version, true), version);
}

/// Checks the header of a file without using SQLite, which could change a foreign file. Skips a file with a write-ahead
/// log or journal, which SQLite must read first.
std::optional<OpenError> look_at_header(const std::string& path) {
  if (!has_content(path) || has_content(path + "-wal") || has_content(path + "-journal")) return std::nullopt;
  Header header{};
  std::ifstream in(path, std::ios::binary);
  in.read(reinterpret_cast<char*>(header.data()), header.size());
  if (!in) return verdict(path, FileKind::foreign, 0);
  return look_at(path, header);
}

/// Advice for the user about a system error.
const char* remedy_of(int code) noexcept {
  switch (code) {
    case ENOSPC:
    case EDQUOT: return "make room on that disk, or name another file with --store";
    case EROFS:
    case EACCES:
    case EPERM: return "make its folder writable, or name another file with --store";
    case ENOENT:
    case ENOTDIR: return "make its folder, or name another file with --store";
    default: return "name another file with --store";
  }
}

std::optional<OpenError> take_lock(FileLock& lock, const std::string& path) {
  switch (lock.take(path)) {
    case FileLock::Outcome::taken: return std::nullopt;
    case FileLock::Outcome::held_by_other: {
      const auto who = lock.holder().empty() ? "another process" : "process " + lock.holder();
      return refuse(Errc::exhausted, "the store is owned by another process",
                    fmt::format("{}: {} uses this store now; stop it, or give your command to it.", path, who))
          .value();
    }
    case FileLock::Outcome::failed: break;
  }
  const int code = errno;
  return refuse(Errc::io, "the store cannot be locked",
                fmt::format("{}.lock: the store's lock file cannot be written: {}; {}", path, std::strerror(code),
                            remedy_of(code)),
                static_cast<std::uint32_t>(code))
      .value();
}

std::int64_t pragma(SQLite::Database& db, const char* name) {
  return db.execAndGet(fmt::format("PRAGMA {}", name)).getInt64();
}

/// Checks a file whose header says that it is Berth's.
std::optional<OpenError> look_inside(SQLite::Database& db, const std::string& path, int version) {
  auto said = strange(db, version);
  if (said.empty()) said = damage(db);
  if (said.empty()) return std::nullopt;
  return refuse(Errc::invalid, "the store is damaged",
                fmt::format("{}: this store is damaged ({}); it was left as it is. Restore a copy, or move it away and "
                            "bind the machine again.",
                            path, said))
      .value();
}

/// Checks the schema, and converts it to the present one.
std::optional<OpenError> prepare(SQLite::Database& db, const std::string& path, bool has_log, bool sync) {
  // Until the file is accepted, closing it must not write a crash's write-ahead log back into it.
  sqlite3_db_config(db.getHandle(), SQLITE_DBCONFIG_NO_CKPT_ON_CLOSE, has_log ? 1 : 0, nullptr);
  db.exec("PRAGMA locking_mode = EXCLUSIVE");
  // EXTRA also syncs the folder when a rollback journal is removed. SQLite uses that journal until the write-ahead log
  // is switched on below.
  db.exec(sync ? "PRAGMA synchronous = EXTRA" : "PRAGMA synchronous = OFF");
  const auto application = pragma(db, "application_id");
  const auto version = pragma(db, "user_version");
  const bool has_tables = db.execAndGet("SELECT count(*) FROM sqlite_master").getInt64() > 0;
  const auto kind = classify(application, version, has_tables);
  if (auto refused = verdict(path, kind, version)) return refused;
  if (kind == FileKind::ours) {
    if (auto refused = look_inside(db, path, static_cast<int>(version))) return refused;
  }
  if (kind == FileKind::fresh) {
    create_schema(db, schema_version);
  } else {
    migrate(db, static_cast<int>(version));
  }
  sqlite3_db_config(db.getHandle(), SQLITE_DBCONFIG_NO_CKPT_ON_CLOSE, 0, nullptr);
  db.exec("PRAGMA journal_mode = WAL");
  db.exec(sync ? "PRAGMA synchronous = FULL" : "PRAGMA synchronous = OFF");
  db.exec("PRAGMA foreign_keys = ON");
  return std::nullopt;
}

/// Limits for a foreign file: no functions from its schema, no schema changes by writes, no value longer than any of
/// Berth's. `ended` can end a statement that takes too long.
void confine(SQLite::Database& db, std::function<bool()>& ended) {
  constexpr int longest_value = 1 << 20;
  constexpr int steps_between_questions = 100'000;  // some milliseconds
  sqlite3* const handle = db.getHandle();
  sqlite3_db_config(handle, SQLITE_DBCONFIG_DEFENSIVE, 1, nullptr);
  sqlite3_db_config(handle, SQLITE_DBCONFIG_TRUSTED_SCHEMA, 0, nullptr);
  sqlite3_db_config(handle, SQLITE_DBCONFIG_ENABLE_VIEW, 0, nullptr);
  sqlite3_limit(handle, SQLITE_LIMIT_LENGTH, longest_value);
  db.exec("PRAGMA cell_size_check = ON");
  if (!ended) return;
  const auto ask = [](void* of) { return (*static_cast<std::function<bool()>*>(of))() ? 1 : 0; };
  sqlite3_progress_handler(handle, steps_between_questions, ask, &ended);
}

std::string real_path(const std::string& path) {
  std::error_code code;
  const auto real = fs::weakly_canonical(path, code);
  return code ? path : real.string();
}

OpenError sqlite_error(const std::string& path, int code, const char* what) {
  const auto kind = code & 0xFF;
  if (kind == SQLITE_INTERRUPT) {
    return refuse(Errc::io, "ended before the store was read",
                  fmt::format("{}: ended before the store was read; it was left as it is.", path),
                  static_cast<std::uint32_t>(code))
        .value();
  }
  const bool damaged = kind == SQLITE_CORRUPT || kind == SQLITE_NOTADB || kind == SQLITE_TOOBIG;
  const auto text = damaged ? "the store is damaged" : "the store cannot be opened";
  const auto words = damaged ? fmt::format(
                                   "{}: this store is damaged ({}); it was left as it is. Restore a copy, or move "
                                   "it away and bind the machine again.",
                                   path, what)
                             : fmt::format("{}: the store cannot be opened: {}", path, cause_of(code, what));
  return refuse(damaged ? Errc::invalid : Errc::io, text, words, static_cast<std::uint32_t>(code)).value();
}

}  // namespace

Database::Opened Database::open(const std::string& given, const OpenOptions& options) {
  auto impl = std::make_unique<Impl>();
  const auto path = options.vfs.empty() ? real_path(given) : given;
  std::error_code code;
  if (options.vfs.empty() && fs::is_directory(path, code)) {
    return refuse(Errc::io, "the store is a folder", fmt::format("{}: this is a folder, not a store.", path));
  }
  if (options.lock) {
    if (auto refused = take_lock(impl->lock, path)) return tl::unexpected<OpenError>(std::move(*refused));
  }
  if (options.vfs.empty()) {
    if (auto refused = look_at_header(path)) return tl::unexpected<OpenError>(std::move(*refused));
  }
  const bool has_log = !options.vfs.empty() || has_content(path + "-wal");
  try {
    // The files that SQLite makes beside it get the same mode. If the file cannot be made, SQLite reports that.
    if (options.vfs.empty()) static_cast<void>(make_private(path));
    const int flags = SQLite::OPEN_READWRITE | SQLite::OPEN_CREATE | SQLITE_OPEN_EXRESCODE;
    impl->db.emplace(path, flags, 0, options.vfs);
    impl->ended = options.ended;
    confine(*impl->db, impl->ended);
    if (auto refused = prepare(*impl->db, path, has_log, options.sync))
      return tl::unexpected<OpenError>(std::move(*refused));
  } catch (const SQLite::Exception& error) {
    // A requested end is reported as such, whatever else went wrong meanwhile.
    const bool ended = options.ended && options.ended();
    const int what = ended ? SQLITE_INTERRUPT : error.getExtendedErrorCode();
    return tl::unexpected<OpenError>(sqlite_error(path, what, error.what()));
  }
  return std::unique_ptr<Database>(new Database(std::move(impl)));
}

tl::expected<void, OpenError> look(std::string bytes, const std::string& name, const OpenOptions& options) {
  if (bytes.empty()) return {};
  Header header{};
  std::memcpy(header.data(), bytes.data(), std::min(bytes.size(), header.size()));
  if (auto refused = look_at(name, header)) return tl::unexpected<OpenError>(std::move(*refused));
  // These two bytes of the header say that the file has a write-ahead log; a database in memory has none.
  constexpr std::size_t write_version = 18;
  constexpr std::size_t read_version = 19;
  if (bytes.size() >= header.size()) bytes[write_version] = bytes[read_version] = 1;
  std::function<bool()> ended = options.ended;
  try {
    SQLite::Database db(":memory:", SQLite::OPEN_READWRITE | SQLite::OPEN_CREATE);
    confine(db, ended);
    const auto size = static_cast<sqlite3_int64>(bytes.size());
    void* const plain = bytes.data();
    sqlite3_deserialize(db.getHandle(), "main", static_cast<unsigned char*>(plain), size, size,
                        SQLITE_DESERIALIZE_READONLY);
    if (auto refused = look_inside(db, name, static_cast<int>(pragma(db, "user_version"))))
      return tl::unexpected<OpenError>(std::move(*refused));
  } catch (const SQLite::Exception& error) {
    return tl::unexpected<OpenError>(sqlite_error(name, error.getExtendedErrorCode(), error.what()));
  }
  return {};
}

}  // namespace berth::store
