/// The objects of PDOs, 1400h to 1BFFh (CiA 301 §7.5.2.35 to §7.5.2.38): their indices, and the only parser for them,
/// wherever the values come from: a dictionary, a description's defaults, or a device.
///
///     const auto pdo = od::read_pdo(values, od::PdoKind::tpdo, 1);
///     if (pdo.cob_id.valid()) ...
///
///     od::PdoReader reader(od::PdoKind::tpdo, 1);                  // values from elsewhere
///     while (const auto ref = reader.next()) reader.give(value_of(*ref));
///     use(reader.parameters());
///
/// `co::PdoRecords` has the rules for writes to a device.
#pragma once

#include <algorithm>
#include <cstdint>
#include <optional>
#include <vector>

#include "berth/base/ids.hpp"
#include "berth/od/cob_id.hpp"
#include "berth/od/values.hpp"

namespace berth::od {

/// From the device's view: it receives an RPDO and transmits a TPDO.
enum class PdoKind : std::uint8_t { rpdo, tpdo };

inline constexpr unsigned most_pdos = 512;         ///< of each kind; a PDO's number is 1 to 512
inline constexpr unsigned most_pdo_entries = 64;   ///< mapping entries of a PDO
inline constexpr unsigned most_pdo_bits = 64;      ///< mapped bits of a PDO
inline constexpr std::uint16_t last_dummy = 0x1F;  ///< indices up to here are data types: skipped mapped bits

/// The UNSIGNED32 of a mapping entry.
struct PdoEntry {
  ObjectRef object;
  std::uint8_t bits = 0;
  [[nodiscard]] static constexpr PdoEntry of(std::uint32_t raw) noexcept {
    return {{static_cast<std::uint16_t>(raw >> 16), static_cast<std::uint8_t>(raw >> 8)},
            static_cast<std::uint8_t>(raw)};
  }
  [[nodiscard]] constexpr std::uint32_t raw() const noexcept {
    return static_cast<std::uint32_t>(object.index) << 16 | static_cast<std::uint32_t>(object.sub) << 8 | bits;
  }
  [[nodiscard]] constexpr bool dummy() const noexcept { return object.index <= last_dummy; }
  friend constexpr bool operator==(const PdoEntry&, const PdoEntry&) noexcept = default;
};

// ---- indices of the records

inline constexpr std::uint16_t first_pdo_record = 0x1400;
inline constexpr std::uint16_t last_pdo_record = 0x1BFF;
/// Offset from a communication record to the mapping record of the same PDO.
inline constexpr std::uint16_t to_mapping = 0x200;

[[nodiscard]] constexpr std::uint16_t communication_index(PdoKind kind, unsigned number) noexcept {
  return static_cast<std::uint16_t>((kind == PdoKind::rpdo ? 0x13FFU : 0x17FFU) + number);
}
[[nodiscard]] constexpr std::uint16_t mapping_index(PdoKind kind, unsigned number) noexcept {
  return static_cast<std::uint16_t>(communication_index(kind, number) + to_mapping);
}

/// The record that an object of 1400h..1BFFh is.
struct PdoRecord {
  PdoKind kind;
  bool mapping;
  std::uint16_t number;  ///< 1..512
  [[nodiscard]] static constexpr PdoRecord of(std::uint16_t index) noexcept {
    const unsigned at = index - unsigned{first_pdo_record};
    return {at < 0x400 ? PdoKind::rpdo : PdoKind::tpdo, at % 0x400 >= to_mapping,
            static_cast<std::uint16_t>(at % to_mapping + 1)};
  }
};
[[nodiscard]] constexpr bool is_pdo_record(std::uint16_t index) noexcept {
  return index >= first_pdo_record && index <= last_pdo_record;
}
[[nodiscard]] constexpr bool is_pdo_mapping(std::uint16_t index) noexcept {
  return is_pdo_record(index) && PdoRecord::of(index).mapping;
}
/// The communication record of the PDO: the record itself, or the one that belongs to this mapping record.
[[nodiscard]] constexpr std::uint16_t communication_of(std::uint16_t record) noexcept {
  return communication_index(PdoRecord::of(record).kind, PdoRecord::of(record).number);
}
[[nodiscard]] constexpr std::uint16_t mapping_of(std::uint16_t communication) noexcept {
  return static_cast<std::uint16_t>(communication + to_mapping);
}
[[nodiscard]] constexpr bool is_pdo_communication(std::uint16_t index) noexcept {
  return is_pdo_record(index) && !PdoRecord::of(index).mapping;
}

/// Sub-indices of a communication record.
namespace pdo_sub {
inline constexpr std::uint8_t cob_id = 1, type = 2, inhibit = 3, reserved = 4, timer = 5, sync_start = 6;
}

// ---- contents of the records

/// Meaning of sub-index 0 of a mapping record: a number of entries, FEh or FFh.
enum class PdoMode : std::uint8_t { mapped, sam, dam };
[[nodiscard]] constexpr PdoMode mode_of(std::uint8_t count) noexcept {
  return count == 0xFE ? PdoMode::sam : count == 0xFF ? PdoMode::dam : PdoMode::mapped;
}

/// Types 00h..F0h, acyclic and cyclic.
[[nodiscard]] constexpr bool synchronous(std::uint8_t type) noexcept { return type <= 0xF0; }
[[nodiscard]] constexpr bool event_driven(std::uint8_t type) noexcept { return type >= 0xFE; }
inline constexpr std::uint8_t rtr_sampled_at_sync = 0xFC;
inline constexpr std::uint8_t rtr_only = 0xFD;

/// The content of the two records of one PDO. Missing records read as a PDO that is not valid and maps nothing.
struct PdoParameters {
  CobId cob_id;
  std::uint8_t type = 0xFF;
  std::uint16_t inhibit = 0;           ///< units of 100 us
  std::uint16_t timer = 0;             ///< event timer or deadline, ms
  std::uint8_t count = 0;              ///< sub-index 0 of the mapping record
  std::vector<PdoEntry> entries = {};  ///< `count` of them; none if `count` is above 64: an MPDO, or a fault

  [[nodiscard]] bool is_mpdo() const noexcept { return mode_of(count) != PdoMode::mapped; }
  /// Bits of all entries; more than 64 is a fault of the device.
  [[nodiscard]] unsigned bits() const noexcept;
  [[nodiscard]] bool maps(ObjectRef object) const noexcept;
};

/// Requests the values of one PDO, one after another.
class PdoReader {
 public:
  enum class Scope : std::uint8_t { all, layout };  ///< `layout`: COB-ID and mapping only
  /// `number`: 1 to 512.
  PdoReader(PdoKind kind, unsigned number, Scope scope = Scope::all) noexcept
      : kind_(kind), number_(number), scope_(scope) {}

  /// The object whose value is needed; empty: `parameters` is complete.
  [[nodiscard]] std::optional<ObjectRef> next() const noexcept;
  /// The value of `next()`; empty: there is none.
  void give(std::optional<std::uint32_t> value);
  [[nodiscard]] const PdoParameters& parameters() const noexcept { return parameters_; }

 private:
  static constexpr std::uint8_t mapping_step = 4;  // after the four sub-indices of the communication record
  PdoKind kind_;
  unsigned number_;
  Scope scope_;
  std::uint8_t step_ = 0;
  PdoParameters parameters_;
};

/// Calls `visit(number)` in ascending order for the PDOs of this kind that have a communication record.
template <class Visit>
void for_each_communication(const Description& description, PdoKind kind, Visit&& visit) {
  const auto objects = description.objects();
  const auto first = communication_index(kind, 1);
  const auto last = communication_index(kind, most_pdos);
  for (auto it = std::ranges::lower_bound(objects, first, {}, &Object::index); it != objects.end(); ++it) {
    if (it->index > last) return;
    visit(unsigned{PdoRecord::of(it->index).number});
  }
}

/// From the current values.
[[nodiscard]] PdoParameters read_pdo(const StoredValues& values, PdoKind kind, unsigned number);

}  // namespace berth::od
