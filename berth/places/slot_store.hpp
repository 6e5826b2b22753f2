/// Keeps the slot table. `store::Database` keeps it in SQLite, `MemoryStore` in memory.
///
/// Machine, bus and identity (`BusDevice`) identify a device: twins on two buses are two devices, and writing about one
/// does not change the other. A device moved to another bus is a new one there, and its old slot still has it.
///
/// Every writing call is one transaction. After it returns without an error, the fact survives a crash at any later
/// instant. If the process dies inside it, the next start sees the state before or after, nothing between.
#pragma once

#include <map>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "berth/base/result.hpp"
#include "berth/places/slot.hpp"

namespace berth::places {

/// Milliseconds since the world's start.
class StoreClock {
 public:
  [[nodiscard]] virtual std::int64_t now_ms() const noexcept = 0;

 protected:
  ~StoreClock() = default;
};

class SlotStore {
 public:
  virtual ~SlotStore() = default;

  /// Finds the slot of this name, or makes one. Idempotent.
  virtual Result<SlotId> declare(const SlotName& name) = 0;
  /// All slots of a machine, in the order of their declaration.
  virtual Result<std::vector<SlotRecord>> load(std::string_view machine) = 0;
  /// One slot, in a time independent of their number. Errors: `not_found`.
  virtual Result<SlotRecord> load(SlotId slot) = 0;

  /// Writes the intention to seat a device, before the first frame that does so. The node-ID of the seat identifies a
  /// device without a serial number. Refused (`Errc::duplicate`):
  /// - The device is intended or confirmed in another slot of this bus; the error names it.
  /// - Another device, intended or confirmed in this slot, may have its node-ID in its memory: call `clear` first, with
  ///   the reason.
  virtual Result<void> ask(SlotId slot, const Assignment& seat, std::string_view reason) = 0;
  /// The device was heard under its new node-ID and identified: the intention becomes the binding. `seat` must be the
  /// intended one, else `Errc::mismatch`. This also ends an unfinished blanking of the device on this bus.
  virtual Result<void> confirm(SlotId slot, const Assignment& seat, std::string_view reason) = 0;
  /// Removes the slot's device, intended and confirmed, and its configuration; the history keeps them.
  virtual Result<void> clear(SlotId slot, std::string_view reason) = 0;

  /// Writes the progress of configuring the slot's device, in place of the last one; `clear` removes it.
  virtual Result<void> configure(SlotId slot, const Configured& configured, std::string_view reason) = 0;

  /// Writes the intention to take a device's node-ID away, before the first frame that does so. The newest one of a
  /// device on its bus counts.
  virtual Result<void> ask_blank(const UnfinishedBlank& blank, std::string_view reason) = 0;
  /// The device was heard to have no node-ID, and to have stored that.
  virtual Result<void> confirm_blank(const BusDevice& who, std::string_view reason) = 0;
  /// The user gives the intention up: the device is gone for good. Errors: `not_found` there is none on this bus.
  virtual Result<void> drop_blank(const BusDevice& who, std::string_view reason) = 0;
  /// The intentions of every bus that are neither confirmed nor dropped.
  virtual Result<std::vector<UnfinishedBlank>> unfinished_blanks() = 0;

  /// Sets or removes a mark of a device. `id`: its node-ID. Idempotent, except for the history.
  virtual Result<void> mark(Mark mark, const BusDevice& who, NodeId id, std::string_view reason) = 0;
  virtual Result<void> unmark(Mark mark, const BusDevice& who, std::string_view reason) = 0;
  /// The devices with this mark, ordered by address, twins by bus.
  virtual Result<std::vector<Marked>> marked(Mark mark) = 0;
  /// Whether one device has it, in a time independent of their number.
  virtual Result<bool> is_marked(Mark mark, const BusDevice& who) = 0;

  /// Writes that a node-ID is lent to a device, before the first frame that does so. The newest one of a device on its
  /// bus counts.
  virtual Result<void> lend(const LentId& lent) = 0;
  /// The device now has another node-ID or none, in use and pending. Idempotent. Neither call writes history: a device
  /// that waits for its place is lent a node-ID at every search.
  virtual Result<void> give_back(const BusDevice& who) = 0;
  /// The loans on every bus, ordered by device address, twins by bus.
  virtual Result<std::vector<LentId>> lent() = 0;

  /// Adds a line to the history only. `HistoryEntry::on` applies to a line without a slot.
  virtual Result<void> note(const HistoryEntry& entry) = 0;
  /// The history, oldest first; of one slot, or all.
  virtual Result<std::vector<HistoryEntry>> history(std::optional<SlotId> slot) = 0;
  /// The lines about a device on its bus, oldest first, including those of its address without a bus.
  virtual Result<std::vector<HistoryEntry>> history_of(const BusDevice& who) = 0;

  /// Sets the clock for history lines (`HistoryEntry::stamp_ms`). Null: `stamp`'s time. Used until it is replaced.
  virtual void set_clock(const StoreClock* clock) noexcept { clock_ = clock; }
  [[nodiscard]] const StoreClock* clock() const noexcept { return clock_; }
  /// Sets one time for each following line, unless a clock is set.
  void stamp(std::int64_t now_ms) noexcept { stamp_ms_ = now_ms; }
  [[nodiscard]] std::int64_t now_ms() const noexcept { return clock_ != nullptr ? clock_->now_ms() : stamp_ms_; }

 private:
  const StoreClock* clock_ = nullptr;
  std::int64_t stamp_ms_ = 0;
};

/// `Errc::duplicate` of `SlotStore::ask`: names the slot `there` of the same bus that has the device's address, and
/// what to do.
[[nodiscard]] Error sits_in(const SlotName& there);
/// The slot's device is the seat's, perhaps with another node-ID.
[[nodiscard]] bool is_of(const Identity& known, const Assignment& seat) noexcept;
/// The same, for another device that is intended or confirmed in this slot.
[[nodiscard]] Error owned_by_another() noexcept;
/// What a store did not write, for users: its own words for a refusal; else that it cannot be written, and why.
[[nodiscard]] std::string words_of(const Error& store_said);

/// The same guarantees without a disk, for tests, `--dry-run` and machines without a store file.
class MemoryStore : public SlotStore {
 public:
  /// `keeps_history` false: for a store whose memory must not grow with use; `history` is then empty.
  explicit MemoryStore(bool keeps_history = true) noexcept : keeps_history_(keeps_history) {}

  Result<SlotId> declare(const SlotName& name) override;
  Result<std::vector<SlotRecord>> load(std::string_view machine) override;
  Result<SlotRecord> load(SlotId slot) override;
  Result<void> ask(SlotId slot, const Assignment& seat, std::string_view reason) override;
  Result<void> confirm(SlotId slot, const Assignment& seat, std::string_view reason) override;
  Result<void> clear(SlotId slot, std::string_view reason) override;
  Result<void> configure(SlotId slot, const Configured& configured, std::string_view reason) override;
  Result<void> ask_blank(const UnfinishedBlank& blank, std::string_view reason) override;
  Result<void> confirm_blank(const BusDevice& who, std::string_view reason) override;
  Result<void> drop_blank(const BusDevice& who, std::string_view reason) override;
  Result<std::vector<UnfinishedBlank>> unfinished_blanks() override;
  Result<void> mark(Mark mark, const BusDevice& who, NodeId id, std::string_view reason) override;
  Result<void> unmark(Mark mark, const BusDevice& who, std::string_view reason) override;
  Result<std::vector<Marked>> marked(Mark mark) override;
  Result<bool> is_marked(Mark mark, const BusDevice& who) override {
    return marks_.contains({mark, who}) || marks_.contains({mark, {who.device, {}}});
  }
  Result<void> lend(const LentId& lent) override;
  Result<void> give_back(const BusDevice& who) override;
  Result<std::vector<LentId>> lent() override;
  Result<void> note(const HistoryEntry& entry) override;
  Result<std::vector<HistoryEntry>> history(std::optional<SlotId> slot) override;
  Result<std::vector<HistoryEntry>> history_of(const BusDevice& who) override;

 private:
  SlotRecord* find(SlotId slot) noexcept;
  template <class Key>
  [[nodiscard]] std::vector<HistoryEntry> lines_at(const std::map<Key, std::vector<std::size_t>>& index,
                                                   const Key& key) const;
  // Gives the line its number and time, and, if it has a slot, the slot's bus.
  void log(HistoryEntry line);

  std::vector<SlotRecord> slots_;  // by SlotId, from 1
  std::map<SlotName, SlotId> names_;
  std::map<BusDevice, SlotId> sits_;  // intended or confirmed
  std::vector<UnfinishedBlank> blanks_;
  std::map<std::pair<Mark, BusDevice>, NodeId> marks_;
  std::map<BusDevice, LentId> lent_;
  std::vector<HistoryEntry> history_;
  std::map<SlotId, std::vector<std::size_t>> lines_of_slot_;  // indices into `history_`
  std::map<Identity, std::vector<std::size_t>> lines_of_device_;
  bool keeps_history_;
};

}  // namespace berth::places
