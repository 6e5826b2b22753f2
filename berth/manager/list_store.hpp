/// What the master of a network list remembers of assigned node-IDs. For each node-ID: the device that was told it
/// (intended) and the one then heard under it (confirmed). Also the devices that may still store a node-ID that was
/// given away (`places::UnfinishedBlank`). It is a `places::SlotStore` in the device that has the list; the slot of
/// node-ID 5 is named "5".
///
/// Each writing call writes the whole image before it returns: two copies, of which the newer valid one counts, so that
/// a power loss at any byte leaves old or new. Little-endian:
///
///     copy   = sequence U32 | length U16 | rows | CRC-32 over all before
///     row    = node-ID U8 (FFh: not known) | kind U8 | LSS address: 4 x U32
///     kind   = bits 3..0: 1 intended, 2 confirmed, 3 gives its node-ID up; bit 4 + i: part i of the address is unknown
///
/// A device without a serial number is known by the node-ID of its row.
///
/// Not stored, because a list does not need them: marks, loans, configurations and the history.
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <string>
#include <vector>

#include "berth/places/slot_store.hpp"

namespace berth::manager {

/// Non-volatile memory that is fast enough to wait for: a few kilobytes of FRAM, or a file with fsync. Blank memory
/// reads FFh.
///
/// `write` returns when the bytes are stored permanently; the master does nothing meanwhile, as `berth up` does nothing
/// while SQLite writes its slot table. So an intention is durable before the first frame that acts on it can be queued.
/// Bytes are written in their order; a power loss in the middle leaves any number of them.
class ListMemory {
 public:
  virtual ~ListMemory() = default;
  [[nodiscard]] virtual std::size_t size() const noexcept = 0;
  /// Bytes beyond the end read FFh.
  virtual void read(std::size_t at, std::span<std::uint8_t> into) const noexcept = 0;
  /// False: the medium refused, or the place is out of range.
  virtual bool write(std::size_t at, std::span<const std::uint8_t> bytes) noexcept = 0;
};

class ListStore final : public places::MemoryStore {
 public:
  /// Limit of remembered devices whose node-ID was given away: beyond it the oldest is forgotten.
  static constexpr std::size_t most_former = 32;
  /// Bytes of the longest list: 126 slaves with all that can be known of each.
  static constexpr std::size_t footprint = 2 * (10 + (2 * 126 + most_former) * 18);

  /// Reads the content of `memory`, which must outlive this. Null: everything is lost with the power.
  explicit ListStore(ListMemory* memory = nullptr);
  /// After a power-on: the memory's content, and nothing else.
  void reload();

  /// Its slot in the store; never changes.
  [[nodiscard]] static places::SlotId slot_of(NodeId node) noexcept { return {node.value()}; }

  /// Errors of these, besides those of `places::SlotStore`: `Errc::io` the memory refused, or is too small; then
  /// nothing has changed.
  Result<void> ask(places::SlotId slot, const places::Assignment& seat, std::string_view reason) override;
  Result<void> confirm(places::SlotId slot, const places::Assignment& seat, std::string_view reason) override;
  Result<void> clear(places::SlotId slot, std::string_view reason) override;
  Result<void> ask_blank(const places::UnfinishedBlank& blank, std::string_view reason) override;
  Result<void> confirm_blank(const places::BusDevice& who, std::string_view reason) override;
  Result<void> drop_blank(const places::BusDevice& who, std::string_view reason) override;
  /// One write: the slot's confirmed device may return under its node-ID, and the slot is free.
  Result<void> give_away(places::SlotId slot, std::string_view reason);

  /// Images written since construction.
  [[nodiscard]] std::uint64_t writes() const noexcept { return writes_; }

 private:
  Result<void> kept(Result<void> done);
  [[nodiscard]] std::vector<std::uint8_t> image();
  [[nodiscard]] bool read_copy(unsigned copy, std::vector<std::uint8_t>& rows, std::uint32_t& sequence) const;
  void take(std::span<const std::uint8_t> rows);
  [[nodiscard]] std::size_t copy_size() const noexcept { return memory_->size() / 2; }

  ListMemory* memory_;
  std::uint32_t sequence_ = 0;
  unsigned copy_ = 1;  // the valid image; the next one goes to the other copy
  std::uint64_t writes_ = 0;
};

}  // namespace berth::manager
