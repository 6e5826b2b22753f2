/// PDO mapping (CiA 301 §7.4.8.3, objects 1600h and 1A00h; docs/protocols/cia301.md §PDO): the places of objects in a
/// PDO.
///
/// A mapping is resolved once to places in `od::Values`; packing and unpacking then use no dictionary. Objects that
/// begin at a byte border are copied byte-wise, and neighbours in the dictionary's memory together; all others go bit
/// by bit through one 64-bit word. Bits count from bit 0 of byte 0 (CiA 301 §7.1.4).
#pragma once

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <span>

#include "berth/od/pdo_objects.hpp"
#include "berth/od/values.hpp"

namespace berth::co {

using od::PdoEntry;
using od::PdoKind;

/// Whether one object may be mapped into a PDO:
/// - no_object 0602 0000: there is no such object, or no such sub-index;
/// - not_mappable 0604 0041: PDOMapping=0; its access type forbids PDOs of this kind (a TPDO reads, an RPDO writes); it
///   has no fixed length; the entry's bit length is not that of its type (BOOLEAN 1); or a dummy that the description
///   does not allow (an RPDO may skip bits by mapping a data type 0001h..001Bh, sub-index 0).
[[nodiscard]] od::AbortCode check_entry(const od::Description& description, PdoEntry entry, PdoKind kind) noexcept;

/// One resolved run of bits: its place in the values and its length (1..64).
class PdoField {
 public:
  /// Places above are not mappable: scalars after 64 MiB of strings and DOMAINs.
  static constexpr std::uint32_t most_offset = (1U << 26) - 2;
  static constexpr std::uint32_t nowhere = (1U << 26) - 1;  ///< dummy: bits that are not wanted

  constexpr PdoField() noexcept = default;
  constexpr PdoField(std::uint32_t offset, unsigned bits) noexcept : word_(offset << 6 | (bits - 1)) {}
  [[nodiscard]] constexpr std::uint32_t offset() const noexcept { return word_ >> 6; }
  [[nodiscard]] constexpr unsigned bits() const noexcept { return (word_ & 63U) + 1; }
  [[nodiscard]] constexpr unsigned bytes() const noexcept { return ((word_ >> 3) & 7U) + 1; }
  [[nodiscard]] constexpr bool dummy() const noexcept { return offset() == nowhere; }

 private:
  std::uint32_t word_ = 0;
};

/// A resolved mapping. It keeps its fields in memory given to it.
class PdoMapping {
 public:
  static constexpr std::size_t most_entries = od::most_pdo_entries;
  static constexpr unsigned most_bits = od::most_pdo_bits;

  PdoMapping() = default;  ///< maps nothing
  /// `room`: at least as many fields as the entries to be resolved; outlives the mapping.
  explicit PdoMapping(std::span<PdoField> room) noexcept : fields_(room.data()) {}

  /// Resolves mapping entries as objects 1600h.. and 1A00h.. hold them. Fails like `check_entry`, or with pdo_length
  /// 0604 0042: more than 64 bits or entries. After a failure the mapping is empty.
  od::AbortCode resolve(const od::Description& description, std::span<const std::uint32_t> entries,
                        PdoKind kind) noexcept;
  void clear() noexcept { count_ = bits_ = 0; }

  [[nodiscard]] bool empty() const noexcept { return bits_ == 0; }
  [[nodiscard]] unsigned bits() const noexcept { return bits_; }
  /// Bytes of the PDO.
  [[nodiscard]] unsigned size() const noexcept { return (bits_ + 7U) / 8U; }
  /// The fields, with neighbours joined.
  [[nodiscard]] std::span<const PdoField> fields() const noexcept { return {fields_, count_}; }
  /// True when the value at `offset` (`SubObject::offset`) is mapped.
  [[nodiscard]] bool contains(std::uint32_t offset) const noexcept;

  /// Start of the values, for `pack` and `unpack`.
  [[nodiscard]] static std::uint8_t* base_of(od::Values& values) noexcept { return values.scalar(od::SubObject{}); }
  /// Writes `size()` bytes at `into`, which must have room for 8; bits after the last object are 0.
  void pack(const std::uint8_t* base, std::uint8_t* into) const noexcept;
  /// Stores the objects from `size()` bytes at `from`. Nothing else in the values changes.
  void unpack(std::uint8_t* base, const std::uint8_t* from) const noexcept;

 private:
  void join() noexcept;
  void pack_bits(const std::uint8_t* base, std::uint8_t* into) const noexcept;
  void unpack_bits(std::uint8_t* base, const std::uint8_t* from) const noexcept;
  // Not std::memcpy: the C library would check the bounds for each field. `map` has checked them once.
  static void copy(std::uint8_t* to, const std::uint8_t* from, unsigned bytes) noexcept {
    if (bytes == 8) {
      std::copy_n(from, 8, to);
    } else if (bytes == 4) {
      std::copy_n(from, 4, to);
    } else if (bytes == 2) {
      std::copy_n(from, 2, to);
    } else {
      for (unsigned i = 0; i < bytes; ++i) to[i] = from[i];
    }
  }

  PdoField* fields_ = nullptr;
  std::uint8_t count_ = 0;
  std::uint8_t bits_ = 0;
  bool bytewise_ = true;
};

inline void PdoMapping::pack(const std::uint8_t* base, std::uint8_t* into) const noexcept {
  if (!bytewise_) return pack_bits(base, into);
  for (const PdoField field : fields()) {
    copy(into, base + field.offset(), field.bytes());
    into += field.bytes();
  }
}

inline void PdoMapping::unpack(std::uint8_t* base, const std::uint8_t* from) const noexcept {
  if (!bytewise_) return unpack_bits(base, from);
  for (const PdoField field : fields()) {
    if (!field.dummy()) copy(base + field.offset(), from, field.bytes());
    from += field.bytes();
  }
}

}  // namespace berth::co
