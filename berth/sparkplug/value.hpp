/// Values of Sparkplug metrics and their data types (Sparkplug 3.0 §6.4.16).
///
/// A `Value` has one form for each family of types: all signed integers are `std::int64_t`, all unsigned ones and
/// DateTime (UTC milliseconds since 1970) are `std::uint64_t`. The `DataType` beside it says how wide it is on the
/// wire. Messages after a birth carry no data type: what `decode` then gives is raw (integers as `std::uint64_t`, bytes
/// as `Bytes`) until `interpret` turns it into the type that the birth named.
#pragma once

#include <cstdint>
#include <memory>
#include <string>
#include <string_view>
#include <utility>
#include <variant>
#include <vector>

#include "berth/base/result.hpp"

namespace berth::sparkplug {

/// Numbers of the wire.
enum class DataType : std::uint8_t {
  unknown = 0,
  int8 = 1,
  int16 = 2,
  int32 = 3,
  int64 = 4,
  uint8 = 5,
  uint16 = 6,
  uint32 = 7,
  uint64 = 8,
  float32 = 9,
  float64 = 10,
  boolean = 11,
  string = 12,
  date_time = 13,
  text = 14,
  uuid = 15,
  data_set = 16,
  bytes = 17,
  file = 18,
  template_type = 19,
  property_set = 20,
  property_set_list = 21,
  int8_array = 22,
  int16_array = 23,
  int32_array = 24,
  int64_array = 25,
  uint8_array = 26,
  uint16_array = 27,
  uint32_array = 28,
  uint64_array = 29,
  float_array = 30,
  double_array = 31,
  boolean_array = 32,
  string_array = 33,
  date_time_array = 34,
};
/// The standard's name: "Int8", "DataSet", "Int8Array"; "Unknown" for numbers that it does not define.
[[nodiscard]] const char* name(DataType type) noexcept;
/// The type with this number of the wire; `unknown` for 0 and for numbers that the standard does not define.
[[nodiscard]] DataType data_type(std::uint32_t number) noexcept;
/// Types 1 to 14, which columns of a data set and parameters of a template may have.
[[nodiscard]] constexpr bool is_basic(DataType type) noexcept {
  return type >= DataType::int8 && type <= DataType::text;
}
/// Types that a metric may have: all but unknown and the two of properties.
[[nodiscard]] bool is_metric_type(DataType type) noexcept;
[[nodiscard]] constexpr bool is_array(DataType type) noexcept { return type >= DataType::int8_array; }

/// The metric has no value now (`is_null`).
struct Null {
  friend bool operator==(Null, Null) noexcept { return true; }
};
/// A value came that Berth cannot use: a vendor's extension, an unknown type, parts that contradict each other. It is
/// kept in its place, so that the rest of the payload counts.
struct Unsupported {
  const char* why = "";  ///< static text: "its rows are not as long as its columns"
  friend bool operator==(Unsupported, Unsupported) noexcept { return true; }
};
using Bytes = std::vector<std::uint8_t>;

/// An immutable value on the heap that is copied by reference and compared by content. It keeps `Value` small: a host
/// holds hundreds of thousands.
template <class T>
class Boxed {
 public:
  Boxed(T content) : content_(std::make_shared<const T>(std::move(content))) {}  // NOLINT(google-explicit-constructor)
  [[nodiscard]] const T& operator*() const noexcept { return *content_; }
  [[nodiscard]] const T* operator->() const noexcept { return content_.get(); }
  friend bool operator==(const Boxed& a, const Boxed& b) { return a.content_ == b.content_ || *a == *b; }

 private:
  std::shared_ptr<const T> content_;
};

/// Elements of an array type, in the family of its element type.
using Array = std::variant<std::vector<std::int64_t>, std::vector<std::uint64_t>, std::vector<float>,
                           std::vector<double>, std::vector<bool>, std::vector<std::string>>;
struct DataSet;
struct Template;
struct PropertySet;
using PropertySets = std::vector<PropertySet>;

using Value = std::variant<Null, std::int64_t, std::uint64_t, float, double, bool, std::string, Bytes, Boxed<Array>,
                           Boxed<DataSet>, Boxed<Template>, Boxed<PropertySet>, Boxed<PropertySets>, Unsupported>;

/// Equal in form and bits: NaN equals itself, 0.0 and -0.0 differ. Report by exception asks this.
[[nodiscard]] bool same(const Value& a, const Value& b);

/// True if `value` may stand for a metric, property or cell of this type: its family, its range (an Int8 holds -128 to
/// 127), UTF-8. `Null` fits every type, `Unsupported` none.
[[nodiscard]] bool fits(DataType type, const Value& value);

/// A raw value, or one of another integer type, as one of `type`. Accepts an integer in any width in which senders put
/// it (an Int8 -1 as FFh, FFFFFFFFh or 64 bits), so that the result is in range. `Unsupported` with the reason else.
[[nodiscard]] Value interpret(DataType type, Value raw);

/// The bytes of an array as the wire has them (§6.4.16: little-endian, packed; the standard's examples of FloatArray
/// and DoubleArray are big-endian and contradict its own rule, which Berth follows), and back. `array` must fit the
/// type.
[[nodiscard]] Bytes pack(DataType type, const Array& array);
/// `invalid`: the length is no multiple of the element's, or the bits or the last string are not whole.
[[nodiscard]] Result<Array> unpack(DataType type, const Bytes& bytes);

/// Bytes on the heap behind a value, about.
[[nodiscard]] std::size_t heap_of(const Value& value) noexcept;

/// True if `text` is well-formed UTF-8.
[[nodiscard]] bool is_utf8(std::string_view text) noexcept;

}  // namespace berth::sparkplug
