#include "berth/places/slot_store.hpp"

#include <algorithm>

namespace berth::places {

const char* name(SlotState state) noexcept {
  switch (state) {
    case SlotState::unknown: return "unknown";
    case SlotState::empty: return "empty";
    case SlotState::binding: return "binding";
    case SlotState::question: return "question";
    case SlotState::absent: return "absent";
    case SlotState::present: return "present";
    case SlotState::configuring: return "configuring";
    case SlotState::power_cycle: return "power cycle needed";
    case SlotState::operational: return "operational";
    case SlotState::failed: return "failed";
    case SlotState::duplicate: return "duplicate";
    case SlotState::wrong_type: return "wrong type";
  }
  return "unknown";
}

const char* name(Configured::Stage stage) noexcept {
  switch (stage) {
    case Configured::Stage::writing: return "configuring";
    case Configured::Stage::power_cycle: return "power cycle needed";
    case Configured::Stage::done: return "configured";
  }
  return "configuring";
}

const char* name(Mark mark) noexcept {
  switch (mark) {
    case Mark::restore: return "restore asked";
    case Mark::fixed: return "fixed node-ID";
    case Mark::looks_used: return "looks used";
  }
  return "";
}

const char* name_of_end(Mark mark) noexcept {
  switch (mark) {
    case Mark::restore: return "restored";
    case Mark::fixed: return "node-ID not fixed";
    case Mark::looks_used: return "may be used";
  }
  return "";
}

std::optional<FormerSeat> former_seat(const std::vector<HistoryEntry>& lines) {
  std::optional<FormerSeat> sits;
  std::optional<FormerSeat> sat;
  for (const auto& line : lines) {
    if (line.event == "confirmed" && line.slot) {
      sits = FormerSeat{*line.slot, line.id, 0, false};
    } else if (line.event == "cleared" && sits && line.slot == sits->slot) {
      sat = sits;
      sat->until_ms = line.stamp_ms;
      sat->by_person = line.reason == by_a_person;
      if (line.reason == from_scratch) sat.reset();
      sits.reset();
    } else if (line.event == name_of_end(Mark::restore)) {
      sat.reset();
    }
  }
  return sits ? std::nullopt : sat;
}

SlotRecord* MemoryStore::find(SlotId slot) noexcept {
  const bool known = slot.value >= 1 && slot.value <= static_cast<std::int64_t>(slots_.size());
  return known ? &slots_[static_cast<std::size_t>(slot.value - 1)] : nullptr;
}

void MemoryStore::log(std::optional<SlotId> slot, std::string_view event, std::optional<LssAddress> device, NodeId id,
                      std::string_view reason) {
  if (slot) lines_of_slot_[*slot].push_back(history_.size());
  if (device) lines_of_device_[*device].push_back(history_.size());
  history_.push_back({static_cast<std::int64_t>(history_.size()) + 1, stamp_ms_, slot, std::string(event), device, id,
                      std::string(reason)});
}

Result<SlotId> MemoryStore::declare(const SlotName& name) {
  const SlotId slot{static_cast<std::int64_t>(slots_.size()) + 1};
  const auto [known, is_new] = names_.emplace(name, slot);
  if (!is_new) return known->second;
  slots_.push_back({slot, name, std::nullopt, std::nullopt, std::nullopt});
  log(slot, "declared", std::nullopt, NodeId(), name.name);
  return slot;
}

Result<std::vector<SlotRecord>> MemoryStore::load(std::string_view machine) {
  std::vector<SlotRecord> records;
  std::ranges::copy_if(slots_, std::back_inserter(records),
                       [&](const SlotRecord& r) { return r.name.machine == machine; });
  return records;
}

Result<SlotRecord> MemoryStore::load(SlotId slot) {
  const SlotRecord* const record = find(slot);
  if (record == nullptr) return fail(Errc::not_found, "no such slot");
  return *record;
}

Result<void> MemoryStore::ask(SlotId slot, const Assignment& seat, std::string_view reason) {
  SlotRecord* record = find(slot);
  if (record == nullptr) return fail(Errc::not_found, "no such slot");
  const auto sits = sits_.find(seat.device);
  if (sits != sits_.end() && sits->second != slot) return fail(Errc::duplicate, "the device sits in another slot");
  if (record->device() && record->device() != seat.device) return fail(Errc::duplicate, "the slot is another device's");
  record->intended = seat;
  sits_[seat.device] = slot;
  log(slot, "asked", seat.device, seat.id, reason);
  return {};
}

Result<void> MemoryStore::confirm(SlotId slot, const Assignment& seat, std::string_view reason) {
  SlotRecord* record = find(slot);
  if (record == nullptr) return fail(Errc::not_found, "no such slot");
  if (record->intended != seat) return fail(Errc::mismatch, "confirmed something that was not asked for");
  record->intended.reset();
  record->confirmed = seat;
  std::erase_if(blanks_, [&](const UnfinishedBlank& b) { return b.device == seat.device; });
  log(slot, "confirmed", seat.device, seat.id, reason);
  return {};
}

Result<void> MemoryStore::clear(SlotId slot, std::string_view reason) {
  SlotRecord* record = find(slot);
  if (record == nullptr) return fail(Errc::not_found, "no such slot");
  log(slot, "cleared", record->device(), NodeId(), reason);
  if (record->device()) sits_.erase(*record->device());
  record->intended.reset();
  record->confirmed.reset();
  record->configured.reset();
  return {};
}

Result<void> MemoryStore::configure(SlotId slot, const Configured& configured, std::string_view reason) {
  SlotRecord* record = find(slot);
  if (record == nullptr) return fail(Errc::not_found, "no such slot");
  record->configured = configured;
  const NodeId id = record->confirmed ? record->confirmed->id : NodeId();
  log(slot, name(configured.stage), configured.device, id, reason);
  return {};
}

Result<void> MemoryStore::ask_blank(const UnfinishedBlank& blank, std::string_view reason) {
  const auto known = std::ranges::find(blanks_, blank.device, &UnfinishedBlank::device);
  if (known == blanks_.end()) {
    blanks_.push_back(blank);
  } else {
    *known = blank;
  }
  log(std::nullopt, "blank asked", blank.device, blank.id, reason);
  return {};
}

Result<void> MemoryStore::confirm_blank(const LssAddress& device, std::string_view reason) {
  std::erase_if(blanks_, [&](const UnfinishedBlank& b) { return b.device == device; });
  log(std::nullopt, "blanked", device, NodeId(), reason);
  return {};
}

Result<void> MemoryStore::drop_blank(const LssAddress& device, std::string_view reason) {
  const auto known = std::ranges::find(blanks_, device, &UnfinishedBlank::device);
  if (known == blanks_.end()) return fail(Errc::not_found, "no unfinished intention of this device");
  log(std::nullopt, "blank dropped", device, known->id, reason);
  blanks_.erase(known);
  return {};
}

Result<std::vector<UnfinishedBlank>> MemoryStore::unfinished_blanks() { return blanks_; }

Result<void> MemoryStore::mark(Mark mark, const LssAddress& device, NodeId id, std::string_view reason) {
  marks_[{mark, device}] = id;
  log(std::nullopt, name(mark), device, id, reason);
  return {};
}

Result<void> MemoryStore::unmark(Mark mark, const LssAddress& device, std::string_view reason) {
  marks_.erase({mark, device});
  log(std::nullopt, name_of_end(mark), device, NodeId(), reason);
  return {};
}

Result<std::vector<Marked>> MemoryStore::marked(Mark mark) {
  std::vector<Marked> devices;
  for (const auto& [key, id] : marks_) {
    if (key.first == mark) devices.push_back({key.second, id});
  }
  return devices;
}

Result<void> MemoryStore::lend(const LentId& lent) {
  lent_[lent.device] = lent;
  return {};
}

Result<void> MemoryStore::give_back(const LssAddress& device) {
  lent_.erase(device);
  return {};
}

Result<std::vector<LentId>> MemoryStore::lent() {
  std::vector<LentId> all;
  for (const auto& [device, lent] : lent_) all.push_back(lent);
  return all;
}

Result<void> MemoryStore::note(const HistoryEntry& entry) {
  log(entry.slot, entry.event, entry.device, entry.id, entry.reason);
  return {};
}

template <class Key>
std::vector<HistoryEntry> MemoryStore::lines_at(const std::map<Key, std::vector<std::size_t>>& index,
                                                const Key& key) const {
  std::vector<HistoryEntry> lines;
  const auto at = index.find(key);
  if (at == index.end()) return lines;
  std::ranges::transform(at->second, std::back_inserter(lines), [&](std::size_t i) { return history_[i]; });
  return lines;
}

Result<std::vector<HistoryEntry>> MemoryStore::history(std::optional<SlotId> slot) {
  return slot ? lines_at(lines_of_slot_, *slot) : history_;
}

Result<std::vector<HistoryEntry>> MemoryStore::history_of(const LssAddress& device) {
  return lines_at(lines_of_device_, device);
}

}  // namespace berth::places
