#include "berth/co/pdo_records.hpp"

#include <array>

namespace berth::co {
namespace {

constexpr std::uint32_t most_sync_counter = 240;

// PDOs of types FCh and FDh are sent only on a remote frame, which bit 30 of the COB-ID forbids.
bool contradicts(PdoKind kind, CobId cob, std::uint8_t type) noexcept {
  const bool on_request = type == rtr_sampled_at_sync || type == rtr_only;
  return kind == PdoKind::tpdo && on_request && cob.valid() && (cob.raw() & CobId::second_bit) != 0;
}

}  // namespace

CobId PdoRecords::cob_id() const noexcept {
  return CobId(
      values_->get_or<std::uint32_t>({communication_index(kind_, number_), pdo_sub::cob_id}, CobId::invalid_bit));
}

std::uint8_t PdoRecords::type() const noexcept {
  return values_->get_or<std::uint8_t>({communication_index(kind_, number_), pdo_sub::type}, 0xFF);
}

std::uint16_t PdoRecords::time(std::uint8_t sub) const noexcept {
  return values_->get_or<std::uint16_t>({communication_index(kind_, number_), sub}, 0);
}

std::uint8_t PdoRecords::sync_start() const noexcept {
  return values_->get_or<std::uint8_t>({communication_index(kind_, number_), pdo_sub::sync_start}, 0);
}

std::uint8_t PdoRecords::mapped() const noexcept {
  return values_->get_or<std::uint8_t>({mapping_index(kind_, number_), 0}, 0);
}

bool PdoRecords::usable() const noexcept {
  const CobId cob = cob_id();
  return cob.valid() && cob.allowed() && usable_type(kind_, type(), mapped());
}

bool PdoRecords::other_producer() const noexcept {
  bool other = false;
  for_each_pdo(values_->description(), PdoKind::tpdo, [&](unsigned number, std::uint32_t) {
    if (number != number_ && PdoRecords(*values_, PdoKind::tpdo, number).mode() != PdoMode::mapped) other = true;
  });
  return other;
}

od::AbortCode PdoRecords::resolve(std::uint8_t count, PdoMapping& mapping) const noexcept {
  const std::uint16_t record = mapping_index(kind_, number_);
  const od::Object* const object = values_->description().find(record);
  if (count > PdoMapping::most_entries || object == nullptr || count >= object->count) {
    mapping.clear();
    return count == 0 ? od::AbortCode::none : od::AbortCode::pdo_length;
  }
  std::array<std::uint32_t, PdoMapping::most_entries> entries;
  for (unsigned i = 0; i < count; ++i) {
    entries[i] = values_->get_or<std::uint32_t>({record, static_cast<std::uint8_t>(i + 1)}, 0);
  }
  return mapping.resolve(values_->description(), std::span(entries).first(count), kind_);
}

od::AbortCode PdoRecords::check_count(std::uint8_t count) const noexcept {
  if (mode_of(count) != PdoMode::mapped) {
    const bool second = kind_ == PdoKind::tpdo && other_producer();
    return second || !event_driven(type()) ? od::AbortCode::parameter_incompatible : od::AbortCode::none;
  }
  std::array<PdoField, PdoMapping::most_entries> room;
  PdoMapping mapping(room);
  return resolve(count, mapping);
}

od::AbortCode PdoRecords::problem() const noexcept {
  const od::Description& d = values_->description();
  if (number_ < 1 || number_ > most_pdos || d.find(communication_index(kind_, number_)) == nullptr ||
      d.find(mapping_index(kind_, number_)) == nullptr) {
    return od::AbortCode::no_object;
  }
  const CobId cob = cob_id();
  const bool fine = (!cob.valid() || cob.allowed()) && usable_type(kind_, type(), mapped());
  return fine ? check_count(mapped()) : od::AbortCode::invalid_value;
}

od::AbortCode PdoRecords::writing_communication(std::uint8_t sub, std::uint32_t value) const noexcept {
  const std::uint16_t record = communication_index(kind_, number_);
  const auto frozen = [&] { return cob_id().valid() && values_->get_or<std::uint32_t>({record, sub}, 0) != value; };
  switch (sub) {
    case pdo_sub::cob_id: return writing_cob_id(value);
    case pdo_sub::type:
      if (value > 0xFF) return od::AbortCode::invalid_value;
      return writing_type(static_cast<std::uint8_t>(value));
    case pdo_sub::inhibit: return frozen() ? od::AbortCode::invalid_value : od::AbortCode::none;
    case pdo_sub::reserved: return od::AbortCode::no_sub_index;
    case pdo_sub::sync_start:
      return frozen() || value > most_sync_counter ? od::AbortCode::invalid_value : od::AbortCode::none;
    default: return od::AbortCode::none;
  }
}

od::AbortCode PdoRecords::writing_type(std::uint8_t value) const noexcept {
  const bool same = type() == value;
  const bool fine = usable_type(kind_, value, mapped()) && (same || !contradicts(kind_, cob_id(), value));
  return fine ? od::AbortCode::none : od::AbortCode::invalid_value;
}

od::AbortCode PdoRecords::writing_cob_id(std::uint32_t value) const noexcept {
  const CobId before = cob_id();
  const CobId after(value);
  if (!after.well_formed()) return od::AbortCode::invalid_value;
  if (!after.valid() || after == before) return od::AbortCode::none;
  if (contradicts(kind_, after, type())) return od::AbortCode::invalid_value;
  if (before.valid()) return before.same_identifier(after) ? od::AbortCode::none : od::AbortCode::invalid_value;
  if (!after.allowed()) return od::AbortCode::invalid_value;
  if (!usable_type(kind_, type(), mapped())) return od::AbortCode::invalid_value;
  return check_count(mapped());
}

od::AbortCode PdoRecords::writing_mapping(std::uint8_t sub, std::uint32_t value) const noexcept {
  if (cob_id().valid()) return od::AbortCode::unsupported_access;
  if (sub == 0) return value > 0xFF ? od::AbortCode::pdo_length : check_count(std::uint8_t(value));
  if (mapped() != 0) return od::AbortCode::unsupported_access;
  return value == 0 ? od::AbortCode::none : check_entry(values_->description(), PdoEntry::of(value), kind_);
}

}  // namespace berth::co
