#include "berth/tree/gateway_settings.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>

#include "berth/od/paper3.hpp"
#include "berth/tree/way.hpp"

namespace berth::tree {
namespace {

bool is_beneath(const design::Bus& line, const design::Slot& slot) noexcept {
  return line.gateway && line.gateway->bus == slot.spec.name.bus && line.gateway->slot == slot.spec.id;
}

manager::Setting setting(ObjectRef object, od::DataType type, std::uint64_t value, std::string name) {
  return {.object = object, .type = type, .value = od::Literal::number(value), .name = std::move(name)};
}

manager::Configuration of_gateway(const design::Machine& machine, const design::Slot& slot) {
  manager::Configuration made;
  made.file = machine.file;
  std::array<std::uint32_t, 4> speakers{};
  for (const auto& line : machine.beneath) {
    if (!is_beneath(line, slot)) continue;
    for (const auto& deeper : machine.beneath) {
      const unsigned node = deeper.gateway->slot.value();
      if (deeper.gateway->bus == line.name) speakers.at(node / 32) |= 1U << node % 32;
    }
    made.settings.push_back(setting({od::paper3::mandatory_buses, line.gateway->port}, od::DataType::unsigned8,
                                    line.gateway->mandatory ? 1 : 0,
                                    fmt::format("Downstream bus is mandatory ({})", line.name)));
  }
  const auto layout = layout_of(machine, way_to(machine, slot.spec.name.bus).bus);
  made.settings.push_back(
      setting(od::paper3::emcy_layout, od::DataType::unsigned8, static_cast<std::uint64_t>(layout), "EMCY layout"));
  for (std::uint8_t sub = 1; sub <= speakers.size(); ++sub) {
    made.settings.push_back(setting({od::paper3::layout_speakers, sub}, od::DataType::unsigned32, speakers.at(sub - 1U),
                                    "Nodes with the EMCY layout"));
  }
  std::ranges::sort(made.settings, {}, &manager::Setting::object);
  return made;
}

}  // namespace

multilevel::EmcyLayout layout_of(const design::Machine& machine, const std::string& top) {
  std::size_t levels = 1;
  for (const auto& line : machine.beneath) {
    const Way way = way_to(machine, line.name);
    if (way.bus == top) levels = std::max(levels, 1 + way.gateways.size());
  }
  return multilevel::layout_for(levels);
}

bool is_gateway(const design::Machine& machine, const design::Slot& slot) noexcept {
  return std::ranges::any_of(machine.beneath, [&](const design::Bus& line) { return is_beneath(line, slot); });
}

manager::SlotSettings with_gateways(const design::Machine& machine, const std::string& bus,
                                    const manager::SlotSettings& settings) {
  manager::SlotSettings made = settings;
  for (const auto& slot : machine.slots) {
    if (slot.spec.name.bus != bus || !is_gateway(machine, slot)) continue;
    const auto own = of_gateway(machine, slot);
    auto& place = made[slot.spec.name.name];
    place = std::make_shared<const manager::Configuration>(place ? manager::joined(*place, own) : own);
  }
  return made;
}

}  // namespace berth::tree
