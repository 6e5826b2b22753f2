/// What was handed over of a value, and whether it has moved since. Pure.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "berth/fleet/facts.hpp"
#include "berth/fleet/signals.hpp"

namespace berth::fleet {

/// A value as it was told.
struct ToldValue {
  std::uint64_t raw = 0;
  std::string text{};
  bool known = false;
  sparkplug::Quality quality = sparkplug::Quality::stale;
  rt::Time at{};  ///< when it was told
};

/// It differs by the deadband of the signal at least.
[[nodiscard]] bool has_moved(const ToldValue& told, const SignalTable::State& now, const Signal& signal) noexcept;

/// The newest device of a slot, as it was told.
struct ToldSlot {
  std::optional<operate::SlotReport> slot{};
  bool born = false;
  Facts of_device{};
  Facts of_slot{};                     ///< metrics of the node
  std::vector<std::size_t> signals{};  ///< indices
};
/// Nothing that a metric has differs.
[[nodiscard]] bool same(const operate::SlotReport& a, const operate::SlotReport& b) noexcept;

/// The bytes in a reply to `sdo read` of one object ("bytes": "F4 01"). Empty: there are none.
[[nodiscard]] std::optional<std::vector<std::uint8_t>> bytes_in(const std::string& json);

}  // namespace berth::fleet
