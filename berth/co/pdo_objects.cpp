// The records 1400h..1BFFh: which writes are let in, and what they change.
#include <array>

#include "berth/co/pdo.hpp"
#include "berth/co/pdo_parts.hpp"

namespace berth::co {
namespace {

struct Record {
  PdoKind kind;
  bool mapping;
  std::uint16_t number;
};

constexpr Record record_of(std::uint16_t index) noexcept {
  const unsigned at = index - 0x1400U;
  return {at < 0x400 ? PdoKind::rpdo : PdoKind::tpdo, at % 0x400 >= 0x200, static_cast<std::uint16_t>(at % 0x200 + 1)};
}

constexpr std::uint8_t cob_id_sub = 1, type_sub = 2, inhibit_sub = 3, reserved_sub = 4, timer_sub = 5, start_sub = 6;
constexpr std::uint32_t most_sync_counter = 240;

}  // namespace

CobId Pdos::cob_id(PdoKind kind, unsigned number) const noexcept {
  return CobId(values_->get_or<std::uint32_t>({communication_index(kind, number), cob_id_sub}, CobId::invalid_bit));
}

std::uint8_t Pdos::type(PdoKind kind, unsigned number) const noexcept {
  return values_->get_or<std::uint8_t>({communication_index(kind, number), type_sub}, 0xFF);
}

std::uint8_t Pdos::mapped(PdoKind kind, unsigned number) const noexcept {
  return values_->get_or<std::uint8_t>({mapping_index(kind, number), 0}, 0);
}

PdoMode Pdos::mode_of(std::uint8_t count) noexcept {
  if (count == sam_mapping) return PdoMode::sam;
  return count == dam_mapping ? PdoMode::dam : PdoMode::mapped;
}

bool Pdos::usable_type(PdoKind kind, std::uint8_t type, std::uint8_t count) noexcept {
  if (event_driven(type)) return true;
  if (mode_of(count) != PdoMode::mapped) return false;
  return synchronous(type) || (kind == PdoKind::tpdo && (type == rtr_sampled_at_sync || type == rtr_only));
}

// FCh and FDh are sent on remote frames alone, which bit 30 of the COB-ID forbids.
bool Pdos::contradicts(PdoKind kind, CobId cob, std::uint8_t type) noexcept {
  const bool on_request = type == rtr_sampled_at_sync || type == rtr_only;
  return kind == PdoKind::tpdo && on_request && cob.valid() && (cob.raw() & CobId::second_bit) != 0;
}

bool Pdos::other_producer(unsigned number) const noexcept {
  for (const Tpdo& pdo : tpdos()) {
    if (pdo.number != number && mode_of(mapped(PdoKind::tpdo, pdo.number)) != PdoMode::mapped) return true;
  }
  return false;
}

od::AbortCode Pdos::resolve(PdoKind kind, unsigned number, std::uint8_t count, PdoMapping& mapping) const noexcept {
  const std::uint16_t record = mapping_index(kind, number);
  const od::Object* const object = values_->description().find(record);
  if (count > PdoMapping::most_entries || object == nullptr || count >= object->count) {
    mapping.clear();
    return count == 0 ? od::AbortCode::none : od::AbortCode::pdo_length;
  }
  std::array<std::uint32_t, PdoMapping::most_entries> entries;
  for (unsigned i = 0; i < count; ++i) {
    entries[i] = values_->get_or<std::uint32_t>({record, static_cast<std::uint8_t>(i + 1)}, 0);
  }
  return mapping.resolve(values_->description(), std::span(entries).first(count), kind);
}

od::AbortCode Pdos::check_count(PdoKind kind, unsigned number, std::uint8_t count) const noexcept {
  if (mode_of(count) != PdoMode::mapped) {
    const bool second = kind == PdoKind::tpdo && other_producer(number);
    return second || !event_driven(type(kind, number)) ? od::AbortCode::parameter_incompatible : od::AbortCode::none;
  }
  std::array<PdoField, PdoMapping::most_entries> room;
  PdoMapping mapping(room);
  return resolve(kind, number, count, mapping);
}

od::AbortCode Pdos::problem(PdoKind kind, unsigned number) const noexcept {
  const od::Description& d = values_->description();
  if (number < 1 || number > most_pdos || d.find(communication_index(kind, number)) == nullptr ||
      d.find(mapping_index(kind, number)) == nullptr) {
    return od::AbortCode::no_object;
  }
  const std::uint8_t count = mapped(kind, number);
  const CobId cob = cob_id(kind, number);
  const bool fine = (!cob.valid() || cob.allowed()) && usable_type(kind, type(kind, number), count);
  return fine ? check_count(kind, number, count) : od::AbortCode::invalid_value;
}

od::AbortCode Pdos::reading(const od::Values&, ObjectRef ref, std::span<const std::uint8_t>&) noexcept {
  const bool reserved = !record_of(ref.index).mapping && ref.sub == reserved_sub;
  return reserved ? od::AbortCode::no_sub_index : od::AbortCode::none;
}

od::AbortCode Pdos::writing(const od::Values&, ObjectRef ref, std::span<const std::uint8_t> value) noexcept {
  const Record record = record_of(ref.index);
  std::uint64_t raw = 0;
  for (std::size_t i = 0; i < value.size() && i < 8; ++i) raw |= std::uint64_t{value[i]} << (8 * i);
  if (raw > 0xFFFF'FFFFU) return od::AbortCode::invalid_value;  // described with another type than CiA 301's
  const auto number = static_cast<std::uint32_t>(raw);
  return record.mapping ? writing_mapping(record.kind, record.number, ref.sub, number)
                        : writing_communication(record.kind, record.number, ref.sub, number);
}

od::AbortCode Pdos::writing_communication(PdoKind kind, unsigned number, std::uint8_t sub,
                                          std::uint32_t value) const noexcept {
  const std::uint16_t record = communication_index(kind, number);
  const auto frozen = [&] {
    return cob_id(kind, number).valid() && values_->get_or<std::uint32_t>({record, sub}, 0) != value;
  };
  switch (sub) {
    case cob_id_sub: return writing_cob_id(kind, number, value);
    case type_sub:
      if (value > 0xFF) return od::AbortCode::invalid_value;
      return writing_type(kind, number, static_cast<std::uint8_t>(value));
    case inhibit_sub: return frozen() ? od::AbortCode::invalid_value : od::AbortCode::none;
    case reserved_sub: return od::AbortCode::no_sub_index;
    case start_sub: return frozen() || value > most_sync_counter ? od::AbortCode::invalid_value : od::AbortCode::none;
    default: return od::AbortCode::none;
  }
}

od::AbortCode Pdos::writing_type(PdoKind kind, unsigned number, std::uint8_t value) const noexcept {
  const bool same = type(kind, number) == value;
  const bool fine =
      usable_type(kind, value, mapped(kind, number)) && (same || !contradicts(kind, cob_id(kind, number), value));
  return fine ? od::AbortCode::none : od::AbortCode::invalid_value;
}

od::AbortCode Pdos::writing_cob_id(PdoKind kind, unsigned number, std::uint32_t value) const noexcept {
  const CobId before = cob_id(kind, number);
  const CobId after(value);
  if (!after.well_formed()) return od::AbortCode::invalid_value;
  if (!after.valid() || after == before) return od::AbortCode::none;
  if (contradicts(kind, after, type(kind, number))) return od::AbortCode::invalid_value;
  if (before.valid()) return before.same_identifier(after) ? od::AbortCode::none : od::AbortCode::invalid_value;
  if (!after.allowed()) return od::AbortCode::invalid_value;
  const std::uint8_t count = mapped(kind, number);
  if (!usable_type(kind, type(kind, number), count)) return od::AbortCode::invalid_value;
  return check_count(kind, number, count);
}

od::AbortCode Pdos::writing_mapping(PdoKind kind, unsigned number, std::uint8_t sub,
                                    std::uint32_t value) const noexcept {
  if (cob_id(kind, number).valid()) return od::AbortCode::unsupported_access;
  if (sub == 0) return value > 0xFF ? od::AbortCode::pdo_length : check_count(kind, number, std::uint8_t(value));
  if (mapped(kind, number) != 0) return od::AbortCode::unsupported_access;
  return value == 0 ? od::AbortCode::none : check_entry(values_->description(), PdoEntry::of(value), kind);
}

// Only what may change while a PDO is valid, or what makes it valid or invalid, has an effect now.
void Pdos::written(od::Values&, ObjectRef ref) noexcept {
  const Record record = record_of(ref.index);
  if (!running_ || record.mapping) return;
  if (record.kind == PdoKind::rpdo) {
    Rpdo* const pdo = find(rpdos(), record.number);
    if (pdo == nullptr) return;
    if (ref.sub == timer_sub) return set_deadline(*pdo, values_->get_or<std::uint16_t>(ref, 0));
    if (ref.sub == cob_id_sub || ref.sub == type_sub) configure(*pdo);
    return;
  }
  Tpdo* const pdo = find(tpdos(), record.number);
  if (pdo == nullptr) return;
  if (ref.sub == timer_sub) return set_event_time(*pdo, values_->get_or<std::uint16_t>(ref, 0));
  if (ref.sub != cob_id_sub && ref.sub != type_sub) return;
  configure(*pdo);
  listen();
}

}  // namespace berth::co
