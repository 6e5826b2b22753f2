// PDO parameters and their mappings: CiA 301 §7.5.2.35 to §7.5.2.38.
#include "berth/co/pdo_mapping.hpp"
#include "berth/doctor/conformance_parts.hpp"

namespace berth::doctor {
namespace {

using co::CobId;

bool tpdo(std::uint16_t index) noexcept { return od::PdoRecord::of(index).kind == od::PdoKind::tpdo; }

}  // namespace

rt::Task<void> PdoChecks::run() {
  if (!options_.description) co_return;
  for (const auto& object : options_.description->objects()) {
    if (od::is_pdo_communication(object.index)) co_await pdo(object.index);
  }
}

rt::Task<void> PdoChecks::pdo(std::uint16_t index) {
  const auto paragraph = paragraph_of(index);
  const auto told = co_await device_.read(index, 1);
  report_.holds(paragraph, {index, 1}, "the COB-ID is there, four bytes", told.good() && told.bytes.size() == 4,
                told.words());
  const CobId now(static_cast<std::uint32_t>(told.number()));
  const auto reserved = co_await device_.read(index, 4);
  report_.refused(paragraph, {index, 4}, "the reserved sub-index 4", reserved, codes::no_sub);
  if (described_.settable(index, 1, 4)) {
    co_await must_refuse(index, 1, 4, malformed_bit | 0x181U, codes::bad_cob_id, "bit 11 of an 11-bit identifier");
    co_await must_refuse(index, 1, 4, CobId::invalid_bit | malformed_bit | 0x181U, codes::bad_cob_id,
                         "the same, not valid");
    for (const auto id : restricted) {
      co_await must_refuse(index, 1, 4, id, codes::bad_cob_id, "a restricted CAN-ID");
    }
    if (now.valid()) {
      co_await must_refuse(index, 1, 4, now.raw() ^ 0x04U, codes::frozen, "another CAN-ID while the PDO is valid");
    }
  }
  if (described_.settable(index, 2, 1)) {
    for (const unsigned type : std::array<unsigned, 2>{0xF1, 0xFB}) {
      co_await must_refuse(index, 2, 1, type, codes::bad_value, "a reserved transmission type");
    }
    const bool no_rtr = now.valid() && (now.raw() & CobId::second_bit) != 0;
    for (const unsigned type : std::array<unsigned, 2>{0xFC, 0xFD}) {
      if (!tpdo(index)) co_await must_refuse(index, 2, 1, type, codes::bad_value, "a TPDO's transmission type");
      if (tpdo(index) && no_rtr) {
        co_await must_refuse(index, 2, 1, type, codes::bad_value, "a type for remote frames, which bit 30 forbids");
      }
    }
  }
  if (tpdo(index) && now.valid() && described_.settable(index, 3, 2)) {
    const auto inhibit = co_await device_.read(index, 3);
    co_await must_refuse(index, 3, 2, inhibit.number() ^ 1U, codes::frozen, "another inhibit time while it is valid");
  }
  if (tpdo(index) && described_.settable(index, 6, 1)) {
    co_await must_refuse(index, 6, 1, 241, codes::bad_value, "a SYNC start value above 240");
  }
  co_await mapping(index);
}

// §7.5.2.36: the order of re-mapping, and what each step refuses.
rt::Task<void> PdoChecks::mapping(std::uint16_t index) {
  const auto record = od::mapping_of(index);
  const auto told = co_await device_.read(index, 1);
  const auto before = co_await device_.read(record, 0);
  if (!told.good() || !before.good() || !described_.settable(record, 0, 1)) co_return;
  const CobId cob(static_cast<std::uint32_t>(told.number()));
  const auto paragraph = paragraph_of(record);
  if (cob.valid()) {
    const auto count = co_await device_.write(record, 0, before.bytes);
    report_.refused(paragraph, {record, 0}, "a mapping while the PDO is valid", count, codes::mapping_frozen);
  }
  if (!options_.lasting || !described_.settable(index, 1, 4) || !described_.settable(record, 1, 4)) co_return;
  const auto first = co_await device_.read(record, 1);
  const auto off = co_await device_.write_number(index, 1, 4, cob.raw() | CobId::invalid_bit);
  report_.granted(paragraph_of(index), {index, 1}, "bit 31 makes the PDO invalid", off);
  if (before.number() != 0 && before.number() <= co::PdoMapping::most_entries) {
    const auto entry = co_await device_.write(record, 1, first.bytes);
    report_.refused(paragraph, {record, 1}, "an entry while sub-index 0 is not 0", entry, codes::mapping_frozen);
  }
  const auto none = co_await device_.write_number(record, 0, 1, 0);
  report_.granted(paragraph, {record, 0}, "0 ends the mapping", none);
  const std::uint64_t missing = static_cast<std::uint32_t>(described_.absent()) << 16U | 8U;
  const auto nothing = co_await device_.write_number(record, 1, 4, missing);
  report_.refused(paragraph, {record, 1}, "an object that does not exist", nothing, codes::not_mappable);
  const auto type = co_await device_.write_number(record, 1, 4, 0x1000'0020U);
  report_.refused(paragraph, {record, 1}, "an object that cannot be mapped", type, codes::not_mappable);
  const auto beyond = co_await device_.write_number(record, 0, 1, 65);
  report_.refused(paragraph, {record, 0}, "65 entries", beyond, codes::pdo_length);
  const auto again = co_await device_.write(record, 1, first.bytes);
  if (!again.good() && !described_.mappable(static_cast<std::uint32_t>(first.number()))) {
    report_.skip(paragraph, {record, 1}, "the mapping comes back",
                 "its default maps what the description does not have");
    co_return;
  }
  report_.granted(paragraph, {record, 1}, "the entry comes back", again);
  const auto counted = co_await device_.write(record, 0, before.bytes);
  report_.granted(paragraph, {record, 0}, "the mapping comes back", counted);
  const auto on = co_await device_.write(index, 1, told.bytes);
  report_.granted(paragraph_of(index), {index, 1}, "the PDO comes back", on);
}

}  // namespace berth::doctor
