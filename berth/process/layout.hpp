/// The variables of a process image: names, types, directions, places.
///
///     process::Layout layout;
///     const auto level = layout.output<std::int16_t>("Silo level");     // comes from the network
///     const auto motor = layout.input<bool>("Belt motor");              // goes to the network
///     const auto count = layout.output<std::int32_t>("Count", od::DataType::integer24);
///
/// All scalars of CiA 301 §7.4.7 are allowed: the 18 types of network variables (paper 5, table 1) and REAL64,
/// TIME_OF_DAY and TIME_DIFFERENCE.
#pragma once

#include <array>
#include <cstdint>
#include <cstring>
#include <functional>
#include <map>
#include <span>
#include <string>
#include <string_view>
#include <type_traits>
#include <vector>

#include "berth/od/data_type.hpp"

namespace berth::process {

enum class Direction : std::uint8_t { input, output };  ///< from the network's view

struct Variable {
  std::string name;
  od::DataType type = od::DataType::none;
  Direction direction = Direction::output;
  std::uint32_t offset = 0;  ///< bytes from the beginning of its direction's part
  std::uint32_t number = 0;  ///< among those of its direction
};

/// The CiA 301 type of a C++ type.
template <class T>
[[nodiscard]] constexpr od::DataType type_of() noexcept {
  static_assert(std::is_arithmetic_v<T>);
  using enum od::DataType;
  if constexpr (std::is_same_v<T, bool>) return boolean;
  if constexpr (std::is_floating_point_v<T>) return sizeof(T) == 4 ? real32 : real64;
  constexpr std::array whole{unsigned8, unsigned16, unsigned32, unsigned64, integer8, integer16, integer32, integer64};
  constexpr std::size_t size = sizeof(T) == 1 ? 0 : sizeof(T) == 2 ? 1 : sizeof(T) == 4 ? 2 : 3;
  return whole[size + (std::is_signed_v<T> ? 4 : 0)];
}
/// True if T holds every value of the type: std::int32_t those of INTEGER24.
template <class T>
[[nodiscard]] constexpr bool holds(od::DataType type) noexcept {
  if (type == type_of<T>()) return true;
  const bool whole = std::is_integral_v<T> && !std::is_same_v<T, bool> && type != od::DataType::boolean;
  const bool kind = std::is_signed_v<T> ? od::is_signed(type) : od::is_unsigned(type);
  return whole && kind && od::bit_length(type) <= 8 * sizeof(T);
}

/// The place of a variable; made by `Layout`. If it could not be declared, it is not `valid`: it reads 0 and sets
/// nothing.
template <class T, Direction way>
class Handle {
 public:
  Handle() = default;
  explicit Handle(const Variable& variable) noexcept
      : offset_(variable.offset), number_(variable.number), type_(variable.type) {}
  [[nodiscard]] bool valid() const noexcept { return offset_ != none; }
  [[nodiscard]] std::uint32_t offset() const noexcept { return offset_; }
  [[nodiscard]] std::uint32_t number() const noexcept { return number_; }

  /// Its value in its direction's part.
  [[nodiscard]] T load(std::span<const std::uint8_t> part) const noexcept {
    if (offset_ >= part.size()) return T{};
    const auto* const from = part.data() + offset_;
    if (type_ != type_of<T>()) return static_cast<T>(od::load(type_, from));
    T value{};
    std::memcpy(&value, from, sizeof(T));
    return value;
  }
  /// False, and nothing is stored: not valid, or out of the type's range.
  bool store(std::span<std::uint8_t> part, T value) const noexcept {
    if (offset_ >= part.size()) return false;
    auto* const to = part.data() + offset_;
    if (type_ == type_of<T>()) {
      std::memcpy(to, &value, sizeof(T));
      return true;
    }
    const auto raw = static_cast<std::uint64_t>(value);
    if (od::wrap(type_, raw) != raw) return false;
    od::store(type_, raw, to);
    return true;
  }

 private:
  static constexpr std::uint32_t none = 0xFFFF'FFFF;
  std::uint32_t offset_ = none;
  std::uint32_t number_ = none;
  od::DataType type_ = type_of<T>();
};
template <class T>
using Input = Handle<T, Direction::input>;
template <class T>
using Output = Handle<T, Direction::output>;

inline constexpr std::uint32_t largest_part = 1024 * 1024;  ///< bytes of one direction
inline constexpr std::size_t longest_name = 255;            ///< bytes of a variable's name

class Layout {
 public:
  /// Placed after the last one, at a multiple of its size. `type`: one that T holds, for example INTEGER24 in
  /// std::int32_t.
  template <class T>
  [[nodiscard]] Input<T> input(std::string_view name, od::DataType type = type_of<T>()) {
    return made<T, Direction::input>(name, type);
  }
  template <class T>
  [[nodiscard]] Output<T> output(std::string_view name, od::DataType type = type_of<T>()) {
    return made<T, Direction::output>(name, type);
  }
  /// Placed after the last one; false: see `problems`. Types without a fixed size (strings, DOMAIN) are not allowed.
  bool declare(std::string_view name, od::DataType type, Direction direction);
  /// At a given offset (PPOffset of an EDS's [DynamicChannels], CiA 306-3). Refused if it overlaps another one.
  bool declare_at(std::string_view name, od::DataType type, Direction direction, std::uint32_t offset);

  /// In the order of declaration.
  [[nodiscard]] std::span<const Variable> variables() const noexcept { return variables_; }
  /// Null when there is none of that name.
  [[nodiscard]] const Variable* find(std::string_view name) const noexcept;
  /// The handle of a variable that was declared by name and type, for example by a loader. Not `valid`: there is none
  /// of that name and direction, or T does not hold its type.
  template <class T, Direction way>
  [[nodiscard]] Handle<T, way> handle(std::string_view name) const noexcept {
    const auto* const found = find(name);
    const bool fits = found != nullptr && found->direction == way && holds<T>(found->type);
    return fits ? Handle<T, way>(*found) : Handle<T, way>();
  }
  /// Bytes of a direction's part.
  [[nodiscard]] std::uint32_t size(Direction direction) const noexcept { return sizes_[place(direction)]; }
  /// Number of variables of a direction.
  [[nodiscard]] std::uint32_t count(Direction direction) const noexcept { return counts_[place(direction)]; }
  /// Variables that could not be declared, and why; for users.
  [[nodiscard]] std::span<const std::string> problems() const noexcept { return problems_; }

 private:
  static constexpr std::size_t place(Direction direction) noexcept { return direction == Direction::input ? 0 : 1; }
  template <class T, Direction way>
  [[nodiscard]] Handle<T, way> made(std::string_view name, od::DataType type) {
    if (!holds<T>(type)) return refuse_type(name, type), Handle<T, way>();
    return declare(name, type, way) ? Handle<T, way>(variables_.back()) : Handle<T, way>();
  }
  bool refuse(std::string why);
  void refuse_type(std::string_view name, od::DataType type);
  std::vector<Variable> variables_;
  std::map<std::string, std::size_t, std::less<>> by_name_;
  std::array<std::map<std::uint32_t, std::size_t>, 2> by_offset_;
  std::array<std::uint32_t, 2> sizes_{};
  std::array<std::uint32_t, 2> counts_{};
  std::vector<std::string> problems_;
};

}  // namespace berth::process
