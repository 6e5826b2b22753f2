#include "berth/fleet/machines.hpp"

#include <fmt/format.h>

#include <algorithm>

namespace berth::fleet {
namespace {

using sparkplug::FleetDevice;
using sparkplug::FleetNode;

constexpr std::string_view slots_path = "Slots/";
constexpr std::string_view buses_path = "Buses/";
constexpr std::string_view state_end = "/State";

class Reader {
 public:
  explicit Reader(const sparkplug::Fleet& fleet) : fleet_(&fleet) {}

  // Empty: there is no such metric, or it is no text.
  [[nodiscard]] std::string text(const FleetDevice& device, const std::string& metric) const {
    const auto* const found = fleet_->find(device, metric);
    const auto* const words = found == nullptr ? nullptr : std::get_if<std::string>(&found->value);
    return words == nullptr ? std::string() : *words;
  }

  [[nodiscard]] MachineView view(const FleetNode& node) const {
    MachineView machine{.id = node.id, .online = node.self.online, .in_doubt = node.in_doubt, .since = node.self.since};
    machine.version = text(node.self, "Berth/Version");
    machine.is_berth = fleet_->find(node.self, "Berth/Version") != nullptr;
    machine.studio = text(node.self, "Berth/Studio");
    const auto* const operational = fleet_->find(node.self, "Machine/Operational");
    const auto* const yes = operational == nullptr ? nullptr : std::get_if<bool>(&operational->value);
    machine.operational = yes != nullptr && *yes;
    for (const auto& metric : node.self.metrics) add(machine, node, fleet_->name(metric));
    std::ranges::sort(machine.slots, {}, &SlotView::name);
    std::ranges::sort(machine.bus_trouble);
    return machine;
  }

 private:
  void add(MachineView& machine, const FleetNode& node, const std::string& metric) const {
    if (!metric.ends_with(state_end)) return;
    const auto middle = [&](std::string_view path) {
      return metric.substr(path.size(), metric.size() - path.size() - state_end.size());
    };
    if (metric.starts_with(slots_path)) return add_slot(machine, node, middle(slots_path));
    if (!metric.starts_with(buses_path)) return;
    const std::string state = text(node.self, metric);
    if (state != "up") machine.bus_trouble.push_back(fmt::format("bus {} is {}", middle(buses_path), state));
  }

  void add_slot(MachineView& machine, const FleetNode& node, std::string name) const {
    const std::string path = std::string(slots_path) + name;
    SlotView slot{.state = text(node.self, path + "/State"), .reason = text(node.self, path + "/Reason")};
    const auto* const device = fleet_->find(node, name);
    if (device != nullptr && device->online) {
      slot.emcy = text(*device, "EMCY/Text");
      slot.configuration = text(*device, "Device/Configuration");
      slot.program = text(*device, "Device/Program");
    }
    // A machine is operational without its optional slots.
    slot.needs = !machine.operational && slot.state != "operational";
    slot.name = std::move(name);
    machine.slots.push_back(std::move(slot));
  }

  const sparkplug::Fleet* fleet_;
};

std::string words_of(const SlotView& slot) {
  std::string words = fmt::format("slot {}: {}", slot.name, slot.state);
  if (!slot.reason.empty()) words += ", " + slot.reason;
  return words;
}

const SlotView* slot_named(const MachineView& machine, const std::string& name) {
  const auto found = std::ranges::find(machine.slots, name, &SlotView::name);
  return found == machine.slots.end() ? nullptr : &*found;
}

void add_change(std::vector<std::string>& lines, const std::string& what, const std::string& before,
                const std::string& now) {
  if (before == now) return;
  const auto shown = [](const std::string& word) { return word.empty() ? std::string("none") : word; };
  lines.push_back(fmt::format("{}: {} → {}", what, shown(before), shown(now)));
}

}  // namespace

std::vector<MachineView> machines_of(const sparkplug::Fleet& fleet) {
  const Reader reader(fleet);
  std::vector<MachineView> machines;
  for (const auto& [id, node] : fleet.nodes()) machines.push_back(reader.view(node));
  return machines;
}

std::string trouble_of(const MachineView& machine) {
  if (!machine.online) return "offline";
  if (!machine.needs()) return {};
  std::string words = fmt::format("{}", fmt::join(machine.bus_trouble, "; "));
  for (const auto& slot : machine.slots) {
    if (!slot.needs) continue;
    if (!words.empty()) words += "; ";
    words += words_of(slot);
  }
  return words.empty() ? "not operational" : words;
}

std::vector<std::string> changes_between(const MachineView& before, const MachineView& now) {
  std::vector<std::string> lines;
  const auto here = [](const MachineView& machine) { return machine.online ? "online" : "offline"; };
  add_change(lines, "machine", here(before), here(now));
  add_change(lines, "Berth", before.version, now.version);
  for (const auto& slot : now.slots) {
    const auto* const was = slot_named(before, slot.name);
    add_change(lines, "slot " + slot.name, was == nullptr ? "" : was->state, slot.state);
    if (was == nullptr) continue;
    add_change(lines, fmt::format("slot {}, configuration", slot.name), was->configuration, slot.configuration);
    add_change(lines, fmt::format("slot {}, program", slot.name), was->program, slot.program);
    add_change(lines, fmt::format("slot {}, EMCY", slot.name), was->emcy, slot.emcy);
  }
  for (const auto& slot : before.slots) {
    if (slot_named(now, slot.name) == nullptr) add_change(lines, "slot " + slot.name, slot.state, "");
  }
  return lines;
}

}  // namespace berth::fleet
