#include "berth/sparkplug/value.hpp"

#include <algorithm>
#include <array>
#include <bit>
#include <limits>
#include <optional>

#include "berth/base/bytes.hpp"
#include "berth/sparkplug/payload.hpp"

namespace berth::sparkplug {
namespace {

constexpr std::array type_names{"Unknown",      "Int8",
                                "Int16",        "Int32",
                                "Int64",        "UInt8",
                                "UInt16",       "UInt32",
                                "UInt64",       "Float",
                                "Double",       "Boolean",
                                "String",       "DateTime",
                                "Text",         "UUID",
                                "DataSet",      "Bytes",
                                "File",         "Template",
                                "PropertySet",  "PropertySetList",
                                "Int8Array",    "Int16Array",
                                "Int32Array",   "Int64Array",
                                "UInt8Array",   "UInt16Array",
                                "UInt32Array",  "UInt64Array",
                                "FloatArray",   "DoubleArray",
                                "BooleanArray", "StringArray",
                                "DateTimeArray"};

/// Bits of an integer type; 0 of others.
constexpr int signed_bits(DataType type) noexcept {
  return type >= DataType::int8 && type <= DataType::int64 ? 8 << (static_cast<int>(type) - 1) : 0;
}
constexpr int unsigned_bits(DataType type) noexcept {
  if (type == DataType::date_time) return 64;
  return type >= DataType::uint8 && type <= DataType::uint64 ? 8 << (static_cast<int>(type) - 5) : 0;
}
constexpr bool in_range(std::int64_t value, int bits) noexcept {
  const auto top = std::numeric_limits<std::int64_t>::max() >> (64 - bits);
  return value <= top && value >= -top - 1;
}
constexpr bool in_range(std::uint64_t value, int bits) noexcept { return bits == 64 || value >> bits == 0; }

/// The element type of an array type.
DataType element_of(DataType type) noexcept {
  switch (type) {
    case DataType::float_array: return DataType::float32;
    case DataType::double_array: return DataType::float64;
    case DataType::boolean_array: return DataType::boolean;
    case DataType::string_array: return DataType::string;
    case DataType::date_time_array: return DataType::date_time;
    default: break;
  }
  const auto number = static_cast<std::uint32_t>(type) - static_cast<std::uint32_t>(DataType::int8_array) + 1;
  return is_array(type) && number <= 8 ? data_type(number) : DataType::unknown;
}

template <class Elements>
bool all_in_range(const Elements& elements, int bits) {
  return bits != 0 && std::ranges::all_of(elements, [bits](auto each) { return in_range(each, bits); });
}

/// A string of an array ends with a zero byte, so it cannot hold one.
bool is_array_text(const std::string& text) { return is_utf8(text) && text.find('\0') == std::string::npos; }

bool array_fits(DataType element, const Array& array) {
  if (const auto* numbers = std::get_if<std::vector<std::int64_t>>(&array)) {
    return all_in_range(*numbers, signed_bits(element));
  }
  if (const auto* numbers = std::get_if<std::vector<std::uint64_t>>(&array)) {
    return all_in_range(*numbers, unsigned_bits(element));
  }
  if (const auto* texts = std::get_if<std::vector<std::string>>(&array)) {
    return element == DataType::string && std::ranges::all_of(*texts, is_array_text);
  }
  if (std::holds_alternative<std::vector<float>>(array)) return element == DataType::float32;
  if (std::holds_alternative<std::vector<double>>(array)) return element == DataType::float64;
  return element == DataType::boolean;
}

bool is_text_type(DataType type) noexcept {
  return type == DataType::string || type == DataType::text || type == DataType::uuid;
}

/// A number in any width as a signed one of `bits`: its low bits say it, and those above are zeros or the sign.
std::optional<std::int64_t> as_signed(std::uint64_t raw, int bits) noexcept {
  if (bits == 64) return static_cast<std::int64_t>(raw);
  const auto low = raw & (~std::uint64_t{0} >> (64 - bits));
  const auto value = static_cast<std::int64_t>(low << (64 - bits)) >> (64 - bits);
  const auto extended = static_cast<std::uint64_t>(value);
  const bool same_value = raw == low || raw == (extended & 0xFFFF'FFFFU) || raw == extended;
  return same_value ? std::optional(value) : std::nullopt;
}

Value integer(DataType type, const Value& raw) {
  const int bits = signed_bits(type);
  if (const auto* number = std::get_if<std::uint64_t>(&raw)) {
    if (bits == 0)
      return in_range(*number, unsigned_bits(type)) ? raw : Value(Unsupported{"it is out of its type's range"});
    const auto value = as_signed(*number, bits);
    return value ? Value(*value) : Value(Unsupported{"it is out of its type's range"});
  }
  if (const auto* number = std::get_if<std::int64_t>(&raw)) {
    if (bits != 0 && in_range(*number, bits)) return raw;
    if (bits == 0 && *number >= 0 && in_range(static_cast<std::uint64_t>(*number), unsigned_bits(type))) {
      return static_cast<std::uint64_t>(*number);
    }
    return Unsupported{"it is out of its type's range"};
  }
  return Unsupported{"it is no integer, as its type wants"};
}

template <class Number, class Stored>
void put(Bytes& out, const std::vector<Stored>& elements) {
  out.resize(elements.size() * sizeof(Number));
  for (std::size_t i = 0; i < elements.size(); ++i) {
    Number number{};
    if constexpr (std::is_floating_point_v<Stored>) {
      number = std::bit_cast<Number>(elements[i]);
    } else {
      number = static_cast<Number>(elements[i]);
    }
    store_le(out.data() + i * sizeof(Number), number);
  }
}

template <class Stored>
void put_integers(Bytes& out, int bits, const std::vector<Stored>& elements) {
  switch (bits) {
    case 8: return put<std::uint8_t>(out, elements);
    case 16: return put<std::uint16_t>(out, elements);
    case 32: return put<std::uint32_t>(out, elements);
    default: return put<std::uint64_t>(out, elements);
  }
}

void put_bits(Bytes& out, const std::vector<bool>& elements) {
  out.resize(4 + (elements.size() + 7) / 8);
  store_le(out.data(), static_cast<std::uint32_t>(elements.size()));
  for (std::size_t i = 0; i < elements.size(); ++i) {
    if (elements[i]) out[4 + i / 8] = static_cast<std::uint8_t>(out[4 + i / 8] | (0x80 >> (i % 8)));
  }
}

/// Whole elements of `Number`, or nothing.
template <class Number, class Stored>
std::optional<std::vector<Stored>> take(const Bytes& bytes) {
  if (bytes.size() % sizeof(Number) != 0) return std::nullopt;
  std::vector<Stored> out(bytes.size() / sizeof(Number));
  for (std::size_t i = 0; i < out.size(); ++i) {
    const auto number = load_le<Number>(bytes.data() + i * sizeof(Number));
    if constexpr (std::is_floating_point_v<Stored>) {
      out[i] = std::bit_cast<Stored>(number);
    } else {
      out[i] = static_cast<Stored>(
          static_cast<std::conditional_t<std::is_signed_v<Stored>, std::make_signed_t<Number>, Number>>(number));
    }
  }
  return out;
}

template <class Stored>
std::optional<std::vector<Stored>> take_integers(int bits, const Bytes& bytes) {
  switch (bits) {
    case 8: return take<std::uint8_t, Stored>(bytes);
    case 16: return take<std::uint16_t, Stored>(bytes);
    case 32: return take<std::uint32_t, Stored>(bytes);
    default: return take<std::uint64_t, Stored>(bytes);
  }
}

std::optional<std::vector<bool>> take_bits(const Bytes& bytes) {
  if (bytes.size() < 4) return std::nullopt;
  const std::size_t count = load_le<std::uint32_t>(bytes.data());
  if (bytes.size() != 4 + (count + 7) / 8) return std::nullopt;
  std::vector<bool> out(count);
  for (std::size_t i = 0; i < count; ++i) out[i] = (bytes[4 + i / 8] & (0x80 >> (i % 8))) != 0;
  return out;
}

std::optional<std::vector<std::string>> take_texts(const Bytes& bytes) {
  if (!bytes.empty() && bytes.back() != 0) return std::nullopt;
  std::vector<std::string> out;
  for (auto at = bytes.begin(); at != bytes.end();) {
    const auto end = std::find(at, bytes.end(), std::uint8_t{0});
    out.emplace_back(at, end);
    if (!is_utf8(out.back())) return std::nullopt;
    at = end + 1;
  }
  return out;
}

template <class Elements>
Result<Array> whole(std::optional<Elements> elements) {
  if (!elements) return fail(Errc::invalid, "the bytes of the array are not whole elements");
  return Array(std::move(*elements));
}

bool same_bits(float a, float b) noexcept { return std::bit_cast<std::uint32_t>(a) == std::bit_cast<std::uint32_t>(b); }
bool same_bits(double a, double b) noexcept {
  return std::bit_cast<std::uint64_t>(a) == std::bit_cast<std::uint64_t>(b);
}

}  // namespace

const char* name(DataType type) noexcept {
  const auto number = static_cast<std::size_t>(type);
  return number < type_names.size() ? type_names[number] : type_names[0];
}

DataType data_type(std::uint32_t number) noexcept {
  return number < type_names.size() ? static_cast<DataType>(number) : DataType::unknown;
}

bool is_metric_type(DataType type) noexcept {
  return type != DataType::unknown && type != DataType::property_set && type != DataType::property_set_list &&
         static_cast<std::size_t>(type) < type_names.size();
}

bool same(const Value& a, const Value& b) {
  if (a.index() != b.index()) return false;
  if (const auto* number = std::get_if<float>(&a)) return same_bits(*number, *std::get_if<float>(&b));
  if (const auto* number = std::get_if<double>(&a)) return same_bits(*number, *std::get_if<double>(&b));
  if (const auto* array = std::get_if<Boxed<Array>>(&a)) {
    const auto& x = **array;
    const auto& y = **std::get_if<Boxed<Array>>(&b);
    if (x.index() != y.index()) return false;
    const auto bits = [](auto p, auto q) { return same_bits(p, q); };
    if (const auto* floats = std::get_if<std::vector<float>>(&x)) {
      return std::ranges::equal(*floats, std::get<std::vector<float>>(y), bits);
    }
    if (const auto* doubles = std::get_if<std::vector<double>>(&x)) {
      return std::ranges::equal(*doubles, std::get<std::vector<double>>(y), bits);
    }
  }
  return a == b;
}

bool fits(DataType type, const Value& value) {
  if (std::holds_alternative<Null>(value)) return type != DataType::unknown;
  if (const auto* number = std::get_if<std::int64_t>(&value)) {
    return signed_bits(type) != 0 && in_range(*number, signed_bits(type));
  }
  if (const auto* number = std::get_if<std::uint64_t>(&value)) {
    return unsigned_bits(type) != 0 && in_range(*number, unsigned_bits(type));
  }
  if (const auto* text = std::get_if<std::string>(&value)) return is_text_type(type) && is_utf8(*text);
  if (const auto* array = std::get_if<Boxed<Array>>(&value)) return array_fits(element_of(type), **array);
  if (std::holds_alternative<float>(value)) return type == DataType::float32;
  if (std::holds_alternative<double>(value)) return type == DataType::float64;
  if (std::holds_alternative<bool>(value)) return type == DataType::boolean;
  if (std::holds_alternative<Bytes>(value)) return type == DataType::bytes || type == DataType::file;
  if (std::holds_alternative<Boxed<DataSet>>(value)) return type == DataType::data_set;
  if (std::holds_alternative<Boxed<Template>>(value)) return type == DataType::template_type;
  if (std::holds_alternative<Boxed<PropertySet>>(value)) return type == DataType::property_set;
  if (std::holds_alternative<Boxed<PropertySets>>(value)) return type == DataType::property_set_list;
  return false;
}

Value interpret(DataType type, Value raw) {
  if (std::holds_alternative<Null>(raw) || std::holds_alternative<Unsupported>(raw)) return raw;
  if (type == DataType::unknown) return Unsupported{"its type is not one that Sparkplug 3.0 defines"};
  if (signed_bits(type) != 0 || unsigned_bits(type) != 0) return integer(type, raw);
  if (const auto* bytes = std::get_if<Bytes>(&raw); bytes != nullptr && is_array(type)) {
    auto array = unpack(type, *bytes);
    return array ? Value(Boxed<Array>(std::move(*array))) : Value(Unsupported{array.error().text});
  }
  if (const auto* text = std::get_if<std::string>(&raw); text != nullptr && !is_utf8(*text)) {
    return Unsupported{"it is no UTF-8"};
  }
  return fits(type, raw) ? std::move(raw) : Value(Unsupported{"it is in another form than its type has"});
}

Bytes pack(DataType type, const Array& array) {
  Bytes out;
  const auto element = element_of(type);
  if (const auto* signeds = std::get_if<std::vector<std::int64_t>>(&array)) {
    put_integers(out, signed_bits(element), *signeds);
  } else if (const auto* unsigneds = std::get_if<std::vector<std::uint64_t>>(&array)) {
    put_integers(out, unsigned_bits(element), *unsigneds);
  } else if (const auto* floats = std::get_if<std::vector<float>>(&array)) {
    put<std::uint32_t>(out, *floats);
  } else if (const auto* doubles = std::get_if<std::vector<double>>(&array)) {
    put<std::uint64_t>(out, *doubles);
  } else if (const auto* bits = std::get_if<std::vector<bool>>(&array)) {
    put_bits(out, *bits);
  } else {
    for (const auto& text : std::get<std::vector<std::string>>(array)) {
      out.insert(out.end(), text.begin(), text.end());
      out.push_back(0);
    }
  }
  return out;
}

Result<Array> unpack(DataType type, const Bytes& bytes) {
  const auto element = element_of(type);
  if (const int bits = signed_bits(element); bits != 0) return whole(take_integers<std::int64_t>(bits, bytes));
  if (const int bits = unsigned_bits(element); bits != 0) return whole(take_integers<std::uint64_t>(bits, bytes));
  switch (element) {
    case DataType::float32: return whole(take<std::uint32_t, float>(bytes));
    case DataType::float64: return whole(take<std::uint64_t, double>(bytes));
    case DataType::boolean: return whole(take_bits(bytes));
    case DataType::string: return whole(take_texts(bytes));
    default: return fail(Errc::invalid, "the type is no array");
  }
}

std::size_t heap_of(const Value& value) noexcept {
  if (const auto* text = std::get_if<std::string>(&value)) return text->capacity() > 15 ? text->capacity() + 17 : 0;
  if (const auto* bytes = std::get_if<Bytes>(&value)) return bytes->capacity() == 0 ? 0 : bytes->capacity() + 16;
  if (const auto* array = std::get_if<Boxed<Array>>(&value)) {
    const auto size = [](const auto& elements) { return elements.size() * sizeof(elements[0]); };
    auto sum = std::visit(size, **array) + 64;
    if (const auto* texts = std::get_if<std::vector<std::string>>(&**array)) {
      for (const auto& text : *texts) sum += text.capacity();
    }
    return sum;
  }
  if (const auto* set = std::get_if<Boxed<DataSet>>(&value)) {
    std::size_t sum = 64;
    for (const auto& column : (*set)->columns) sum += sizeof column + column.name.capacity();
    for (const auto& row : (*set)->rows) {
      sum += sizeof row + row.size() * sizeof(Value);
      for (const auto& cell : row) sum += heap_of(cell);
    }
    return sum;
  }
  if (const auto* structure = std::get_if<Boxed<Template>>(&value)) {
    std::size_t sum = sizeof(Template);
    for (const auto& member : (*structure)->members) sum += sizeof member + 64 + heap_of(member.value);
    return sum + (*structure)->parameters.size() * 128;
  }
  return 0;
}

bool is_utf8(std::string_view text) noexcept {
  const auto byte = [text](std::size_t i) { return static_cast<std::uint8_t>(text[i]); };
  for (std::size_t i = 0; i < text.size();) {
    const auto lead = byte(i);
    if (lead < 0x80) {
      ++i;
      continue;
    }
    const std::size_t length = lead < 0xC2 ? 0 : lead < 0xE0 ? 2 : lead < 0xF0 ? 3 : lead < 0xF5 ? 4 : 0;
    if (length == 0 || text.size() - i < length) return false;
    for (std::size_t k = 1; k < length; ++k) {
      if ((byte(i + k) & 0xC0) != 0x80) return false;
    }
    const auto second = byte(i + 1);
    const bool overlong = (lead == 0xE0 && second < 0xA0) || (lead == 0xF0 && second < 0x90);
    const bool outside = (lead == 0xED && second >= 0xA0) || (lead == 0xF4 && second >= 0x90);
    if (overlong || outside) return false;
    i += length;
  }
  return true;
}

const Property* PropertySet::find(std::string_view key) const noexcept {
  const auto found = std::ranges::find(properties, key, &Property::key);
  return found == properties.end() ? nullptr : &*found;
}

std::optional<Quality> quality(const Metric& metric) noexcept {
  const auto* property = metric.properties ? metric.properties->find(quality_key) : nullptr;
  if (property == nullptr) return Quality::good;
  const auto* number = std::get_if<std::int64_t>(&property->value);
  if (number == nullptr || property->type != DataType::int32) return std::nullopt;
  for (const auto code : {Quality::bad, Quality::good, Quality::stale}) {
    if (*number == static_cast<std::int64_t>(code)) return code;
  }
  return std::nullopt;
}

void set_quality(Metric& metric, Quality quality) {
  if (!metric.properties) metric.properties.emplace();
  auto& all = metric.properties->properties;
  std::erase_if(all, [](const Property& each) { return each.key == quality_key; });
  all.push_back({quality_key, DataType::int32, static_cast<std::int64_t>(quality)});
}

}  // namespace berth::sparkplug
