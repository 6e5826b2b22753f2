/// The structure of a device's object dictionary (CiA 301 §7.4): immutable, shared by all devices of a type.
/// `od::Values` holds the values of one device. `DescriptionBuilder` makes it, by hand or from a device description
/// file (room `eds`).
#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "berth/base/ids.hpp"
#include "berth/od/data_type.hpp"

namespace berth::od {

/// Object codes (CiA 301 §7.4.3).
enum class ObjectCode : std::uint8_t {
  null = 0,
  domain = 2,
  deftype = 5,
  defstruct = 6,
  var = 7,
  array = 8,
  record = 9
};
[[nodiscard]] std::string_view name(ObjectCode code) noexcept;

/// Access from the network (CiA 306 §4.6). rwr: read/write, mappable into a TPDO; rww: into an RPDO; constant: `const`.
enum class Access : std::uint8_t { ro, wo, rw, rwr, rww, constant };
[[nodiscard]] std::string_view name(Access access) noexcept;  ///< "ro" ... "const"
[[nodiscard]] constexpr bool readable(Access access) noexcept { return access != Access::wo; }
[[nodiscard]] constexpr bool writable(Access access) noexcept {
  return access != Access::ro && access != Access::constant;
}

/// ObjFlags (CiA 306 §4.6.3.2): a configuration tool must not write the object.
inline constexpr std::uint8_t refuse_write_on_download = 1;
inline constexpr std::uint8_t refuse_read_on_scan = 2;

/// Length word of a variable-length value that does not exist (a DOMAIN that was never filled).
inline constexpr std::uint32_t no_value = 0xFFFF'FFFF;

/// One value of the dictionary, 32 bytes. A VAR object has exactly one, sub-index 0.
struct SubObject {
  std::uint32_t offset = 0;    ///< place of its value in `Values`; of variable length: a U32 length, then the bytes
  std::uint32_t capacity = 0;  ///< reserved bytes: the size of a scalar, the longest possible string or DOMAIN
  std::uint32_t name_at = 0;
  std::uint32_t default_at = 0;  ///< position in the table of $NODEID offsets when `relative`
  std::uint32_t limits_at = 0;   ///< 0 = no limits, else index + 1
  DataType type = DataType::none;
  std::uint16_t name_length = 0;
  std::uint8_t sub = 0;
  Access access = Access::rw;
  std::uint8_t obj_flags = 0;
  bool mappable : 1 = false;     ///< may be mapped into a PDO
  bool has_default : 1 = false;  ///< the description gives a default (else the value is initially 0 or empty)
  bool relative : 1 = false;     ///< the default is $NODEID + an offset
  bool fixed : 1 = false;        ///< not of `variable_length`; the bit is faster to test
  bool bounded : 1 = true;       ///< `capacity` is the described length; false: it is only limited by memory

  [[nodiscard]] bool variable_length() const noexcept { return byte_size(type) == 0; }
  /// As in `SubSpec::capacity`.
  [[nodiscard]] std::uint32_t described_length() const noexcept { return variable_length() && bounded ? capacity : 0; }
};

struct Object {
  std::uint16_t index = 0;
  ObjectCode code = ObjectCode::var;
  std::uint8_t obj_flags = 0;
  DataType type = DataType::none;  ///< as described; often none for arrays and records
  std::uint16_t count = 0;         ///< number of sub-objects
  std::uint32_t first = 0;         ///< position of the first one in `Description::subs()`
  std::uint32_t name_at = 0;
  std::uint16_t name_length = 0;
};

/// Limits of a scalar (kind number or node_id_plus, or none).
struct Limits {
  Literal low;
  Literal high;
};

/// A value with a name.
struct NamedValue {
  std::uint64_t raw = 0;  ///< its bits, as `load` gives them
  std::string name = {};  ///< empty: the value is only allowed
  friend bool operator==(const NamedValue&, const NamedValue&) = default;
};

/// Units, names and allowed values of a scalar, if the description has them: CiA 311 (XDD, XDC) does, in `unit`,
/// `allowedValues` and enumerated data types; an EDS has none.
struct Meaning {
  std::string text = {};     ///< explanation for users, one line; empty: only the object's name
  std::string unit = {};     ///< "°C"; empty: unknown
  std::int64_t number = 1;   ///< one count is `number` times 10 to the power of `exponent` of the unit; `number` > 0
  std::int8_t exponent = 0;  ///< -18 to 18
  std::vector<NamedValue> values = {};  ///< ascending by `raw`
  bool only_these = false;              ///< only the values in `values` are allowed
  friend bool operator==(const Meaning&, const Meaning&) = default;
};

class Description {
 public:
  /// Ascending by index.
  [[nodiscard]] std::span<const Object> objects() const noexcept { return objects_; }
  /// All sub-objects, ascending by index and sub-index.
  [[nodiscard]] std::span<const SubObject> subs() const noexcept { return subs_; }
  [[nodiscard]] std::span<const SubObject> subs(const Object& object) const noexcept {
    return std::span(subs_).subspan(object.first, object.count);
  }
  /// nullptr when there is none. A hash look-up, because every access to an object begins here.
  [[nodiscard]] const Object* find(std::uint16_t index) const noexcept {
    for (std::uint32_t at = place_of(index);; ++at) {
      const std::uint32_t position = places_[at & place_mask_];
      if (position == 0) return nullptr;
      const Object& object = objects_[position - 1];
      if (object.index == index) return &object;
    }
  }
  [[nodiscard]] const SubObject* find(const Object& object, std::uint8_t sub) const noexcept {
    const SubObject* const first = subs_.data() + object.first;
    return sub < object.count && first[sub].sub == sub ? first + sub : search(object, sub);
  }
  [[nodiscard]] const SubObject* find(ObjectRef ref) const noexcept;

  [[nodiscard]] std::string_view name(const Object& object) const noexcept;
  /// The sub-object's own name ("Vendor-ID").
  [[nodiscard]] std::string_view name(const SubObject& sub) const noexcept;
  /// The described default; none if the description gives none. The type decides the kind of bytes.
  [[nodiscard]] Literal default_of(const SubObject& sub) const;
  /// nullptr when neither limit is given.
  [[nodiscard]] const Limits* limits(const SubObject& sub) const noexcept {
    return sub.limits_at == 0 ? nullptr : &limits_[sub.limits_at - 1];
  }
  /// nullptr when the description has no meaning for it.
  [[nodiscard]] const Meaning* meaning(ObjectRef ref) const noexcept;
  /// Number of sub-objects with a meaning.
  [[nodiscard]] std::size_t meanings() const noexcept { return meanings_.size(); }
  /// True when data type `index` (0001h..001Bh) may be mapped into an RPDO as a dummy (EDS [DummyUsage]).
  [[nodiscard]] bool dummy_mappable(std::uint16_t index) const noexcept {
    return index >= 1 && index <= 0x1B && ((dummies_ >> index) & 1U) != 0;
  }
  /// Bytes that one device's values need.
  [[nodiscard]] std::size_t value_bytes() const noexcept { return image_.size(); }
  /// Bytes held by this description (once per type).
  [[nodiscard]] std::size_t memory() const noexcept;

 private:
  friend class DescriptionBuilder;
  friend class StoredValues;
  struct Relative {
    std::uint32_t sub;  ///< position in subs_
    std::uint64_t offset;
  };
  [[nodiscard]] std::string_view text(std::uint32_t at, std::uint16_t length) const noexcept {
    return std::string_view(names_).substr(at, length);
  }

  [[nodiscard]] std::uint32_t place_of(std::uint16_t index) const noexcept {
    return (index * 0x9E37'79B1U) >> place_shift_;
  }
  void index_objects();
  [[nodiscard]] const SubObject* search(const Object& object, std::uint8_t sub) const noexcept;

  std::vector<std::uint32_t> places_ = {0, 0};  ///< by hash of the index: position in objects_ + 1, 0 = nothing
  std::uint32_t place_mask_ = 1;                ///< number of places less one
  std::uint32_t place_shift_ = 31;              ///< leaves as many bits of the hash as `places_` needs
  std::vector<Object> objects_;
  std::vector<SubObject> subs_;
  std::vector<Limits> limits_;
  std::vector<Relative> relatives_;
  std::vector<std::pair<ObjectRef, Meaning>> meanings_;  ///< ascending
  std::vector<std::uint8_t> image_;                      ///< the values for node-ID 0
  std::string names_;
  std::uint32_t dummies_ = 0;
};

/// Specification of a sub-object. Use designated initialisers: `{.name = "Vendor-ID", .type = DataType::unsigned32}`.
struct SubSpec {
  std::uint8_t sub = 0;
  std::string_view name = {};
  DataType type = DataType::unsigned32;
  Access access = Access::rw;
  bool mappable = false;
  Literal initial = {};  ///< the default value
  Literal low = {};
  Literal high = {};
  std::uint8_t obj_flags = 0;
  /// Strings, DOMAIN and unknown types: longest value in bytes. 0 = not described: room for 64 bytes, for 250 if
  /// writable, for 16 KiB if a DOMAIN, up to 1 MiB in all. A longer default raises it.
  std::uint32_t capacity = 0;
};

/// Collects objects in any order; a second definition of an object or sub-object replaces the first.
class DescriptionBuilder {
 public:
  DescriptionBuilder();
  ~DescriptionBuilder();
  DescriptionBuilder(const DescriptionBuilder&) = delete;
  DescriptionBuilder& operator=(const DescriptionBuilder&) = delete;

  /// A VAR (or DOMAIN object when the type is DOMAIN): `spec.sub` counts as 0.
  DescriptionBuilder& variable(std::uint16_t index, const SubSpec& spec);
  /// An ARRAY or RECORD (or any other code); add its sub-objects with `sub`.
  DescriptionBuilder& object(std::uint16_t index, ObjectCode code, std::string_view name,
                             DataType type = DataType::none, std::uint8_t obj_flags = 0);
  /// A sub-object of an object of any code; an unknown `index` becomes a RECORD.
  DescriptionBuilder& sub(std::uint16_t index, const SubSpec& spec);
  /// The meaning of a sub-object's numbers; a second one replaces the first.
  DescriptionBuilder& meaning(ObjectRef ref, Meaning meaning);
  /// Bit n (1..27) = data type n may be mapped as a dummy.
  DescriptionBuilder& dummies(std::uint32_t mask);
  [[nodiscard]] bool has(std::uint16_t index) const noexcept;
  [[nodiscard]] bool has(ObjectRef ref) const noexcept;
  /// The latest specification of a sub-object (without its name); fast for those added last.
  [[nodiscard]] std::optional<SubSpec> spec_of(ObjectRef ref) const;
  /// Changes the default of an existing sub-object.
  DescriptionBuilder& initial(ObjectRef ref, const Literal& value);

  /// Arrays and records without a sub-index 0 get one (UNSIGNED8, const, highest sub-index); a read-only sub-index 0
  /// without a default gets the highest sub-index as its value (CiA 301 §7.4.5). The builder is empty afterwards.
  [[nodiscard]] std::shared_ptr<const Description> build();

 private:
  struct State;
  std::unique_ptr<State> state_;
};

}  // namespace berth::od
