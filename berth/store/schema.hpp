/// The tables of a store, and the conversion of older ones. Private to room `store`.
#pragma once

#include <cstdint>
#include <string>

namespace SQLite {
class Database;
}

namespace berth::store {

/// "BRTH": SQLite's application-ID, which marks a file as Berth's.
inline constexpr int application_id = 0x42525448;

/// The kind of a file, from its header fields.
enum class FileKind : std::uint8_t { fresh, ours, foreign, newer };
[[nodiscard]] FileKind classify(std::int64_t application, std::int64_t version, bool has_tables) noexcept;

/// Makes the tables of `version` 1..schema_version in an empty database, as the Berth of that version did. One
/// transaction, including header fields. Throws SQLite::Exception.
void create_schema(SQLite::Database& db, int version);

/// Converts the tables from `version` to `schema_version`. One transaction; does nothing if they are equal.
void migrate(SQLite::Database& db, int version);

/// Empty if tables, indices and triggers are exactly those that Berth makes in `version`, and there are no others; else
/// the difference. Call it before any statement that could run parts of a foreign schema (`damage` runs its CHECKs, a
/// write its triggers). Reads only.
[[nodiscard]] std::string strange(SQLite::Database& db, int version);

/// Empty if the file is whole; else what is wrong. Reads only.
[[nodiscard]] std::string damage(SQLite::Database& db);

}  // namespace berth::store
