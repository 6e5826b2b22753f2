/// The records of PDOs in an object dictionary, 1400h..1BFFh (CiA 301 §7.5.2.33 to §7.5.2.38): their content, and
/// which writes are allowed (`Pdos` lists the rules).
#pragma once

#include "berth/co/cob_id.hpp"
#include "berth/co/pdo_mapping.hpp"
#include "berth/od/values.hpp"

namespace berth::co {

using od::communication_index;
using od::event_driven;
using od::mapping_index;
using od::mode_of;
using od::most_pdos;
using od::PdoMode;
using od::PdoRecord;
using od::rtr_only;
using od::rtr_sampled_at_sync;
using od::synchronous;
namespace pdo_sub = od::pdo_sub;

/// True if a PDO of this kind with `count` in sub-index 0 of its mapping record may have this type.
[[nodiscard]] constexpr bool usable_type(PdoKind kind, std::uint8_t type, std::uint8_t count) noexcept {
  if (event_driven(type)) return true;
  if (mode_of(count) != PdoMode::mapped) return false;
  return synchronous(type) || (kind == PdoKind::tpdo && (type == rtr_sampled_at_sync || type == rtr_only));
}

/// Calls `visit(number, entries)` in ascending order for the PDOs of this kind that have both records; `entries`: how
/// many the mapping record has room for.
template <class Visit>
void for_each_pdo(const od::Description& description, PdoKind kind, Visit&& visit) {
  for (const od::Object& object : description.objects()) {
    const unsigned number = object.index - communication_index(kind, 0U);
    if (number < 1 || number > most_pdos) continue;
    const od::Object* const mapping = description.find(mapping_index(kind, number));
    if (mapping == nullptr) continue;
    const auto room = std::min<std::size_t>(mapping->count > 0 ? mapping->count - 1U : 0U, PdoMapping::most_entries);
    visit(static_cast<std::uint16_t>(number), static_cast<std::uint32_t>(room));
  }
}

/// The two records of one PDO; a view of the values. Missing records read as a PDO that is not valid.
class PdoRecords {
 public:
  PdoRecords(const od::Values& values, PdoKind kind, unsigned number) noexcept
      : values_(&values), kind_(kind), number_(static_cast<std::uint16_t>(number)) {}

  [[nodiscard]] CobId cob_id() const noexcept;
  [[nodiscard]] std::uint8_t type() const noexcept;
  /// Inhibit time (sub-index 3, units of 100 us) or event timer (5, ms).
  [[nodiscard]] std::uint16_t time(std::uint8_t sub) const noexcept;
  [[nodiscard]] std::uint8_t sync_start() const noexcept;
  /// Sub-index 0 of the mapping record.
  [[nodiscard]] std::uint8_t mapped() const noexcept;
  [[nodiscard]] PdoMode mode() const noexcept { return mode_of(mapped()); }
  /// True when valid, with an identifier that a PDO may have and a type that fits.
  [[nodiscard]] bool usable() const noexcept;
  /// Resolves the first `count` entries into `mapping`.
  [[nodiscard]] od::AbortCode resolve(std::uint8_t count, PdoMapping& mapping) const noexcept;
  /// TPDOs: true when another TPDO is an MPDO producer, too.
  [[nodiscard]] bool other_producer() const noexcept;

  /// Why the records cannot be used, valid or not; no_object when one of them does not exist.
  [[nodiscard]] od::AbortCode problem() const noexcept;
  /// Checks a write from the network to a sub-index of the communication record or the mapping record.
  [[nodiscard]] od::AbortCode writing_communication(std::uint8_t sub, std::uint32_t value) const noexcept;
  [[nodiscard]] od::AbortCode writing_mapping(std::uint8_t sub, std::uint32_t value) const noexcept;

 private:
  [[nodiscard]] od::AbortCode writing_type(std::uint8_t value) const noexcept;
  [[nodiscard]] od::AbortCode writing_cob_id(std::uint32_t value) const noexcept;
  [[nodiscard]] od::AbortCode check_count(std::uint8_t count) const noexcept;

  const od::Values* values_;
  PdoKind kind_;
  std::uint16_t number_;
};

}  // namespace berth::co
