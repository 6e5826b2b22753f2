#include "berth/manager/list_store.hpp"

#include <array>
#include <string>

#include "berth/base/bytes.hpp"
#include "berth/base/crc.hpp"

namespace berth::manager {
namespace {

constexpr std::size_t head_size = 6;
constexpr std::size_t crc_size = 4;
constexpr std::size_t row_size = 18;
constexpr unsigned unknown_shift = 4;
constexpr unsigned kind_mask = 0xF;
constexpr bool keeps_history = false;

enum class RowKind : std::uint8_t { intended = 1, confirmed = 2, former = 3 };

void put_row(std::vector<std::uint8_t>& rows, NodeId node, RowKind kind, const Identity& device) {
  const std::size_t at = rows.size();
  rows.resize(at + row_size);
  rows[at] = node.value();
  rows[at + 1] = static_cast<std::uint8_t>(static_cast<unsigned>(kind) | unsigned{device.unknown} << unknown_shift);
  for (unsigned part = 0; part < 4; ++part)
    store_le(rows.data() + at + 2 + std::size_t{4} * part, device.address.part(part));
}

}  // namespace

ListStore::ListStore(ListMemory* memory) : MemoryStore(keeps_history), memory_(memory) { reload(); }

// ---- reading --------------------------------------------------------------------------------------------------------

void ListStore::reload() {
  static_cast<MemoryStore&>(*this) = MemoryStore(keeps_history);
  // In this order, so that a slot's number is its node-ID.
  for (unsigned node = 1; node <= 127; ++node) static_cast<void>(declare({{}, {}, std::to_string(node)}));
  sequence_ = 0;
  copy_ = 1;
  if (memory_ == nullptr) return;
  std::array<std::vector<std::uint8_t>, 2> rows;
  std::array<std::uint32_t, 2> sequence{};
  const bool first = read_copy(0, rows[0], sequence[0]);
  const bool second = read_copy(1, rows[1], sequence[1]);
  if (!first && !second) return;
  // Newer by distance, so that the sequence number may wrap.
  copy_ = second && (!first || static_cast<std::int32_t>(sequence[1] - sequence[0]) > 0) ? 1 : 0;
  sequence_ = sequence[copy_];
  take(rows[copy_]);
}

bool ListStore::read_copy(unsigned copy, std::vector<std::uint8_t>& rows, std::uint32_t& sequence) const {
  const std::size_t at = copy * copy_size();
  std::array<std::uint8_t, head_size> head{};
  memory_->read(at, head);
  sequence = load_le<std::uint32_t>(head.data());
  const std::size_t length = load_le<std::uint16_t>(head.data() + 4);
  if (length % row_size != 0 || head_size + length + crc_size > copy_size()) return false;
  rows.resize(length);
  memory_->read(at + head_size, rows);
  std::array<std::uint8_t, crc_size> crc{};
  memory_->read(at + head_size + length, crc);
  return load_le<std::uint32_t>(crc.data()) == crc32(rows, crc32(head));
}

void ListStore::take(std::span<const std::uint8_t> rows) {
  for (; rows.size() >= row_size; rows = rows.subspan(row_size)) {
    const auto number = [&](unsigned part) { return load_le<std::uint32_t>(rows.data() + 2 + 4 * part); };
    const auto node = NodeId::make(rows[0]);
    const auto kind = static_cast<RowKind>(rows[1] & kind_mask);
    if (!node) continue;
    Identity device{number(0), number(1), number(2), number(3)};
    device.unknown = static_cast<std::uint8_t>(rows[1] >> unknown_shift);
    device = device.with(*node);
    if (kind == RowKind::former) static_cast<void>(MemoryStore::ask_blank({device, {}, {}, *node}, {}));
    if (kind == RowKind::former || !node->configured()) continue;
    const places::Assignment seat{device, *node};
    const auto asked = MemoryStore::ask(slot_of(*node), seat, {});
    if (asked && kind == RowKind::confirmed) static_cast<void>(MemoryStore::confirm(slot_of(*node), seat, {}));
  }
}

// ---- writing --------------------------------------------------------------------------------------------------------

// Confirmed rows come before intended ones, so that `take` can read the rows in order.
std::vector<std::uint8_t> ListStore::image() {
  std::vector<std::uint8_t> bytes;
  bytes.resize(head_size);
  const auto former = unfinished_blanks();
  if (former) {
    for (const auto& each : *former) put_row(bytes, each.id, RowKind::former, each.device);
  }
  const auto slots = MemoryStore::load(std::string_view());
  if (slots) {
    for (const auto& each : *slots) {
      if (each.confirmed) put_row(bytes, each.confirmed->id, RowKind::confirmed, each.confirmed->device);
      if (each.intended) put_row(bytes, each.intended->id, RowKind::intended, each.intended->device);
    }
  }
  const std::size_t end = bytes.size();
  store_le(bytes.data(), sequence_ + 1);
  store_le(bytes.data() + 4, static_cast<std::uint16_t>(end - head_size));
  const std::uint32_t crc = crc32(bytes);
  bytes.resize(end + crc_size);
  store_le(bytes.data() + end, crc);
  return bytes;
}

Result<void> ListStore::kept(Result<void> done) {
  if (!done || memory_ == nullptr) return done;
  const auto bytes = image();
  const unsigned other = 1 - copy_;
  const bool written = bytes.size() <= copy_size() && memory_->write(other * copy_size(), bytes);
  if (!written) {
    reload();
    return fail(Errc::io, "the memory for the network list's node-IDs was not written");
  }
  copy_ = other;
  ++sequence_;
  ++writes_;
  return {};
}

Result<void> ListStore::ask(places::SlotId slot, const places::Assignment& seat, std::string_view reason) {
  return kept(MemoryStore::ask(slot, seat, reason));
}

Result<void> ListStore::confirm(places::SlotId slot, const places::Assignment& seat, std::string_view reason) {
  return kept(MemoryStore::confirm(slot, seat, reason));
}

Result<void> ListStore::clear(places::SlotId slot, std::string_view reason) {
  return kept(MemoryStore::clear(slot, reason));
}

Result<void> ListStore::ask_blank(const places::UnfinishedBlank& blank, std::string_view reason) {
  return kept(MemoryStore::ask_blank(blank, reason));
}

Result<void> ListStore::confirm_blank(const places::BusDevice& who, std::string_view reason) {
  return kept(MemoryStore::confirm_blank(who, reason));
}

Result<void> ListStore::drop_blank(const places::BusDevice& who, std::string_view reason) {
  return kept(MemoryStore::drop_blank(who, reason));
}

Result<void> ListStore::give_away(places::SlotId slot, std::string_view reason) {
  const auto record = MemoryStore::load(slot);
  if (!record) return fail(record.error());
  if (record->confirmed) {
    auto former = unfinished_blanks();
    while (former && former->size() >= most_former) {
      static_cast<void>(MemoryStore::drop_blank(former->front().who(), reason));
      former = unfinished_blanks();
    }
    const auto& seat = *record->confirmed;
    static_cast<void>(MemoryStore::ask_blank({seat.device, {}, {}, seat.id}, reason));
  }
  return kept(MemoryStore::clear(slot, reason));
}

}  // namespace berth::manager
