/// What a device's object dictionary looks like (CiA 301 §7.4): immutable, shared by all devices of a type. The
/// values of one device are `od::Values`. Made by `DescriptionBuilder`, by hand or from a device description file
/// (room `eds`).
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

/// ObjFlags (CiA 306 §4.6.3.2): what a configuration tool must leave alone.
inline constexpr std::uint8_t refuse_write_on_download = 1;
inline constexpr std::uint8_t refuse_read_on_scan = 2;

/// The length word of a value of variable length that is not there (a DOMAIN that was not filled).
inline constexpr std::uint32_t no_value = 0xFFFF'FFFF;

/// One value of the dictionary, 32 bytes. A VAR object has exactly one, sub-index 0.
struct SubObject {
  std::uint32_t offset = 0;    ///< where its value stands in `Values`; of variable length: a U32 length, then the bytes
  std::uint32_t capacity = 0;  ///< bytes reserved: the size of a scalar, the longest string or DOMAIN there is room for
  std::uint32_t name_at = 0;
  std::uint32_t default_at = 0;  ///< position in the table of $NODEID offsets when `relative`
  std::uint32_t limits_at = 0;   ///< 0 = no limits, else index + 1
  DataType type = DataType::none;
  std::uint16_t name_length = 0;
  std::uint8_t sub = 0;
  Access access = Access::rw;
  std::uint8_t obj_flags = 0;
  bool mappable : 1 = false;     ///< may be mapped into a PDO
  bool has_default : 1 = false;  ///< the description gives a default (else the value starts as 0 or empty)
  bool relative : 1 = false;     ///< the default is $NODEID + an offset
  bool fixed : 1 = false;        ///< not of `variable_length`; the bit is quicker to ask
  bool bounded : 1 = true;       ///< `capacity` is what the description says; false: no more than there is memory

  [[nodiscard]] bool variable_length() const noexcept { return byte_size(type) == 0; }
  /// As `SubSpec::capacity` has it.
  [[nodiscard]] std::uint32_t described_length() const noexcept { return variable_length() && bounded ? capacity : 0; }
};

struct Object {
  std::uint16_t index = 0;
  ObjectCode code = ObjectCode::var;
  std::uint8_t obj_flags = 0;
  DataType type = DataType::none;  ///< as described; of arrays and records often none
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

/// A value that has a name.
struct NamedValue {
  std::uint64_t raw = 0;  ///< its bits, as `load` gives them
  std::string name = {};  ///< may be empty: the value is allowed, that is all
  friend bool operator==(const NamedValue&, const NamedValue&) = default;
};

/// What a scalar's numbers stand for, where the description says it: that of CiA 311 (XDD, XDC) does, in `unit`,
/// `allowedValues` and enumerated data types; an EDS has nothing of it.
struct Meaning {
  std::string text = {};     ///< what it is, for people, one line; empty: nothing more than the object's name
  std::string unit = {};     ///< "°C"; empty: not known
  std::int64_t number = 1;   ///< one count is `number` times 10 to the power of `exponent` of the unit; `number` > 0
  std::int8_t exponent = 0;  ///< -18 to 18
  std::vector<NamedValue> values = {};  ///< ascending by `raw`
  bool only_these = false;              ///< no other value than those in `values` is allowed
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
  /// nullptr when there is none. By hash: every access to an object begins here.
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
  /// What the description says: none when it gives no default. The bytes' kind is by type.
  [[nodiscard]] Literal default_of(const SubObject& sub) const;
  /// nullptr when neither limit is given.
  [[nodiscard]] const Limits* limits(const SubObject& sub) const noexcept {
    return sub.limits_at == 0 ? nullptr : &limits_[sub.limits_at - 1];
  }
  /// nullptr when the description says nothing of it.
  [[nodiscard]] const Meaning* meaning(ObjectRef ref) const noexcept;
  /// Of how many it says something.
  [[nodiscard]] std::size_t meanings() const noexcept { return meanings_.size(); }
  /// True when data type `index` (0001h..001Bh) may be mapped into an RPDO as a dummy (EDS [DummyUsage]).
  [[nodiscard]] bool dummy_mappable(std::uint16_t index) const noexcept {
    return index >= 1 && index <= 0x1B && ((dummies_ >> index) & 1U) != 0;
  }
  /// Bytes that one device's values need.
  [[nodiscard]] std::size_t value_bytes() const noexcept { return image_.size(); }
  /// Bytes that this description holds (once per type).
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
  std::uint32_t place_mask_ = 1;                ///< how many there are, less one
  std::uint32_t place_shift_ = 31;              ///< leaves as many bits of the hash as `places_` needs
  std::vector<Object> objects_;
  std::vector<SubObject> subs_;
  std::vector<Limits> limits_;
  std::vector<Relative> relatives_;
  std::vector<std::pair<ObjectRef, Meaning>> meanings_;  ///< ascending
  std::vector<std::uint8_t> image_;                      ///< the values of a device whose node-ID is 0
  std::string names_;
  std::uint32_t dummies_ = 0;
};

/// What one sub-object is to be. Use designated initialisers: `{.name = "Vendor-ID", .type = DataType::unsigned32}`.
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
  /// Strings, DOMAIN and unknown types: longest value in bytes. 0 = the description says nothing: room for 64 bytes, of
  /// what can be written for 250, of a DOMAIN for 16 KiB, as long as that is not more than 1 MiB in all. A longer
  /// default raises it.
  std::uint32_t capacity = 0;
};

/// Collects objects in any order; a second definition of an object or sub-object replaces the first.
class DescriptionBuilder {
 public:
  DescriptionBuilder();
  ~DescriptionBuilder();
  DescriptionBuilder(const DescriptionBuilder&) = delete;
  DescriptionBuilder& operator=(const DescriptionBuilder&) = delete;

  /// A VAR (or DOMAIN object when the type is DOMAIN): `spec.sub` is taken as 0.
  DescriptionBuilder& variable(std::uint16_t index, const SubSpec& spec);
  /// An ARRAY or RECORD (or any other code); its sub-objects follow by `sub`.
  DescriptionBuilder& object(std::uint16_t index, ObjectCode code, std::string_view name,
                             DataType type = DataType::none, std::uint8_t obj_flags = 0);
  /// A sub-object of an object of any code; makes a RECORD of it when `index` is not known yet.
  DescriptionBuilder& sub(std::uint16_t index, const SubSpec& spec);
  /// What the numbers of a sub-object stand for; a second one replaces the first.
  DescriptionBuilder& meaning(ObjectRef ref, Meaning meaning);
  /// Bit n (1..27) = data type n may be mapped as a dummy.
  DescriptionBuilder& dummies(std::uint32_t mask);
  [[nodiscard]] bool has(std::uint16_t index) const noexcept;
  [[nodiscard]] bool has(ObjectRef ref) const noexcept;
  /// What was last said about a sub-object (without its name); quick for those added last.
  [[nodiscard]] std::optional<SubSpec> spec_of(ObjectRef ref) const;
  /// Gives a sub-object that is there another default.
  DescriptionBuilder& initial(ObjectRef ref, const Literal& value);

  /// Arrays and records without a sub-index 0 get one (UNSIGNED8, const, highest sub-index); a read-only sub-index 0
  /// without a default gets the highest sub-index as its value (CiA 301 §7.4.5). The builder is empty afterwards.
  [[nodiscard]] std::shared_ptr<const Description> build();

 private:
  struct State;
  std::unique_ptr<State> state_;
};

}  // namespace berth::od
