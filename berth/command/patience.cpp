#include "berth/command/patience.hpp"

#include <fmt/format.h>

namespace berth::command {

using namespace std::chrono_literals;

std::string silence_fix(const Error& error, operate::Network& bus, const NodeArgument& node) {
  if (error.code == Errc::bus)
    return "is the bit rate right, is the cable plugged in, do the devices have power, is the bus terminated?";
  if (error.code != Errc::timeout) return {};
  if (!node.gateways.empty())
    return "are the device and each gateway on the way on the bus and not stopped? `berth scan` shows which devices "
           "answer";
  for (const auto& slot : bus.report()) {
    if (slot.id == node.node && slot.state == places::SlotState::absent)
      return fmt::format("slot {} is absent: {}", slot.name, slot.reason);
  }
  if (bus.services().heard_within(node.node, 3s))
    return "its other frames were heard in the last 3 s: it answers SDO late, or not at all; for a late one write "
           "sdo_timeout = \"5 s\" into its [[slot]]";
  return "is the device on the bus and not stopped? `berth scan` shows which devices answer";
}

void fail_silent(Reply& reply, const Error& error, operate::Network& bus, const NodeArgument& node) {
  fail_with(reply, error, fmt::format("bus {}, SDO read", bus.bus().name), silence_fix(error, bus, node));
}

}  // namespace berth::command
