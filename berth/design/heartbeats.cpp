// The heartbeat period that a bus can carry.
#include <algorithm>

#include "berth/design/machine.hpp"

namespace berth::design {
namespace {

using namespace std::chrono_literals;

constexpr double share = 0.2;

}  // namespace

double heartbeat_share(std::uint32_t bitrate, std::size_t nodes, Duration period) noexcept {
  const double bits = longest_bits_of_a_byte * static_cast<double>(nodes);
  return bits / (static_cast<double>(bitrate) * std::chrono::duration<double>(period).count());
}

Duration heartbeat_period_for(std::uint32_t bitrate, std::size_t nodes) noexcept {
  Duration period = 500ms;
  while (heartbeat_share(bitrate, nodes, period) > share && period < 20s) period += 100ms;
  return period;
}

void fit_heartbeats(Machine& machine) noexcept {
  for (auto& bus : machine.buses) {
    if (bus.timing.heartbeat_given) continue;
    const auto slots = std::ranges::count_if(machine.slots, [&](const Slot& s) { return s.spec.name.bus == bus.name; });
    const Duration usual = Timing{}.heartbeat_period;
    const Duration period = heartbeat_period_for(bus.bitrate, static_cast<std::size_t>(slots) + 1);
    if (period == usual) continue;
    const bool own_timeout = bus.timing.heartbeat_timeout != Timing{}.heartbeat_timeout;
    bus.timing.heartbeat_period = period;
    if (!own_timeout || bus.timing.heartbeat_timeout <= period) bus.timing.heartbeat_timeout = 3 * period;
  }
}

}  // namespace berth::design
