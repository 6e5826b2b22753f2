/// A Sparkplug B payload in Berth's own types (Sparkplug 3.0 §6.4). `encode` and `decode` (codec.hpp) are its wire
/// form.
#pragma once

#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "berth/sparkplug/value.hpp"

namespace berth::sparkplug {

/// A point in time as the wire has it: milliseconds since 1970-01-01 in UTC, never local time.
struct Utc {
  std::uint64_t ms = 0;
  friend auto operator<=>(const Utc&, const Utc&) = default;
};

/// The property "Quality" (§6.4.8.1). A metric without it is good.
enum class Quality : std::uint16_t { bad = 0, good = 192, stale = 500 };
constexpr const char* quality_key = "Quality";

/// A property of a metric.
struct Property {
  std::string key;
  DataType type = DataType::unknown;
  Value value;
  friend bool operator==(const Property&, const Property&) = default;
};
/// Keys and values side by side: the wire's two arrays cannot differ in length here.
struct PropertySet {
  std::vector<Property> properties;
  friend bool operator==(const PropertySet&, const PropertySet&) = default;
  [[nodiscard]] const Property* find(std::string_view key) const noexcept;
};

/// A table of values. Each row has one value for each column.
struct DataSet {
  struct Column {
    std::string name;
    DataType type = DataType::unknown;
    friend bool operator==(const Column&, const Column&) = default;
  };
  std::vector<Column> columns;
  std::vector<std::vector<Value>> rows;
  friend bool operator==(const DataSet&, const DataSet&) = default;
};

/// What is said of bytes and files.
struct MetaData {
  std::optional<bool> multi_part{};
  std::optional<std::string> content_type{};
  std::optional<std::uint64_t> size{};
  std::optional<std::uint64_t> seq{};
  std::optional<std::string> file_name{};
  std::optional<std::string> file_type{};
  std::optional<std::string> md5{};
  std::optional<std::string> description{};
  friend bool operator==(const MetaData&, const MetaData&) = default;
};

/// One metric of a payload. Which of its fields are there depends on the message: a birth has name, alias and type,
/// data and commands have the alias alone.
struct Metric {
  std::optional<std::string> name;
  std::optional<std::uint64_t> alias;
  std::optional<Utc> at;         ///< when the value was acquired
  std::optional<DataType> type;  ///< empty: `value` is raw (value.hpp). A number that the standard lacks: `unknown`
  Value value;
  bool historical = false;  ///< not the current value
  bool transient = false;   ///< hosts should not store it
  std::optional<PropertySet> properties;
  std::optional<MetaData> metadata;
  friend bool operator==(const Metric&, const Metric&) = default;
};
/// The quality that the metric's properties say; good without one. Empty: the property is there and is none of the
/// three codes as an Int32.
[[nodiscard]] std::optional<Quality> quality(const Metric& metric) noexcept;
/// Says the quality by the property, in place of one that is there.
void set_quality(Metric& metric, Quality quality);

/// A structured value (§6.4.11). A definition is a metric of NBIRTH; an instance refers to it by its name.
struct Template {
  struct Parameter {
    std::string name;
    DataType type = DataType::unknown;
    Value value;
    friend bool operator==(const Parameter&, const Parameter&) = default;
  };
  std::optional<std::string> version;
  std::vector<Metric> members;
  std::vector<Parameter> parameters;
  std::optional<std::string> reference;  ///< the definition's name; never in a definition
  bool definition = false;
  friend bool operator==(const Template&, const Template&) = default;
};

struct Payload {
  std::optional<Utc> at{};  ///< when the message was sent
  std::vector<Metric> metrics{};
  std::optional<std::uint64_t> seq{};
  std::optional<std::string> uuid{};
  std::optional<Bytes> body{};
  friend bool operator==(const Payload&, const Payload&) = default;
};

}  // namespace berth::sparkplug
