#include "berth/device/program_memory.hpp"

#include <algorithm>
#include <utility>

#include "berth/base/bytes.hpp"
#include "berth/base/crc.hpp"

namespace berth::device {
namespace {

constexpr std::size_t head_checked = ProgramMemory::head_size - 4;

std::array<std::uint8_t, ProgramMemory::head_size> slot_head(std::uint32_t sequence, const ProgramHead& head) noexcept {
  std::array<std::uint8_t, ProgramMemory::head_size> bytes{};
  const std::array words{sequence, head.length, head.date, head.time, head.crc};
  for (std::size_t i = 0; i < words.size(); ++i) store_le(bytes.data() + 4 * i, words[i]);
  store_le(bytes.data() + head_checked, crc32(std::span(bytes).first(head_checked)));
  return bytes;
}

}  // namespace

std::size_t ProgramMemory::footprint(const ProgramLayout& layout) noexcept {
  const std::size_t sectors = (head_size + layout.longest + layout.sector - 1) / layout.sector;
  return layout.count * layout.images * sectors * layout.sector;
}

std::vector<std::uint8_t> ProgramMemory::holding(const ProgramHead& head, std::span<const std::uint8_t> content) {
  ProgramHead whole = head;
  whole.length = static_cast<std::uint32_t>(content.size());
  whole.crc = crc32(content);
  const auto first = slot_head(1, whole);
  std::vector<std::uint8_t> bytes(first.size() + content.size());
  std::ranges::copy(content, std::ranges::copy(first, bytes.begin()).out);
  return bytes;
}

ProgramMemory::ProgramMemory(NvMemory& memory, const ProgramLayout& layout, Owner& owner)
    : memory_(&memory), layout_(layout), owner_(&owner), programs_(layout.count) {}

std::size_t ProgramMemory::slot_size() const noexcept { return footprint(layout_) / layout_.count / layout_.images; }

std::size_t ProgramMemory::slot_at(std::uint8_t number, unsigned slot) const noexcept {
  return ((number - 1U) * layout_.images + slot) * slot_size();
}

// ---- programs in memory

void ProgramMemory::load() noexcept {
  forget();
  for (unsigned i = 0; i < layout_.count; ++i) {
    const auto number = static_cast<std::uint8_t>(i + 1);
    Program best;
    for (unsigned slot = 0; slot < layout_.images; ++slot) {
      const Program found = read_slot(number, slot);
      if (found.valid && (!best.valid || found.sequence > best.sequence)) best = found;
    }
    programs_[i] = best;
  }
}

void ProgramMemory::forget() noexcept {
  if (writes_) memory_->forget();
  writes_ = owner_waits_ = false;
  work_ = Work::none;
  for (auto& piece : pieces_) piece.size = 0;
}

ProgramMemory::Program ProgramMemory::read_slot(std::uint8_t number, unsigned slot) const noexcept {
  std::array<std::uint8_t, head_size> head{};
  const std::size_t at = slot_at(number, slot);
  memory_->read(at, head);
  const auto word = [&](std::size_t i) { return load_le<std::uint32_t>(head.data() + 4 * i); };
  Program p{.sequence = word(0),
            .length = word(1),
            .identification = word(4),
            .date = word(2),
            .time = word(3),
            .slot = slot};
  if (crc32(std::span(head).first(head_checked)) != word(7) || p.length > layout_.longest) return p;
  std::array<std::uint8_t, 512> piece{};
  std::uint32_t crc = 0;
  for (std::size_t done = 0; done < p.length; done += piece.size()) {
    const auto part = std::span(piece).first(std::min<std::size_t>(piece.size(), p.length - done));
    memory_->read(at + head_size + done, part);
    crc = crc32(part, crc);
  }
  p.valid = crc == p.identification;
  return p;
}

void ProgramMemory::read(std::uint8_t number, std::size_t at, std::span<std::uint8_t> into) const noexcept {
  memory_->read(slot_at(number, program(number).slot) + head_size + at, into);
}

bool ProgramMemory::blank(std::uint8_t number, unsigned slot) const noexcept {
  std::array<std::uint8_t, 512> piece{};
  for (std::size_t done = 0; done < slot_size(); done += piece.size()) {
    const auto part = std::span(piece).first(std::min(piece.size(), slot_size() - done));
    memory_->read(slot_at(number, slot) + done, part);
    if (std::ranges::any_of(part, [](auto byte) { return byte != 0xFF; })) return false;
  }
  return true;
}

// ---- clearing

bool ProgramMemory::clear(std::uint8_t number) noexcept {
  if (busy()) return false;
  number_ = number;
  work_ = Work::clearing;
  erased_ = 0;
  // The newer one last: if the power fails in between, the older program does not come back.
  const unsigned last = program(number).valid ? program(number).slot : 0;
  if (erase(layout_.images == 1 ? 0 : 1 - last)) return true;
  work_ = Work::none;
  return false;
}

bool ProgramMemory::erase(unsigned slot) noexcept {
  slot_ = slot;
  writes_ = memory_->erase(slot_at(number_, slot), slot_size(), *this);
  return writes_;
}

// ---- writing

ProgramMemory::Begun ProgramMemory::begin(std::uint8_t number) noexcept {
  if (busy()) return Begun::busy;
  const Program& now = program(number);
  number_ = number;
  slot_ = now.valid && layout_.images == 2 ? 1 - now.slot : 0;
  put_ = flashed_ = 0;
  crc_ = 0;
  next_piece_ = 0;
  const bool is_blank = blank(number, slot_);
  if (is_blank) {
    work_ = Work::writing;
    return Begun::ready;
  }
  if (layout_.images == 1) return Begun::not_cleared;
  work_ = Work::making_room;
  if (erase(slot_)) return Begun::soon;
  work_ = Work::none;
  return Begun::busy;
}

ProgramMemory::Put ProgramMemory::put(std::span<const std::uint8_t> bytes) noexcept {
  Piece& piece = pieces_[writes_ ? 1 - next_piece_ : next_piece_];
  std::ranges::copy(bytes, piece.bytes.begin());
  piece.size = bytes.size();
  put_ += bytes.size();
  crc_ = crc32(bytes, crc_);
  owner_waits_ = writes_;
  if (writes_) return Put::waits;
  writes_ = write_piece();
  return writes_ ? Put::taken : Put::refused;
}

bool ProgramMemory::write_piece() noexcept {
  const Piece& piece = pieces_[next_piece_];
  return memory_->write(slot_at(number_, slot_) + head_size + flashed_, std::span(piece.bytes).first(piece.size),
                        *this);
}

void ProgramMemory::end(const ProgramHead& head) noexcept {
  ending_ = head;
  work_ = Work::ending;
  owner_waits_ = false;
  if (!writes_) write_head();
}

void ProgramMemory::abandon() noexcept {
  if (work_ == Work::writing || work_ == Work::making_room) forget();
}

// The head is written after all the content: until the head is whole, there is no program here.
void ProgramMemory::write_head() noexcept {
  work_ = Work::head;
  auto& head = pieces_[0];
  const Program& now = program(number_);
  ProgramHead written = ending_;
  written.length = static_cast<std::uint32_t>(put_);
  written.crc = crc_;
  std::ranges::copy(slot_head(now.valid ? now.sequence + 1 : 1, written), head.bytes.begin());
  writes_ = memory_->write(slot_at(number_, slot_), std::span(head.bytes).first(head_size), *this);
  if (!writes_) finish(false);
}

// ---- end of a write

void ProgramMemory::written(bool ok) noexcept {
  writes_ = false;
  if (!ok) return finish(false);
  switch (work_) {
    case Work::clearing: return clear_next();
    case Work::making_room: work_ = Work::writing; return owner_->memory_ready(true);
    case Work::writing:
    case Work::ending: return piece_written();
    case Work::head: programs_[number_ - 1U] = read_slot(number_, slot_); return finish(programs_[number_ - 1U].valid);
    case Work::none: return;
  }
}

void ProgramMemory::clear_next() noexcept {
  if (++erased_ < layout_.images) {
    if (!erase(1 - slot_)) finish(false);
    return;
  }
  programs_[number_ - 1U] = {};
  finish(true);
}

void ProgramMemory::piece_written() noexcept {
  flashed_ += std::exchange(pieces_[next_piece_].size, std::size_t{0});
  next_piece_ = 1 - next_piece_;
  if (pieces_[next_piece_].size > 0) {
    writes_ = write_piece();
    if (!writes_) return finish(false);
  } else if (work_ == Work::ending) {
    return write_head();
  }
  if (std::exchange(owner_waits_, false)) owner_->memory_ready(true);
}

void ProgramMemory::finish(bool ok) noexcept {
  work_ = Work::none;
  writes_ = owner_waits_ = false;
  for (auto& piece : pieces_) piece.size = 0;
  owner_->memory_ready(ok);
}

}  // namespace berth::device
