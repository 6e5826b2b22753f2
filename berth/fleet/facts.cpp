#include "berth/fleet/facts.hpp"

#include <cmath>

namespace berth::fleet {
namespace {

using manager::BootStatus;
using places::SlotState;
using sparkplug::DataType;
using sparkplug::Null;
using sparkplug::Value;

Fact word(std::string name, std::string text) { return {std::move(name), DataType::string, std::move(text)}; }
Fact number(std::string name, DataType type, std::uint64_t value) { return {std::move(name), type, value}; }

// A part of the identity, or null.
Fact part(const char* name, const std::optional<Identity>& device, unsigned which, std::uint32_t value) {
  if (!device || !device->knows(which)) return {name, DataType::uint32, Null{}};
  return number(name, DataType::uint32, value);
}

void add_identity(Facts& facts, const std::optional<Identity>& device) {
  const auto address = device ? device->address : LssAddress{};
  facts.push_back(part("Device/Vendor ID", device, 0, address.vendor));
  facts.push_back(part("Device/Product code", device, 1, address.product));
  facts.push_back(part("Device/Revision number", device, 2, address.revision));
  facts.push_back(part("Device/Serial number", device, 3, address.serial));
}

void add_emcy(Facts& facts, const std::optional<operate::EmcyReport>& emcy) {
  facts.push_back(number("EMCY/Code", DataType::uint16, emcy ? emcy->code : 0U));
  facts.push_back(number("EMCY/Register", DataType::uint8, emcy ? emcy->error_register : 0U));
  facts.push_back(word("EMCY/Text", emcy ? emcy->text : ""));
}

}  // namespace

bool is_there(const operate::SlotReport& slot, bool was) noexcept {
  switch (slot.state) {
    case SlotState::present:
    case SlotState::configuring:
    case SlotState::power_cycle:
    case SlotState::operational: return true;
    case SlotState::failed: break;
    default: return false;
  }
  // Its identity is checked before these (CiA 302-2, boot-up of a slave: C to M come before).
  switch (slot.boot) {
    case BootStatus::g:
    case BootStatus::h:
    case BootStatus::i:
    case BootStatus::j: return true;
    case BootStatus::booted:
    case BootStatus::l: return was;
    default: return false;
  }
}

const char* configuration_word(const operate::SlotReport& slot, bool wanted) noexcept {
  if (!wanted) return "none";
  if (slot.state == SlotState::configuring) return "configuring";
  if (slot.state == SlotState::power_cycle) return "power cycle needed";
  if (slot.state == SlotState::failed && slot.boot == BootStatus::j) return "failed";
  return slot.state == SlotState::operational ? "as wanted" : "unknown";
}

const char* program_word(const operate::SlotReport& slot, bool wanted) noexcept {
  if (!wanted) return "none";
  if (slot.state == SlotState::failed) {
    if (slot.boot == BootStatus::g || slot.boot == BootStatus::h) return "different";
    if (slot.boot == BootStatus::i) return "update failed";
  }
  return slot.state == SlotState::operational ? "as wanted" : "unknown";
}

Facts facts_of_device(const operate::SlotReport& slot, const Wanted& wanted) {
  Facts facts;
  facts.push_back(word("Slot/State", places::name(slot.state)));
  facts.push_back(word("Slot/Reason", slot.reason));
  facts.push_back(word("Slot/Bus", slot.bus));
  facts.push_back(number("Slot/Node-ID", DataType::uint8, slot.id.value()));
  facts.push_back(word("Device/NMT state", slot.nmt ? name(*slot.nmt) : "unknown"));
  add_identity(facts, slot.device);
  facts.push_back(word("Device/Configuration", configuration_word(slot, wanted.configuration)));
  facts.push_back(word("Device/Program", program_word(slot, wanted.programs)));
  add_emcy(facts, slot.emcy);
  return facts;
}

Facts facts_of_slot(const operate::SlotReport& slot) {
  const std::string path = "Slots/" + slot.name;
  return {word(path + "/State", places::name(slot.state)), word(path + "/Reason", slot.reason)};
}

const char* port_word(const can::Status& port) noexcept {
  if (port.bus_off) return "bus-off";
  if (!port.up) return "down";
  return port.knows_counters && port.error_passive() ? "error passive" : "up";
}

Facts facts_of_bus(const BusFigures& bus) {
  const std::string path = "Buses/" + bus.name;
  Facts facts;
  facts.push_back(word(path + "/State", port_word(bus.port)));
  facts.push_back({path + "/Load", DataType::float32, static_cast<float>(std::round(bus.load_percent))});
  const auto counter = [&](const char* name, std::uint16_t value) {
    Fact fact{path + name, DataType::uint16, Null{}};
    if (bus.port.knows_counters) fact.value = std::uint64_t{value};
    return fact;
  };
  facts.push_back(counter("/TEC", bus.port.tec));
  facts.push_back(counter("/REC", bus.port.rec));
  facts.push_back(number(path + "/Errors", DataType::uint32, bus.port.errors));
  facts.push_back(number(path + "/Lost frames", DataType::uint32, bus.port.lost));
  facts.push_back(word(path + "/Master", bus.master));
  return facts;
}

std::vector<sparkplug::OwnMetric> metrics_of(const Facts& facts, sparkplug::Utc at) {
  std::vector<sparkplug::OwnMetric> metrics;
  metrics.reserve(facts.size());
  for (const auto& fact : facts) {
    metrics.push_back({.name = fact.name, .type = fact.type, .value = fact.value, .at = at});
  }
  return metrics;
}

}  // namespace berth::fleet
