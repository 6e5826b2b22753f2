/// Converts values of C++ to values of CiA 301's data types, and back. Types to use:
///
/// - BOOLEAN: bool, or an unsigned integer 0 or 1
/// - INTEGERn, UNSIGNEDn (8 to 64 bits, also 24, 40, 48, 56): reading: any integer that holds every value of the type;
///   writing: any integer whose value fits
/// - REAL32, REAL64: reading: float (REAL32), double (both); writing: float, double; REAL32 rounds
/// - VISIBLE_STRING, UNICODE_STRING: std::string; a UNICODE_STRING is converted from and to UTF-8
/// - OCTET_STRING, DOMAIN, types unknown here: Bytes; also for any other type, as on the wire
/// - TIME_OF_DAY, TIME_DIFFERENCE: co::TimeOfDay
/// - any: Value, which knows its type and can be printed
#pragma once

#include <span>
#include <string>
#include <string_view>
#include <type_traits>
#include <vector>

#include "berth/co/time_stamp.hpp"
#include "berth/od/abort_code.hpp"
#include "berth/od/data_type.hpp"

namespace berth::client {

using Bytes = std::vector<std::uint8_t>;

/// A value with its type.
struct Value {
  od::DataType type = od::DataType::none;
  Bytes bytes;  ///< as on the wire
  /// As in a description file: "500", "0.5", text; values without a text form as hexadecimal bytes.
  [[nodiscard]] std::string text() const { return od::print(type, bytes); }
  friend bool operator==(const Value&, const Value&) = default;
};

enum class Kind : std::uint8_t { boolean, unsigned_integer, signed_integer, real, text, bytes, time, any };

/// Properties of a C++ type.
struct CppType {
  Kind kind = Kind::any;
  unsigned bits = 0;
  const char* name = "";
};

template <class T>
[[nodiscard]] constexpr CppType cpp_type() noexcept {
  constexpr unsigned bits = sizeof(T) * 8;
  if constexpr (std::is_same_v<T, bool>) {
    return {Kind::boolean, 1, "bool"};
  } else if constexpr (std::is_floating_point_v<T>) {
    static_assert(sizeof(T) <= 8, "long double is no CANopen type");
    return {Kind::real, bits, bits == 32 ? "float" : "double"};
  } else if constexpr (std::is_integral_v<T> && std::is_signed_v<T>) {
    constexpr const char* names[] = {"std::int8_t", "std::int16_t", "std::int32_t", "std::int64_t"};
    return {Kind::signed_integer, bits, names[bits == 8 ? 0 : bits == 16 ? 1 : bits == 32 ? 2 : 3]};
  } else if constexpr (std::is_integral_v<T>) {
    constexpr const char* names[] = {"std::uint8_t", "std::uint16_t", "std::uint32_t", "std::uint64_t"};
    return {Kind::unsigned_integer, bits, names[bits == 8 ? 0 : bits == 16 ? 1 : bits == 32 ? 2 : 3]};
  } else if constexpr (std::is_same_v<T, std::string>) {
    return {Kind::text, 0, "std::string"};
  } else if constexpr (std::is_same_v<T, Bytes>) {
    return {Kind::bytes, 0, "Bytes"};
  } else if constexpr (std::is_same_v<T, co::TimeOfDay>) {
    return {Kind::time, 0, "co::TimeOfDay"};
  } else {
    static_assert(std::is_same_v<T, Value>, "no object of a CANopen device has this C++ type");
    return {Kind::any, 0, "Value"};
  }
}

/// True when a variable of the C++ type holds every value of `type`.
[[nodiscard]] bool readable_as(od::DataType type, CppType wanted) noexcept;
/// The C++ type that fits best: "std::uint32_t".
[[nodiscard]] const char* best_cpp_type(od::DataType type) noexcept;

/// The CANopen type of a C++ type, for objects that are not described: UNSIGNED32 for std::uint32_t, DOMAIN for Bytes.
[[nodiscard]] od::DataType natural_type(CppType cpp) noexcept;

/// What is wrong with a value; `what` null = nothing. `code`: the device's answer to it, or none.
struct Complaint {
  const char* what = nullptr;
  od::AbortCode code = od::AbortCode::none;
};

/// The raw (`od::DataType`) of an uploaded scalar. Four bytes for a shorter type are accepted if the surplus is 0 or
/// the sign, because some devices answer so (e=1, s=0). False: another length.
[[nodiscard]] bool decode(od::DataType type, std::span<const std::uint8_t> bytes, std::uint64_t& raw) noexcept;
/// VISIBLE_STRING up to the first NUL; UNICODE_STRING as UTF-8, with U+FFFD for invalid UTF-16.
[[nodiscard]] std::string decode_text(od::DataType type, std::span<const std::uint8_t> bytes);

/// `readable_as` must hold.
template <class T>
[[nodiscard]] Complaint from_bytes(od::DataType type, std::span<const std::uint8_t> bytes, T& into) {
  constexpr const char* wrong_length = "the answer has another length than the object's type";
  if constexpr (std::is_arithmetic_v<T>) {
    std::uint64_t raw = 0;
    if (!decode(type, bytes, raw)) return {wrong_length};
    if constexpr (std::is_floating_point_v<T>) {
      into = static_cast<T>(od::real_of(type, raw));
    } else if constexpr (std::is_same_v<T, bool>) {
      into = raw != 0;
    } else {
      into = static_cast<T>(raw);
    }
  } else if constexpr (std::is_same_v<T, std::string>) {
    into = decode_text(type, bytes);
  } else if constexpr (std::is_same_v<T, Bytes>) {
    into.assign(bytes.begin(), bytes.end());
  } else if constexpr (std::is_same_v<T, co::TimeOfDay>) {
    const auto time = co::TimeOfDay::decode(bytes);
    if (!time) return {"the answer is no time of day"};
    into = *time;
  } else {
    into.type = type;
    into.bytes.assign(bytes.begin(), bytes.end());
  }
  return {};
}

/// A value to write, of any of the types above. It refers to texts and bytes, which the called function copies.
class Input {
 public:
  template <class T, class = std::enable_if_t<std::is_arithmetic_v<T>>>
  constexpr Input(T value) noexcept : cpp_(cpp_type<T>()) {
    if constexpr (std::is_floating_point_v<T>) {
      real_ = static_cast<double>(value);
    } else {
      if constexpr (std::is_signed_v<T>) negative_ = value < 0;
      number_ = static_cast<std::uint64_t>(value);
    }
  }
  constexpr Input(std::string_view text) noexcept : cpp_(cpp_type<std::string>()), text_(text) {}
  constexpr Input(const char* text) noexcept : Input(std::string_view(text)) {}
  Input(const std::string& text) noexcept : Input(std::string_view(text)) {}
  constexpr Input(std::span<const std::uint8_t> bytes) noexcept : cpp_(cpp_type<Bytes>()), bytes_(bytes) {}
  Input(const Bytes& bytes) noexcept : Input(std::span<const std::uint8_t>(bytes)) {}
  constexpr Input(co::TimeOfDay time) noexcept : cpp_(cpp_type<co::TimeOfDay>()), time_(time) {}
  Input(const Value& value) noexcept : Input(std::span<const std::uint8_t>(value.bytes)) {
    cpp_ = cpp_type<Value>();
    type_ = value.type;
  }

  [[nodiscard]] constexpr CppType cpp() const noexcept { return cpp_; }
  /// The bytes for an object of `type`. A complaint without a code: the C++ type does not fit.
  [[nodiscard]] Complaint encode(od::DataType type, Bytes& into) const;
  /// The type for writing an undescribed object.
  [[nodiscard]] od::DataType natural_type() const noexcept {
    return cpp_.kind == Kind::any ? type_ : client::natural_type(cpp_);
  }

 private:
  [[nodiscard]] Complaint encode_integer(od::DataType type, Bytes& into) const;
  [[nodiscard]] Complaint encode_real(od::DataType type, Bytes& into) const;
  [[nodiscard]] Complaint encode_text(od::DataType type, Bytes& into) const;
  [[nodiscard]] Complaint encode_bytes(od::DataType type, Bytes& into) const;

  CppType cpp_;
  bool negative_ = false;
  od::DataType type_ = od::DataType::none;  // for a Value
  std::uint64_t number_ = 0;                // sign-extended
  double real_ = 0;
  std::string_view text_;
  std::span<const std::uint8_t> bytes_;
  co::TimeOfDay time_;
};

}  // namespace berth::client
