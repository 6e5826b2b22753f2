/// Where the slot table is kept. `store::Database` keeps it in SQLite, `MemoryStore` in memory.
///
/// A device is known by machine, bus and identity (`BusDevice`): twins on two buses are two devices, and what is
/// written or ended of one leaves the other alone. A device that is moved to another bus is a new one there, and its
/// old slot keeps it.
///
/// Every writing call is one transaction: when it returns without an error the fact survives a crash at any later
/// instant; when the process dies inside it, the next start sees the state before or after, nothing between.
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

  /// Finds the slot of this name, or makes it. Idempotent.
  virtual Result<SlotId> declare(const SlotName& name) = 0;
  /// All slots of a machine, in the order in which they were declared.
  virtual Result<std::vector<SlotRecord>> load(std::string_view machine) = 0;
  /// One slot, in a time that does not grow with their number. Errors: `not_found`.
  virtual Result<SlotRecord> load(SlotId slot) = 0;

  /// Writes the intention to seat a device, before the first frame that does it. One without a
  /// serial number is known by the node-ID of the seat. Refused (`Errc::duplicate`): the
  /// device is intended or confirmed in another slot of this bus, which the error's text names; another device is
  /// intended or confirmed in this slot, whose node-ID may be in that device's memory: `clear` comes first, and says
  /// why.
  virtual Result<void> ask(SlotId slot, const Assignment& seat, std::string_view reason) = 0;
  /// The device was heard under its new node-ID and identified: the intention becomes the binding. `seat` must be what
  /// was intended, else `Errc::mismatch`. An unfinished blanking of the device on this bus is over.
  virtual Result<void> confirm(SlotId slot, const Assignment& seat, std::string_view reason) = 0;
  /// Forgets which device sits in the slot, intended and confirmed, and its configuration; the history keeps it.
  virtual Result<void> clear(SlotId slot, std::string_view reason) = 0;

  /// Writes how far the configuration of the slot's device has come. Replaces what was known; `clear` forgets it.
  virtual Result<void> configure(SlotId slot, const Configured& configured, std::string_view reason) = 0;

  /// Writes the intention to take a device's node-ID away, before the first frame that does it. The newest of a device
  /// on its bus counts.
  virtual Result<void> ask_blank(const UnfinishedBlank& blank, std::string_view reason) = 0;
  /// The device was heard to be without a node-ID, stored.
  virtual Result<void> confirm_blank(const BusDevice& who, std::string_view reason) = 0;
  /// A person gives the intention up: the device is gone for good. Errors: `not_found` there is none on this bus.
  virtual Result<void> drop_blank(const BusDevice& who, std::string_view reason) = 0;
  /// The intentions that are neither confirmed nor dropped, of every bus.
  virtual Result<std::vector<UnfinishedBlank>> unfinished_blanks() = 0;

  /// Remembers something of a device, or no more. `id`: the node-ID it has. Idempotent, but for the history.
  virtual Result<void> mark(Mark mark, const BusDevice& who, NodeId id, std::string_view reason) = 0;
  virtual Result<void> unmark(Mark mark, const BusDevice& who, std::string_view reason) = 0;
  /// The devices with this mark, in the order of their addresses, twins in that of their buses.
  virtual Result<std::vector<Marked>> marked(Mark mark) = 0;
  /// Whether one device has it, in a time that does not grow with their number.
  virtual Result<bool> is_marked(Mark mark, const BusDevice& who) = 0;

  /// Writes that a device is lent a node-ID, before the first frame that does it. The newest of a device on
  /// its bus counts.
  virtual Result<void> lend(const LentId& lent) = 0;
  /// The device has another node-ID now or none, in use and pending. Idempotent. Neither is a line of the history: a
  /// device that waits for its place is lent one at every search.
  virtual Result<void> give_back(const BusDevice& who) = 0;
  /// What is lent, on every bus, in the order of the devices' addresses, twins in that of their buses.
  virtual Result<std::vector<LentId>> lent() = 0;

  /// Adds a line to the history that changes nothing else. `HistoryEntry::on` counts for a line without a slot.
  virtual Result<void> note(const HistoryEntry& entry) = 0;
  /// The history, oldest first; of one slot, or all.
  virtual Result<std::vector<HistoryEntry>> history(std::optional<SlotId> slot) = 0;
  /// The lines about a device on its bus, oldest first, and those of its address that name no bus.
  virtual Result<std::vector<HistoryEntry>> history_of(const BusDevice& who) = 0;

  /// What tells the time that history lines get (`HistoryEntry::stamp_ms`). Null: `stamp`'s. It stays until it is
  /// replaced.
  virtual void set_clock(const StoreClock* clock) noexcept { clock_ = clock; }
  [[nodiscard]] const StoreClock* clock() const noexcept { return clock_; }
  /// The same time for each line from now on, unless a clock is set.
  void stamp(std::int64_t now_ms) noexcept { stamp_ms_ = now_ms; }
  [[nodiscard]] std::int64_t now_ms() const noexcept { return clock_ != nullptr ? clock_->now_ms() : stamp_ms_; }

 private:
  const StoreClock* clock_ = nullptr;
  std::int64_t stamp_ms_ = 0;
};

/// `Errc::duplicate` of `SlotStore::ask`: the device's address sits in the slot `there` of the same bus, and what to
/// do.
[[nodiscard]] Error sits_in(const SlotName& there);
/// The device that a slot has is the one of this seat, perhaps with another node-ID.
[[nodiscard]] bool is_of(const Identity& known, const Assignment& seat) noexcept;
/// The same when another device is intended or confirmed in the slot that is asked for.
[[nodiscard]] Error owned_by_another() noexcept;
/// What a store did not write, for people: a refusal in its own words, else that it cannot be written, and why.
[[nodiscard]] std::string words_of(const Error& store_said);

/// The same promises without a disk, for tests, `--dry-run` and machines without a store file.
class MemoryStore : public SlotStore {
 public:
  /// `keeps_history` false: a store that is to take no more memory the longer it is used. `history` is empty then.
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
  // The line gets its number and its time, one of a slot the slot's bus.
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
