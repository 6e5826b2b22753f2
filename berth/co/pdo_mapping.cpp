#include "berth/co/pdo_mapping.hpp"

namespace berth::co {
namespace {

constexpr std::uint16_t last_data_type = 0x1B;

bool allowed(od::Access access, PdoKind kind) noexcept {
  if (kind == PdoKind::tpdo) return od::readable(access) && access != od::Access::rww;
  return od::writable(access) && access != od::Access::rwr;
}

bool may_be_dummy(const od::Description& description, PdoEntry entry, PdoKind kind) noexcept {
  return kind == PdoKind::rpdo && entry.object.sub == 0 && entry.bits != 0 &&
         description.dummy_mappable(entry.object.index) &&
         entry.bits == od::bit_length(static_cast<od::DataType>(entry.object.index));
}

constexpr std::uint64_t mask(unsigned bits) noexcept { return ~std::uint64_t{0} >> (64 - bits); }

std::uint64_t load_bytes(const std::uint8_t* from, unsigned bytes) noexcept {
  std::uint64_t value = 0;
  for (unsigned i = 0; i < bytes; ++i) value |= std::uint64_t{from[i]} << (8 * i);
  return value;
}

void store_bytes(std::uint8_t* to, std::uint64_t value, unsigned bytes) noexcept {
  for (unsigned i = 0; i < bytes; ++i) to[i] = static_cast<std::uint8_t>(value >> (8 * i));
}

}  // namespace

od::AbortCode check_entry(const od::Description& description, PdoEntry entry, PdoKind kind) noexcept {
  if (entry.object.index != 0 && entry.object.index <= last_data_type) {
    return may_be_dummy(description, entry, kind) ? od::AbortCode::none : od::AbortCode::not_mappable;
  }
  const od::SubObject* const sub = description.find(entry.object);
  if (sub == nullptr) return od::AbortCode::no_object;
  const bool fits = sub->mappable && allowed(sub->access, kind) && entry.bits != 0 &&
                    entry.bits == od::bit_length(sub->type) && sub->offset <= PdoField::most_offset;
  return fits ? od::AbortCode::none : od::AbortCode::not_mappable;
}

od::AbortCode PdoMapping::resolve(const od::Description& description, std::span<const std::uint32_t> entries,
                                  PdoKind kind) noexcept {
  clear();
  bytewise_ = true;
  if (entries.size() > most_entries) return od::AbortCode::pdo_length;
  unsigned bits = 0;
  unsigned count = 0;
  for (const std::uint32_t raw : entries) {
    const auto entry = PdoEntry::of(raw);
    if (const auto code = check_entry(description, entry, kind); code != od::AbortCode::none) return code;
    if (bits + entry.bits > most_bits) return od::AbortCode::pdo_length;
    bits += entry.bits;
    if (entry.bits % 8 != 0) bytewise_ = false;
    const bool dummy = entry.object.index <= last_data_type;
    fields_[count++] = PdoField(dummy ? PdoField::nowhere : description.find(entry.object)->offset, entry.bits);
  }
  bits_ = static_cast<std::uint8_t>(bits);
  count_ = static_cast<std::uint8_t>(count);
  if (bytewise_) join();
  return od::AbortCode::none;
}

// Objects that are neighbours both in the PDO and in memory become one field.
void PdoMapping::join() noexcept {
  unsigned last = 0;
  for (unsigned i = 1; i < count_; ++i) {
    PdoField& before = fields_[last];
    const PdoField next = fields_[i];
    const bool neighbours = !before.dummy() && !next.dummy() && before.offset() + before.bytes() == next.offset();
    if (neighbours) {
      before = PdoField(before.offset(), before.bits() + next.bits());
    } else {
      fields_[++last] = next;
    }
  }
  if (count_ != 0) count_ = static_cast<std::uint8_t>(last + 1);
}

bool PdoMapping::contains(std::uint32_t offset) const noexcept {
  for (const PdoField field : fields()) {
    if (!field.dummy() && offset >= field.offset() && offset < field.offset() + field.bytes()) return true;
  }
  return false;
}

void PdoMapping::pack_bits(const std::uint8_t* base, std::uint8_t* into) const noexcept {
  std::uint64_t all = 0;
  unsigned at = 0;
  for (const PdoField field : fields()) {
    if (!field.dummy()) all |= (load_bytes(base + field.offset(), field.bytes()) & mask(field.bits())) << at;
    at += field.bits();
  }
  store_bytes(into, all, size());
}

void PdoMapping::unpack_bits(std::uint8_t* base, const std::uint8_t* from) const noexcept {
  const std::uint64_t all = load_bytes(from, size());
  unsigned at = 0;
  for (const PdoField field : fields()) {
    if (!field.dummy()) store_bytes(base + field.offset(), (all >> at) & mask(field.bits()), field.bytes());
    at += field.bits();
  }
}

}  // namespace berth::co
