#include "berth/multilevel/device_signals.hpp"

#include <algorithm>
#include <array>

#include "berth/base/bytes.hpp"
#include "berth/co/cob_id.hpp"
#include "berth/multilevel/emcy_layout.hpp"
#include "berth/multilevel/routing_objects.hpp"

namespace berth::multilevel {
namespace {

constexpr std::uint8_t own_register = co::error_register::generic | co::error_register::manufacturer;

// Switches a TPDO off or on by its COB-ID, as the network would. This is no change of the configuration (1020h).
void silence(od::Values& values, ObjectRef object, bool on) noexcept {
  const auto record = tpdo_record_of(values, object);
  if (!record) return;
  const auto id = values.get_or<std::uint32_t>({*record, 1}, co::CobId::invalid_bit);
  std::array<std::uint8_t, 4> wanted{};
  store_le(wanted.data(), on ? id | co::CobId::invalid_bit : id & ~co::CobId::invalid_bit);
  const auto date = values.get_or<std::uint32_t>({0x1020, 1}, 0U);
  const auto time = values.get_or<std::uint32_t>({0x1020, 2}, 0U);
  static_cast<void>(values.write({*record, 1}, wanted));
  values.set({0x1020, 1}, date);
  values.set({0x1020, 2}, time);
}

}  // namespace

DeviceSignals::DeviceSignals(rt::Executor& executor, std::vector<Side> sides, EmcyGateway& emcy)
    : executor_(&executor), sides_(std::move(sides)), emcy_(&emcy) {}

SignalSide DeviceSignals::signal_side(const Side& side) const {
  device::Device* const device = side.device;
  SignalSide made;
  made.values = &device->values();
  made.changed = [device](ObjectRef object) { device->services().changed(object); };
  made.port = side.port;
  made.silence = [device](ObjectRef object, bool on) { silence(device->values(), object, on); };
  return made;
}

std::vector<SignalProblem> DeviceSignals::set_table(std::vector<Signal> table) {
  std::vector<SignalSide> sides;
  std::vector<const od::Description*> descriptions;
  for (const auto& side : sides_) {
    sides.push_back(signal_side(side));
    descriptions.push_back(&side.device->values().description());
  }
  auto found = problems(table, descriptions);
  if (std::exchange(late_, 0) != 0) tell_late(false);
  engine_.emplace(*executor_, std::move(sides), std::move(table));
  engine_->on_late([this](std::size_t, bool is_late) { late(is_late); });
  engine_->set_safe(safe_);
  for (const auto& signal : engine_->table()) {
    if (signal.from < sides_.size()) watch(signal.from, signal.source);
  }
  return found;
}

// A device's callbacks stay: each object has one, for every later table.
void DeviceSignals::watch(std::uint8_t side, ObjectRef object) {
  if (!watched_.emplace(side, object).second) return;
  sides_[side].device->on_write(object, [this, side, object] { written(side, object); });
}

void DeviceSignals::written(std::uint8_t side, ObjectRef object) {
  if (!engine_) return;
  for (std::size_t i = 0; i < engine_->table().size(); ++i) {
    const Signal& signal = engine_->table()[i];
    if (signal.from == side && signal.source == object) engine_->received(i);
  }
}

void DeviceSignals::follow_objects() {
  const ObjectRef mode{RoutingObjects::mode, 0};
  auto& upper = *sides_.front().device;
  if (upper.values().description().find(mode) == nullptr) return;
  follows_ = true;
  safe_ = true;
  upper.on_write(mode, [this, mode] {
    if (engine_) engine_->set_mode(sides_.front().device->values().get_or<std::uint8_t>(mode, 0));
  });
}

void DeviceSignals::read_objects() {
  const auto& upper = sides_.front().device->values();
  const bool wrong = !set_table(read_routes(upper)).empty();
  engine_->set_mode(upper.get_or<std::uint8_t>({RoutingObjects::mode, 0}, 0));
  if (std::exchange(wrong_, wrong) == wrong) return;
  if (wrong) {
    emcy_->report(NodeId(), gateway_code::route_wrong, own_register);
  } else {
    emcy_->report(NodeId(), co::emcy_code::error_reset, 0, gateway_code::route_wrong);
  }
}

void DeviceSignals::set_safe(bool safe) {
  safe_ = safe;
  if (engine_) engine_->set_safe(safe);
}

bool DeviceSignals::all_operational() const noexcept {
  return std::ranges::all_of(sides_, [](const Side& s) { return s.device->state() == NmtState::operational; });
}

void DeviceSignals::look() {
  const NmtState now = sides_.front().device->state();
  const bool began = std::exchange(upper_, now) != now && now == NmtState::operational;
  if (began && follows_) read_objects();
  if (!engine_) return;
  engine_->set_complete(all_operational());
  if (!all_operational()) engine_->refresh();
}

void DeviceSignals::late(bool late) {
  const bool before = late_ != 0;
  late_ = late ? late_ + 1 : late_ - 1;
  if (before != (late_ != 0)) tell_late(late);
}

void DeviceSignals::tell_late(bool late) {
  if (late) {
    emcy_->report(NodeId(), gateway_code::signal_late, own_register);
  } else {
    emcy_->report(NodeId(), co::emcy_code::error_reset, 0, gateway_code::signal_late);
  }
}

}  // namespace berth::multilevel
