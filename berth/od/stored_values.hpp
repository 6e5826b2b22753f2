/// The stored values of one device's object dictionary, for the device's own services and application: any access type,
/// without hooks and limits. `Values` adds the network's side.
#pragma once

#include <bit>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <span>
#include <string_view>
#include <type_traits>
#include <vector>

#include "berth/base/ids.hpp"
#include "berth/od/abort_code.hpp"
#include "berth/od/description.hpp"

namespace berth::od {

/// The part of the dictionary that a reset affects (CiA 301 §7.3.2.2.2): communication 1000h..1FFFh, application all
/// other indices (2000h..9FFFh, and A000h upwards).
enum class Area : std::uint8_t { communication, application, all };
[[nodiscard]] constexpr Area area_of(std::uint16_t index) noexcept {
  return index >= 0x1000 && index <= 0x1FFF ? Area::communication : Area::application;
}

class StoredValues {
 public:
  /// All values at their defaults for `node_id`. Reserves `Description::value_bytes()`; no other call uses the heap.
  explicit StoredValues(std::shared_ptr<const Description> description, NodeId node_id = {});
  ~StoredValues() = default;
  StoredValues(const StoredValues&) = delete;
  StoredValues& operator=(const StoredValues&) = delete;

  [[nodiscard]] const Description& description() const noexcept { return *description_; }
  [[nodiscard]] const std::shared_ptr<const Description>& shared_description() const noexcept { return description_; }
  /// The node-ID of the last `reset`.
  [[nodiscard]] NodeId node_id() const noexcept { return node_id_; }
  /// Restores the defaults; `$NODEID` counts as 0 while the node-ID is unconfigured. Hooks are not called.
  void reset(NodeId node_id, Area area = Area::all) noexcept;

  /// The stored bytes; empty when there is no such sub-object or it has no value.
  [[nodiscard]] std::span<const std::uint8_t> bytes(ObjectRef ref) const noexcept;
  [[nodiscard]] std::span<const std::uint8_t> stored(const SubObject& sub) const noexcept;
  /// Address of a scalar's bytes, for a PDO's copy: stable for the life of this object.
  [[nodiscard]] std::uint8_t* scalar(const SubObject& sub) noexcept { return data_.data() + sub.offset; }
  [[nodiscard]] std::span<const std::uint8_t> scalar(const SubObject& sub) const noexcept {
    return {data_.data() + sub.offset, sub.capacity};
  }
  /// Stores regardless of access type and limits, but never a wrong length.
  AbortCode set_bytes(ObjectRef ref, std::span<const std::uint8_t> value) noexcept;
  AbortCode set_text(ObjectRef ref, std::string_view text) noexcept;
  [[nodiscard]] std::string_view get_text(ObjectRef ref) const noexcept;
  /// `get<std::uint32_t>({0x1018, 1})`. Any arithmetic T that can hold every value of the object's type; else
  /// length_mismatch 0607 0010. Integers from integers, float and double from reals.
  template <class T>
  [[nodiscard]] Answer<T> get(ObjectRef ref) const noexcept {
    const auto raw = raw_for(ref, class_of<T>(), sizeof(T) * 8);
    if (!raw) return refuse(raw.error());
    if constexpr (std::is_floating_point_v<T>) {
      return static_cast<T>(std::bit_cast<double>(*raw));
    } else {
      return static_cast<T>(*raw);
    }
  }
  /// The same with a fallback for an object that is missing or of another kind.
  template <class T>
  [[nodiscard]] T get_or(ObjectRef ref, T otherwise) const noexcept {
    const auto value = get<T>(ref);
    return value ? *value : otherwise;
  }
  /// Stores a number of any arithmetic type; value_too_high / value_too_low when the object's type cannot hold it (the
  /// description's limits are ignored).
  template <class T>
  AbortCode set(ObjectRef ref, T value) noexcept {
    static_assert(std::is_arithmetic_v<T>);
    if constexpr (std::is_floating_point_v<T>) {
      return set_real(ref, static_cast<double>(value));
    } else if constexpr (std::is_signed_v<T>) {
      return set_integer(ref, static_cast<std::uint64_t>(static_cast<std::int64_t>(value)), value < 0);
    } else {
      return set_integer(ref, static_cast<std::uint64_t>(value), false);
    }
  }
  /// Bytes held by this instance, without the shared description and itself.
  [[nodiscard]] std::size_t stored_memory() const noexcept { return data_.capacity(); }

 protected:
  struct Found {
    const Object* object;
    const SubObject* sub;
  };
  /// no_object 0602 0000 or no_sub_index 0609 0011 when it is not described.
  [[nodiscard]] Answer<Found> find(ObjectRef ref) const noexcept {
    const Object* const object = description_->find(ref.index);
    if (object == nullptr) return refuse(AbortCode::no_object);
    const SubObject* const sub = description_->find(*object, ref.sub);
    if (sub == nullptr) return refuse(AbortCode::no_sub_index);
    return Found{object, sub};
  }
  /// True for a string or DOMAIN that was never given a value.
  [[nodiscard]] bool absent(const SubObject& sub) const noexcept;
  [[nodiscard]] static AbortCode check_length(const SubObject& sub, std::size_t length) noexcept;
  /// Stores a value of correct length.
  void put(const SubObject& sub, std::span<const std::uint8_t> value) noexcept;

 private:
  enum class Class : std::uint8_t { boolean, unsigned_integer, signed_integer, real };
  template <class T>
  static constexpr Class class_of() noexcept {
    static_assert(std::is_arithmetic_v<T>);
    if (std::is_floating_point_v<T>) return Class::real;
    if (std::is_same_v<T, bool>) return Class::boolean;
    return std::is_signed_v<T> ? Class::signed_integer : Class::unsigned_integer;
  }
  [[nodiscard]] std::size_t slot_of(std::uint32_t index) const noexcept;
  /// The raw of an integer, sign-extended; of a real the bits of a double.
  [[nodiscard]] Answer<std::uint64_t> raw_for(ObjectRef ref, Class wanted, unsigned bits) const noexcept;
  AbortCode set_integer(ObjectRef ref, std::uint64_t raw, bool negative) noexcept;
  AbortCode set_real(ObjectRef ref, double value) noexcept;

  std::shared_ptr<const Description> description_;
  std::vector<std::uint8_t> data_;  ///< as `Description::image_`; variable length: U32 length, then the bytes
  NodeId node_id_;
};

}  // namespace berth::od
