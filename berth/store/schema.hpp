/// The tables of a store, and how older ones become today's. Private to room `store`.
#pragma once

#include <cstdint>
#include <string>

namespace SQLite {
class Database;
}

namespace berth::store {

/// "BRTH": SQLite's application-ID, which marks a file as Berth's.
inline constexpr int application_id = 0x42525448;

/// What a file is, as its header fields say.
enum class FileKind : std::uint8_t { fresh, ours, foreign, newer };
[[nodiscard]] FileKind classify(std::int64_t application, std::int64_t version, bool has_tables) noexcept;

/// Makes the tables of `version` 1..schema_version in an empty database, as the Berth of that version did. One
/// transaction, header fields included. Throws SQLite::Exception.
void create_schema(SQLite::Database& db, int version);

/// Brings the tables from `version` to `schema_version`. One transaction; nothing to do when they are equal.
void migrate(SQLite::Database& db, int version);

/// Empty when tables, indices and triggers are those that Berth makes in `version`, to the letter, and there are no
/// others; else what is strange. To be asked before any statement that could run what a schema from elsewhere says
/// (`damage` runs its CHECKs, a write its triggers). Reads only.
[[nodiscard]] std::string strange(SQLite::Database& db, int version);

/// Empty when the file is whole; else what is wrong. Reads only.
[[nodiscard]] std::string damage(SQLite::Database& db);

}  // namespace berth::store
