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

SlotRecord* MemoryStore::find(SlotId slot) noexcept {
  const auto it = std::ranges::find(slots_, slot, &SlotRecord::slot);
  return it == slots_.end() ? nullptr : &*it;
}

void MemoryStore::log(std::optional<SlotId> slot, std::string_view event, std::optional<LssAddress> device, NodeId id,
                      std::string_view reason) {
  history_.push_back({static_cast<std::int64_t>(history_.size()) + 1, stamp_ms_, slot, std::string(event), device, id,
                      std::string(reason)});
}

Result<SlotId> MemoryStore::declare(const SlotName& name) {
  const auto it = std::ranges::find(slots_, name, &SlotRecord::name);
  if (it != slots_.end()) return it->slot;
  const SlotId slot{static_cast<std::int64_t>(slots_.size()) + 1};
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

Result<void> MemoryStore::ask(SlotId slot, const Seat& seat, std::string_view reason) {
  SlotRecord* record = find(slot);
  if (record == nullptr) return fail(Errc::not_found, "no such slot");
  for (const auto& other : slots_) {
    const bool sits = (other.asked && other.asked->device == seat.device) ||
                      (other.confirmed && other.confirmed->device == seat.device);
    if (sits && other.slot != slot) return fail(Errc::duplicate, "the device sits in another slot");
  }
  record->asked = seat;
  log(slot, "asked", seat.device, seat.id, reason);
  return {};
}

Result<void> MemoryStore::confirm(SlotId slot, const Seat& seat, std::string_view reason) {
  SlotRecord* record = find(slot);
  if (record == nullptr) return fail(Errc::not_found, "no such slot");
  if (record->asked != seat) return fail(Errc::mismatch, "confirmed something that was not asked for");
  record->asked.reset();
  record->confirmed = seat;
  std::erase(blanks_, seat.device);
  log(slot, "confirmed", seat.device, seat.id, reason);
  return {};
}

Result<void> MemoryStore::clear(SlotId slot, std::string_view reason) {
  SlotRecord* record = find(slot);
  if (record == nullptr) return fail(Errc::not_found, "no such slot");
  log(slot, "cleared", record->device(), NodeId(), reason);
  record->asked.reset();
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

Result<void> MemoryStore::ask_blank(const LssAddress& device, std::string_view reason) {
  if (std::ranges::find(blanks_, device) == blanks_.end()) blanks_.push_back(device);
  log(std::nullopt, "blank asked", device, NodeId(), reason);
  return {};
}

Result<void> MemoryStore::confirm_blank(const LssAddress& device, std::string_view reason) {
  std::erase(blanks_, device);
  log(std::nullopt, "blanked", device, NodeId(), reason);
  return {};
}

Result<std::vector<LssAddress>> MemoryStore::unfinished_blanks() { return blanks_; }

Result<void> MemoryStore::note(const HistoryEntry& entry) {
  log(entry.slot, entry.event, entry.device, entry.id, entry.reason);
  return {};
}

Result<std::vector<HistoryEntry>> MemoryStore::history(std::optional<SlotId> slot) {
  std::vector<HistoryEntry> lines;
  std::ranges::copy_if(history_, std::back_inserter(lines),
                       [&](const HistoryEntry& h) { return !slot || h.slot == slot; });
  return lines;
}

}  // namespace berth::places
