#include "berth/places/slot_store.hpp"

#include <fmt/format.h>

#include <algorithm>

#include "berth/base/kept.hpp"
#include "berth/base/shell_word.hpp"

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

Error sits_in(const SlotName& there) {
  const char* const text =
      kept(fmt::format("the slot table has a device of this LSS address in slot {} of bus {}, and an LSS address is "
                       "unique on a bus: `berth replace {}` releases that slot (if the machine file no longer has it, "
                       "write it there again first); two devices need two serial numbers",
                       there.name, there.bus, shell_word(there.bus + "/" + there.name)));
  return Error{.code = Errc::duplicate, .text = text};
}

std::string words_of(const Error& store_said) {
  if (store_said.code == Errc::duplicate) return store_said.text;
  return "the slot table cannot be written: " + describe(store_said);
}

bool is_of(const Identity& known, const Assignment& seat) noexcept {
  return known == seat.device || known.with(seat.id) == seat.device;
}

Error owned_by_another() noexcept {
  return Error{.code = Errc::duplicate,
               .text = "the slot table has another device in this slot: release the slot first, by `berth replace`"};
}

namespace {

HistoryEntry line_of(SlotId slot, std::string_view event, std::optional<Identity> device, NodeId id,
                     std::string_view reason) {
  return {0, 0, slot, std::string(event), device, id, std::string(reason), {}};
}

HistoryEntry line_of(const BusDevice& who, std::string_view event, NodeId id, std::string_view reason) {
  return {0, 0, std::nullopt, std::string(event), who.device, id, std::string(reason), who.on};
}

// Selects the rows about the device on this bus, or on an unknown bus.
auto about(const BusDevice& who) {
  return [&who](const auto& row) { return row.device == who.device && row.who().on.covers(who.on); };
}

}  // namespace

SlotRecord* MemoryStore::find(SlotId slot) noexcept {
  const bool known = slot.value >= 1 && slot.value <= static_cast<std::int64_t>(slots_.size());
  return known ? &slots_[static_cast<std::size_t>(slot.value - 1)] : nullptr;
}

void MemoryStore::log(HistoryEntry line) {
  if (!keeps_history_) return;
  if (line.slot) {
    const SlotRecord* const record = find(*line.slot);
    line.on = record != nullptr ? record->name.on() : BusName();
    lines_of_slot_[*line.slot].push_back(history_.size());
  }
  if (line.device) lines_of_device_[*line.device].push_back(history_.size());
  line.sequence = static_cast<std::int64_t>(history_.size()) + 1;
  line.stamp_ms = now_ms();
  history_.push_back(std::move(line));
}

Result<SlotId> MemoryStore::declare(const SlotName& name) {
  const SlotId slot{static_cast<std::int64_t>(slots_.size()) + 1};
  const auto [known, is_new] = names_.emplace(name, slot);
  if (!is_new) return known->second;
  slots_.push_back({slot, name, std::nullopt, std::nullopt, std::nullopt});
  log(line_of(slot, "declared", std::nullopt, NodeId(), name.name));
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
  const BusDevice who{seat.device, record->name.on()};
  const auto sits = sits_.find(who);
  if (sits != sits_.end() && sits->second != slot) return fail(sits_in(find(sits->second)->name));
  if (record->device() && !is_of(*record->device(), seat)) return fail(owned_by_another());
  if (record->device()) sits_.erase({*record->device(), record->name.on()});
  record->intended = seat;
  sits_[who] = slot;
  log(line_of(slot, "asked", seat.device, seat.id, reason));
  return {};
}

Result<void> MemoryStore::confirm(SlotId slot, const Assignment& seat, std::string_view reason) {
  SlotRecord* record = find(slot);
  if (record == nullptr) return fail(Errc::not_found, "no such slot");
  if (record->intended != seat) return fail(Errc::mismatch, "the confirmation differs from the stored intention");
  record->intended.reset();
  record->confirmed = seat;
  const BusDevice who{seat.device, record->name.on()};
  std::erase_if(blanks_, about(who));
  log(line_of(slot, "confirmed", seat.device, seat.id, reason));
  return {};
}

Result<void> MemoryStore::clear(SlotId slot, std::string_view reason) {
  SlotRecord* record = find(slot);
  if (record == nullptr) return fail(Errc::not_found, "no such slot");
  log(line_of(slot, "cleared", record->device(), NodeId(), reason));
  if (record->device()) sits_.erase({*record->device(), record->name.on()});
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
  log(line_of(slot, name(configured.stage), configured.device, id, reason));
  return {};
}

Result<void> MemoryStore::ask_blank(const UnfinishedBlank& blank, std::string_view reason) {
  const BusDevice who = blank.who();
  // A row of any bus applies to this bus only from now on.
  std::erase_if(blanks_, [&](const UnfinishedBlank& b) { return b.device == blank.device && b.bus.empty(); });
  const auto known = std::ranges::find(blanks_, who, &UnfinishedBlank::who);
  if (known == blanks_.end()) {
    blanks_.push_back(blank);
  } else {
    *known = blank;
  }
  log(line_of(who, "blank asked", blank.id, reason));
  return {};
}

Result<void> MemoryStore::confirm_blank(const BusDevice& who, std::string_view reason) {
  std::erase_if(blanks_, about(who));
  log(line_of(who, "blanked", NodeId(), reason));
  return {};
}

Result<void> MemoryStore::drop_blank(const BusDevice& who, std::string_view reason) {
  const auto known = std::ranges::find_if(blanks_, about(who));
  if (known == blanks_.end()) return fail(Errc::not_found, "no unfinished intention of this device");
  log(line_of(who, "blank dropped", known->id, reason));
  std::erase_if(blanks_, about(who));
  return {};
}

Result<std::vector<UnfinishedBlank>> MemoryStore::unfinished_blanks() { return blanks_; }

Result<void> MemoryStore::mark(Mark mark, const BusDevice& who, NodeId id, std::string_view reason) {
  marks_.erase({mark, {who.device, {}}});
  marks_[{mark, who}] = id;
  log(line_of(who, name(mark), id, reason));
  return {};
}

Result<void> MemoryStore::unmark(Mark mark, const BusDevice& who, std::string_view reason) {
  marks_.erase({mark, {who.device, {}}});
  marks_.erase({mark, who});
  log(line_of(who, name_of_end(mark), NodeId(), reason));
  return {};
}

Result<std::vector<Marked>> MemoryStore::marked(Mark mark) {
  std::vector<Marked> devices;
  for (const auto& [key, id] : marks_) {
    if (key.first == mark) devices.push_back({key.second.device, id, key.second.on});
  }
  return devices;
}

Result<void> MemoryStore::lend(const LentId& lent) {
  lent_.erase({lent.device, {}});
  lent_[lent.who()] = lent;
  return {};
}

Result<void> MemoryStore::give_back(const BusDevice& who) {
  lent_.erase({who.device, {}});
  lent_.erase(who);
  return {};
}

Result<std::vector<LentId>> MemoryStore::lent() {
  std::vector<LentId> all;
  for (const auto& [who, lent] : lent_) all.push_back(lent);
  return all;
}

Result<void> MemoryStore::note(const HistoryEntry& entry) {
  log(entry);
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

Result<std::vector<HistoryEntry>> MemoryStore::history_of(const BusDevice& who) {
  std::vector<HistoryEntry> lines = lines_at(lines_of_device_, who.device);
  std::erase_if(lines, [&](const HistoryEntry& line) { return !line.on.covers(who.on); });
  return lines;
}

}  // namespace berth::places
