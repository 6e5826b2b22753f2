#include "berth/serve/cia309_pdo.hpp"

#include <algorithm>

namespace berth::serve::cia309 {
namespace {

using namespace std::chrono_literals;

constexpr std::uint32_t sync_key = 0x080;
constexpr std::uint8_t by_remote_frame = 0xFD;
constexpr std::uint8_t by_event = 0xFF;

// SYNC, EMCY and TIME have CAN-IDs of their own. In 29-bit frames, 7E4h and 7E5h are RAND's and Fastscan's feedback
// (S1.24).
bool usable(co::CobId id) noexcept {
  if (!id.allowed()) return false;
  if (id.extended()) return (id.id() >> 18U) != 0x7E4 && (id.id() >> 18U) != 0x7E5;
  return id.id() > 0x100;
}

std::vector<std::uint64_t> unpacked(std::span<const std::uint8_t> bytes, std::span<const unsigned> bits) {
  std::vector<std::uint64_t> values;
  unsigned at = 0;
  for (const unsigned length : bits) {
    std::uint64_t value = 0;
    for (unsigned i = 0; i < length; ++i, ++at) {
      const std::uint64_t bit = bytes[at / 8] >> (at % 8) & 1U;
      value |= bit << i;
    }
    values.push_back(value);
  }
  return values;
}

can::Frame packed(co::CobId id, std::uint8_t size, std::span<const std::uint64_t> values,
                  std::span<const unsigned> bits) {
  std::array<std::uint8_t, 8> bytes{};
  unsigned at = 0;
  for (std::size_t v = 0; v < bits.size(); ++v) {
    for (unsigned i = 0; i < bits[v]; ++i, ++at) {
      const auto bit = static_cast<unsigned>(values[v] >> i & 1U) << (at % 8);
      bytes[at / 8] = static_cast<std::uint8_t>(bytes[at / 8] | bit);
    }
  }
  const auto data = std::span(bytes).first(size);
  return id.extended() ? can::Frame::ext(id.id(), data) : can::Frame::base(id.id(), data);
}

}  // namespace

std::optional<Code> Pdos::set_rpdo(const PdoSetting& setting) { return set(rpdos_, setting); }
std::optional<Code> Pdos::set_tpdo(const PdoSetting& setting) { return set(tpdos_, setting); }

std::optional<Code> Pdos::set(Table& table, const PdoSetting& setting) {
  Pdo pdo;
  pdo.cob_id = co::CobId(setting.cob_id);
  pdo.setting = setting;
  unsigned all = 0;
  for (const auto& field : setting.fields) {
    pdo.bits.push_back(od::bit_length(field.type));
    all += pdo.bits.back();
  }
  if (all > 64) return Code::pdo_length;
  pdo.size = static_cast<std::uint8_t>((all + 7) / 8);
  pdo.values.assign(pdo.bits.size(), 0);
  if (!pdo.cob_id.valid()) {
    table.erase(setting.number);
  } else {
    if (!usable(pdo.cob_id)) return Code::internal_state;
    for (const auto& [number, other] : table) {
      if (number != setting.number && other.cob_id.key() == pdo.cob_id.key()) return Code::pdo_used;
    }
    table.insert_or_assign(setting.number, std::move(pdo));
  }
  listen();
  arm();
  return std::nullopt;
}

bool Pdos::sends(std::uint32_t key) const noexcept {
  return std::ranges::any_of(tpdos_, [&](const auto& entry) { return entry.second.cob_id.key() == key; });
}

std::optional<Pdos::State> Pdos::rpdo(std::uint16_t number) const noexcept {
  const auto it = rpdos_.find(number);
  if (it == rpdos_.end()) return std::nullopt;
  const Pdo& pdo = it->second;
  State state{.receptions = pdo.receptions, .by_request = pdo.setting.transmission == by_remote_frame};
  if (pdo.receptions > 0) state.values = pdo.values;
  return state;
}

can::Queued Pdos::ask(std::uint16_t number) noexcept {
  const auto it = rpdos_.find(number);
  if (it == rpdos_.end()) return can::Queued::closed;
  can::Frame frame = can::Frame::request(it->second.cob_id.id(), it->second.size);
  if (it->second.cob_id.extended()) {
    frame.id = it->second.cob_id.id();
    frame.extended = true;
  }
  return dispatcher_->send(frame);
}

Pdos::Written Pdos::write(std::uint16_t number, std::span<const std::uint64_t> values) {
  const auto it = tpdos_.find(number);
  if (it == tpdos_.end()) return {.error = Code::internal_state};
  Pdo& pdo = it->second;
  if (values.size() != pdo.bits.size()) return {.error = Code::pdo_length};
  pdo.values.assign(values.begin(), values.end());
  pdo.written = true;
  pdo.wants = true;
  const bool now = pdo.setting.transmission == by_event && dispatcher_->executor().now() >= pdo.free_at;
  const auto queued = now ? send(pdo) : can::Queued::yes;
  arm();
  return {.queued = queued};
}

void Pdos::clear() noexcept {
  rpdos_.clear();
  tpdos_.clear();
  dispatcher_->remove(*this);
  cancel();
}

can::Queued Pdos::send(Pdo& pdo) noexcept {
  const auto queued = dispatcher_->send(packed(pdo.cob_id, pdo.size, pdo.values, pdo.bits));
  const rt::Time now = dispatcher_->executor().now();
  if (queued == can::Queued::yes) pdo.wants = false;
  pdo.free_at = now + pdo.setting.inhibit * 100us;
  const bool repeats = pdo.setting.transmission == by_event && pdo.setting.event_timer > 0;
  pdo.again_at = repeats ? now + pdo.setting.event_timer * 1ms : rt::never;
  return queued;
}

void Pdos::received(const can::Frame& frame, rt::Time) noexcept {
  if (frame.key() == sync_key && !frame.remote) synchronise(frame.size == 1 ? frame.data[0] : 0);
  for (auto& [number, pdo] : tpdos_) {
    const bool asked = frame.remote && pdo.setting.transmission == by_remote_frame && pdo.cob_id.key() == frame.key();
    if (asked && pdo.written) send(pdo);
  }
  if (frame.remote) return;
  for (auto& [number, pdo] : rpdos_) {
    if (pdo.cob_id.key() == frame.key() && frame.size >= pdo.size) store(number, pdo, frame);
  }
}

void Pdos::store(std::uint16_t number, Pdo& pdo, const can::Frame& frame) {
  auto values = unpacked(frame.bytes(), pdo.bits);
  if (pdo.setting.transmission <= 240) {
    pdo.coming = std::move(values);
    pdo.wants = true;
    return;
  }
  pdo.values = std::move(values);
  ++pdo.receptions;
  ear_->received(number, pdo.values);
}

void Pdos::synchronise(std::uint8_t counter) {
  for (auto& [number, pdo] : rpdos_) {
    if (pdo.setting.transmission > 240 || !std::exchange(pdo.wants, false)) continue;
    pdo.values = pdo.coming;
    ++pdo.receptions;
    ear_->received(number, pdo.values);
  }
  for (auto& [number, pdo] : tpdos_) {
    const unsigned period = pdo.setting.transmission;
    if (period > 240 || !pdo.written) continue;
    if (period == 0) {
      if (pdo.wants) send(pdo);
      continue;
    }
    const bool waits = pdo.setting.sync_start != 0 && counter != 0 && !pdo.counting;
    if (waits && counter != pdo.setting.sync_start) continue;
    if (waits) pdo.syncs = static_cast<std::uint8_t>(period - 1);  // this SYNC is the first
    pdo.counting = true;
    if (++pdo.syncs < period) continue;
    pdo.syncs = 0;
    send(pdo);
  }
}

void Pdos::run() noexcept {
  const rt::Time now = dispatcher_->executor().now();
  for (auto& [number, pdo] : tpdos_) {
    if (pdo.setting.transmission != by_event || !pdo.written) continue;
    const bool deferred = pdo.wants && now >= pdo.free_at;
    if (!deferred && now < pdo.again_at) continue;
    // The queue is full: try again soon.
    if (send(pdo) != can::Queued::yes) pdo.free_at = std::max(pdo.free_at, now + 1ms);
  }
  arm();
}

void Pdos::arm() noexcept {
  rt::Time next = rt::never;
  for (const auto& [number, pdo] : tpdos_) {
    if (pdo.setting.transmission != by_event || !pdo.written) continue;
    if (pdo.wants) next = std::min(next, pdo.free_at);
    next = std::min(next, pdo.again_at);
  }
  cancel();
  if (next != rt::never) dispatcher_->executor().at(std::max(next, dispatcher_->executor().now()), *this);
}

void Pdos::listen() noexcept {
  dispatcher_->remove(*this);
  bool sync = false;
  std::vector<std::uint32_t> keys;
  for (const Table* const table : {&rpdos_, &tpdos_}) {
    for (const auto& [number, pdo] : *table) {
      keys.push_back(pdo.cob_id.key());
      sync = sync || pdo.setting.transmission <= 240;
    }
  }
  if (sync) keys.push_back(sync_key);
  std::ranges::sort(keys);
  keys.erase(std::ranges::unique(keys).begin(), keys.end());
  for (const auto key : keys) dispatcher_->add(can::only(key), *this);
}

}  // namespace berth::serve::cia309
