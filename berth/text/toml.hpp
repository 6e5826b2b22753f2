/// Reads files written by users, so that every remark can name line and column.
///
/// A TOML text becomes a tree of `Value`s in the order of the file, each with its place. `Table` reads one table of it:
/// it checks type and range, and at the end knows which keys were not requested. Nothing here knows machines or plants.
/// The parser is toml++ (TOML 1.0), used only by `toml.cpp`.
#pragma once

#include <cstdint>
#include <limits>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "berth/base/finding.hpp"
#include "berth/text/quantity.hpp"

namespace berth::text {

/// Line and column from 1, columns in Unicode code points; 0 = the file as a whole.
struct Place {
  int line = 0;
  int column = 0;
  friend constexpr auto operator<=>(Place, Place) noexcept = default;
};

struct Member;

/// One value. Only the field of its `kind` is valid.
struct Value {
  enum class Kind : std::uint8_t { string, integer, real, boolean, date, array, table };
  Kind kind = Kind::table;
  bool in_line = false;  ///< a table or array written as `{ … }` or `[ … ]`, not with headers
  Place begin;           ///< first character; of a table with a header, the header's
  Place end;             ///< after the last character; a table's ends with its last value
  std::string string;
  std::int64_t integer = 0;
  double real = 0;
  bool boolean = false;
  std::vector<Value> items;     ///< of an array
  std::vector<Member> members;  ///< of a table, in the order of the file

  /// The member of this name, or null; null if it is not a table.
  [[nodiscard]] const Value* find(std::string_view key) const noexcept;
};

struct Member {
  std::string key;
  Place place;  ///< of the key
  Value value;
};

/// True for the same content; ignores places, the order of members and the way of writing.
[[nodiscard]] bool same(const Value& a, const Value& b) noexcept;

/// "a string", "an integer", "a table", …
[[nodiscard]] const char* name(Value::Kind kind) noexcept;

/// Reads a whole file's text. A syntax error is one finding with its place, and the result is empty.
[[nodiscard]] std::optional<Value> parse_toml(std::string_view text, const std::string& file, Findings& findings);

/// The byte offset of a place in `text`; `text.size()` for places after its end. A byte order mark at the beginning
/// counts as no column.
[[nodiscard]] std::size_t offset_of(std::string_view text, Place place) noexcept;

/// Whole numbers allowed, both ends included.
struct Limits {
  std::int64_t low = std::numeric_limits<std::int64_t>::min();
  std::int64_t high = std::numeric_limits<std::int64_t>::max();
};
inline constexpr Limits any_u32{0, 0xFFFF'FFFF};

/// Reads one table. Every reading call marks its key as known, and returns empty when the key is absent or wrong;
/// errors become findings. Must not outlive the `Value` it reads.
class Table {
 public:
  /// `path` names the table for the user: "bus.backbone", "slot[2]"; empty for the file's root.
  Table(const Value& table, std::string path, const std::string& file, Findings& findings)
      : table_(table), path_(std::move(path)), file_(file), findings_(findings) {}

  /// The raw value, null when absent.
  const Value* get(std::string_view key);
  /// True when the key exists, whatever its value.
  [[nodiscard]] bool has(std::string_view key);

  std::optional<std::string> string(std::string_view key);
  std::optional<std::int64_t> integer(std::string_view key, Limits limits);
  std::optional<std::uint32_t> u32(std::string_view key, Limits limits = any_u32);
  std::optional<bool> boolean(std::string_view key);
  /// A string with a unit ("4 ms"), from `low` to `high`, both included.
  std::optional<Duration> duration(std::string_view key, Duration low, Duration high);
  /// One of `words`; returns its index.
  std::optional<std::size_t> word(std::string_view key, std::span<const std::string_view> words);
  /// An array of strings.
  std::optional<std::vector<std::string>> strings(std::string_view key);
  /// An array of whole numbers, each within the limits.
  std::optional<std::vector<std::int64_t>> integers(std::string_view key, Limits limits);
  /// A table beneath this one.
  std::optional<Table> table(std::string_view key);
  /// The tables of `[[key]]`, in order; none when absent.
  std::vector<Table> tables(std::string_view key);
  /// The items of an array of strings and tables, in order; none when absent. The path of each table has its number.
  struct Item;
  std::vector<Item> strings_or_tables(std::string_view key);
  /// The members of a table of tables (`[key.NAME]`), in order: name and table.
  std::vector<std::pair<std::string, Table>> named_tables(std::string_view key);

  /// Reports a missing mandatory key; false then.
  bool require(std::string_view key, std::string_view fix);
  /// Reports every key that was not requested, with the nearest known one. Call it last.
  void finish();

  /// A finding about the value of `key`, or about the table itself when `key` is empty or absent.
  void error(std::string_view key, std::string message, std::string fix);
  void warning(std::string_view key, std::string message, std::string fix);

  [[nodiscard]] Place place_of(std::string_view key) const noexcept;  ///< of its value, or of the table
  [[nodiscard]] Place begin() const noexcept { return table_.begin; }
  [[nodiscard]] const std::string& path() const noexcept { return path_; }

 private:
  const Value* typed(std::string_view key, Value::Kind kind);
  void add(Finding::Severity severity, Place place, std::string_view key, std::string message, std::string fix);
  void wrong_type(std::string_view key, const Value& value, std::string_view wanted);
  [[nodiscard]] std::string full(std::string_view key) const;

  const Value& table_;
  std::string path_;
  const std::string& file_;
  Findings& findings_;
  std::vector<std::string> known_;
};

struct Table::Item {
  Place place;
  std::string string;  ///< if there is no table
  std::optional<Table> table;
};

}  // namespace berth::text
