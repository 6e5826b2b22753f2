#include "berth/manager/configuration_plan.hpp"

#include <algorithm>
#include <optional>
#include <set>

#include "berth/base/bytes.hpp"
#include "berth/manager/object_ranges_parts.hpp"
#include "berth/od/pdo_objects.hpp"

namespace berth::manager {
namespace {

constexpr std::uint32_t bit31 = 1U << 31U;
constexpr std::uint32_t bit30 = 1U << 30U;
constexpr std::uint32_t can_id_bits = 0x3FFF'FFFF;

constexpr std::uint16_t sync_id = 0x1005;
constexpr std::uint16_t sync_period = 0x1006;
constexpr std::uint16_t sync_counter = 0x1019;
constexpr std::uint16_t time_id = 0x1012;
constexpr std::uint16_t emcy_id = 0x1014;
constexpr std::uint16_t consumers = 0x1016;

using od::communication_of, od::mapping_of;
using od::is_pdo_mapping, od::is_pdo_record, od::cia301::is_additional_channel;
bool is_sync(std::uint16_t index) noexcept { return index == sync_id || index == sync_period || index == sync_counter; }
bool is_plain(std::uint16_t index) noexcept {
  return !is_pdo_record(index) && !is_additional_channel(index) && !is_sync(index) && index != time_id &&
         index != emcy_id && index != consumers;
}

std::vector<std::uint8_t> bytes_of(std::uint32_t value) {
  std::vector<std::uint8_t> bytes(4);
  store_le(bytes.data(), value);
  return bytes;
}
std::optional<std::uint32_t> number(std::span<const std::uint8_t> bytes) noexcept {
  if (bytes.empty() || bytes.size() > 4) return std::nullopt;
  std::uint32_t value = 0;
  for (std::size_t i = bytes.size(); i-- > 0;) value = value << 8U | bytes[i];
  return value;
}

class ConfigurationPlanMaker {
 public:
  ConfigurationPlanMaker(std::span<const Entry> entries, const std::vector<bool>& changes, const Held& held)
      : entries_(entries), changes_(changes), held_(held) {
    for (std::size_t i = 0; i < entries.size(); ++i) {
      if (!changes[i]) continue;
      const std::uint16_t index = entries[i].object.index;
      if (is_pdo_record(index)) pdos_.insert(communication_of(index));
      if (is_additional_channel(index)) channels_.insert(index);
    }
  }

  std::vector<Step> make() {
    sync_off();
    masked_off(time_id, bit31 | bit30);
    masked_off(emcy_id, bit31);
    for (const auto channel : channels_) channel_off(channel);
    for (const auto pdo : pdos_) pdo_off(pdo);
    consumers_off();
    for (std::size_t i = 0; i < entries_.size(); ++i) {
      if (changes_[i] && is_plain(entries_[i].object.index)) put(i);
    }
    put_all(consumers);
    for (const auto channel : channels_) put_others(channel, {0, 1, 2});
    for (const auto pdo : pdos_) fill(pdo);
    for (const auto channel : channels_) channel_on(channel);
    for (const auto pdo : pdos_) pdo_on(pdo);
    put_all(emcy_id);
    put_all(time_id);
    sync_on();
    return std::move(steps_);
  }

 private:
  [[nodiscard]] std::optional<std::size_t> changed(ObjectRef object) const {
    for (std::size_t i = 0; i < entries_.size(); ++i) {
      if (changes_[i] && entries_[i].object == object) return i;
    }
    return std::nullopt;
  }
  [[nodiscard]] const Entry* wanted(ObjectRef object) const {
    const auto it = std::ranges::find(entries_, object, &Entry::object);
    return it == entries_.end() || it->compare_only ? nullptr : &*it;
  }
  /// The first changed entry of an object.
  [[nodiscard]] std::optional<std::size_t> cause(std::uint16_t index) const {
    for (std::size_t i = 0; i < entries_.size(); ++i) {
      if (changes_[i] && entries_[i].object.index == index) return i;
    }
    return std::nullopt;
  }
  [[nodiscard]] std::optional<std::uint32_t> held(ObjectRef object) const {
    const auto it = held_.find(object);
    return it == held_.end() ? std::nullopt : number(it->second);
  }

  void put(std::size_t entry) { steps_.push_back({entries_[entry].object, entries_[entry].bytes, entry, false}); }
  void put_all(std::uint16_t index) {
    for (std::size_t i = 0; i < entries_.size(); ++i) {
      if (changes_[i] && entries_[i].object.index == index && !done_.contains(i)) put(i);
    }
  }
  void put_others(std::uint16_t index, std::initializer_list<std::uint8_t> but) {
    for (std::size_t i = 0; i < entries_.size(); ++i) {
      const ObjectRef object = entries_[i].object;
      if (changes_[i] && object.index == index && std::ranges::find(but, object.sub) == but.end()) put(i);
    }
  }
  void prepare(ObjectRef object, std::vector<std::uint8_t> bytes, std::size_t entry) {
    steps_.push_back({object, std::move(bytes), entry, true});
  }

  /// The other bits of a COB-ID are frozen while any bit of `valid` marks it as in use; for bit 31 a 1 may mean "not
  /// valid".
  void masked_off(std::uint16_t index, std::uint32_t valid) {
    const auto entry = changed({index, 0});
    const auto has = held({index, 0});
    if (!entry || !has) return;
    const auto shall = number(entries_[*entry].bytes);
    if (!shall || ((*has ^ *shall) & can_id_bits & ~valid) == 0) return;
    if (index == emcy_id) {
      if ((*has & bit31) == 0) prepare({index, 0}, bytes_of(*has | bit31), *entry);
    } else if ((*has & valid) != 0) {
      prepare({index, 0}, bytes_of(*has & ~valid), *entry);
    }
  }

  // ---- SYNC ----
  void sync_off() {
    const auto id = changed({sync_id, 0});
    const auto counter = changed({sync_counter, 0});
    if (!id && !counter) return;
    const auto has = held({sync_id, 0});
    if (has && (*has & bit30) != 0) {
      prepare({sync_id, 0}, bytes_of(*has & ~bit30), id ? *id : *counter);
      sync_is_off_ = true;
    }
    const auto period = held({sync_period, 0});
    if (counter && period && *period != 0) {
      prepare({sync_period, 0}, bytes_of(0), *counter);
      period_is_off_ = true;
    }
  }
  void sync_on() {
    const auto id = changed({sync_id, 0});
    const auto counter = changed({sync_counter, 0});
    if (counter) put(*counter);
    const auto period = changed({sync_period, 0});
    if (period) {
      put(*period);
    } else if (period_is_off_) {
      prepare({sync_period, 0}, bytes_of(*held({sync_period, 0})), *counter);
    }
    if (!id) {
      if (sync_is_off_) prepare({sync_id, 0}, bytes_of(*held({sync_id, 0})), *counter);
      return;
    }
    const auto shall = number(entries_[*id].bytes);
    const auto has = held({sync_id, 0});
    const bool moves = shall && has && ((*has ^ *shall) & ~bit30) != 0;
    if (moves && (*shall & bit30) != 0) prepare({sync_id, 0}, bytes_of(*shall & ~bit30), *id);
    put(*id);
  }

  // ---- heartbeat consumer ----
  void consumers_off() {
    for (std::size_t i = 0; i < entries_.size(); ++i) {
      const ObjectRef object = entries_[i].object;
      if (!changes_[i] || object.index != consumers || object.sub == 0) continue;
      const auto has = held(object);
      const auto shall = number(entries_[i].bytes);
      const auto node = [](std::uint32_t value) { return value >> 16U & 0xFFU; };
      if (has && *has != 0 && shall && *shall != 0 && node(*has) != node(*shall)) {
        prepare(object, bytes_of(0), i);
      } else if (has && *has != 0 && shall && *shall == 0) {
        put(i);  // frees its node-ID before another entry takes it
        done_.insert(i);
      }
    }
  }

  // ---- SDO channels ----
  void channel_off(std::uint16_t index) {
    for (const std::uint8_t sub : {std::uint8_t{1}, std::uint8_t{2}}) {
      const auto has = held({index, sub});
      if (!has || (*has & bit31) != 0) continue;
      const auto entry = changed({index, sub});
      const auto why = entry ? entry : cause(index);
      prepare({index, sub}, bytes_of(*has | bit31), *why);
      off_.insert({index, sub});
    }
  }
  void channel_on(std::uint16_t index) {
    for (const std::uint8_t sub : {std::uint8_t{1}, std::uint8_t{2}}) switch_on({index, sub}, *cause(index));
  }

  // ---- PDOs ----
  /// Transmission type and event timer may change while the PDO is valid; nothing else may.
  [[nodiscard]] bool needs_off(std::uint16_t pdo) const {
    if (cause(mapping_of(pdo))) return true;
    for (std::size_t i = 0; i < entries_.size(); ++i) {
      const ObjectRef object = entries_[i].object;
      if (changes_[i] && object.index == pdo && object.sub != 2 && object.sub != 5) return true;
    }
    return false;
  }
  [[nodiscard]] std::size_t cause_of_pdo(std::uint16_t pdo) const {
    const auto mapping = cause(mapping_of(pdo));
    return mapping ? *mapping : *cause(pdo);
  }
  void pdo_off(std::uint16_t pdo) {
    const ObjectRef id{pdo, 1};
    const auto has = held(id);
    if (!has || (*has & bit31) != 0 || !needs_off(pdo)) return;
    const auto entry = changed(id);
    prepare(id, bytes_of(*has | bit31), entry ? *entry : cause_of_pdo(pdo));
    off_.insert(id);
  }
  void fill(std::uint16_t pdo) {
    const auto mapping = mapping_of(pdo);
    const auto why = cause(mapping);
    if (why) {
      const auto count = held({mapping, 0});
      const Entry* const shall = wanted({mapping, 0});
      if (!count || *count != 0) prepare({mapping, 0}, {0}, *why);
      // Some devices clear all entries with sub-index 0: every wanted entry is written.
      for (std::size_t i = 0; i < entries_.size(); ++i) {
        const Entry& entry = entries_[i];
        if (entry.object.index == mapping && entry.object.sub != 0 && !entry.compare_only) put(i);
      }
      const auto entry = changed({mapping, 0});
      if (entry) {
        if (number(entries_[*entry].bytes) != 0U || !count) put(*entry);
      } else if (shall != nullptr && number(shall->bytes) != 0U) {
        prepare({mapping, 0}, shall->bytes, *why);
      } else if (shall == nullptr && count && *count != 0) {
        prepare({mapping, 0}, {static_cast<std::uint8_t>(*count)}, *why);
      }
    }
    put_others(pdo, {1});
  }
  void pdo_on(std::uint16_t pdo) { switch_on({pdo, 1}, cause_of_pdo(pdo)); }

  /// Writes the COB-ID that changes, or restores the one that was switched off.
  void switch_on(ObjectRef id, std::size_t why) {
    const auto entry = changed(id);
    const bool off = off_.contains(id);
    if (entry) {
      const bool there = off && number(entries_[*entry].bytes) == (*held(id) | bit31);
      if (!there) put(*entry);
    } else if (off) {
      prepare(id, bytes_of(*held(id)), why);
    }
  }
  std::span<const Entry> entries_;
  const std::vector<bool>& changes_;
  const Held& held_;
  std::set<std::uint16_t> pdos_;
  std::set<std::uint16_t> channels_;
  std::set<ObjectRef> off_;
  std::set<std::size_t> done_;
  bool sync_is_off_ = false;
  bool period_is_off_ = false;
  std::vector<Step> steps_;
};

}  // namespace

std::vector<ObjectRef> also_needed(std::span<const Entry> entries, const std::vector<bool>& changes) {
  std::set<ObjectRef> needed;
  for (std::size_t i = 0; i < entries.size(); ++i) {
    if (!changes[i]) continue;
    const std::uint16_t index = entries[i].object.index;
    if (is_pdo_record(index)) {
      const std::uint16_t pdo = communication_of(index);
      needed.insert({pdo, 1});
      if (is_pdo_mapping(index)) needed.insert({mapping_of(pdo), 0});
    }
    if (is_additional_channel(index)) needed.insert({{index, 1}, {index, 2}});
    if (is_sync(index)) needed.insert({{sync_id, 0}, {sync_period, 0}});
  }
  for (const auto& entry : entries) needed.erase(entry.object);
  return {needed.begin(), needed.end()};
}

std::vector<Step> plan(std::span<const Entry> entries, const std::vector<bool>& changes, const Held& held) {
  return ConfigurationPlanMaker(entries, changes, held).make();
}

}  // namespace berth::manager
