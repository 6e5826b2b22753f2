#include "berth/design/machine.hpp"

#include <algorithm>
#include <array>

#include "berth/base/words.hpp"

namespace berth::design {

std::vector<const Bus*> Machine::all_buses() const {
  std::vector<const Bus*> all;
  for (const auto* const part : {&buses, &beneath}) {
    for (const auto& each : *part) all.push_back(&each);
  }
  return all;
}

std::string gateway_node_name(const Bus& beneath) { return "gateway on " + beneath.name; }

const Bus* Machine::bus(std::string_view bus_name) const noexcept {
  const auto it = std::ranges::find(buses, bus_name, &Bus::name);
  if (it != buses.end()) return &*it;
  const auto under = std::ranges::find(beneath, bus_name, &Bus::name);
  return under == beneath.end() ? nullptr : &*under;
}

const Bus* Machine::top() const noexcept {
  const auto only = [&](const auto& is) -> const Bus* {
    const auto first = std::ranges::find_if(buses, is);
    const bool one = first != buses.end() && std::none_of(first + 1, buses.end(), is);
    return one ? &*first : nullptr;
  };
  const auto* const with_port = only([](const Bus& bus) { return bus.own_port; });
  return with_port != nullptr ? with_port : only([](const Bus& bus) { return !bus.gateway; });
}

const Bus* Machine::bus_beneath(const Bus& above, unsigned gateway, unsigned port) const noexcept {
  for (const auto* const part : {&buses, &beneath}) {
    for (const auto& each : *part) {
      const auto& way = each.gateway;
      if (way && way->bus == above.name && way->slot.value() == gateway && way->port == port) return &each;
    }
  }
  return nullptr;
}

const Slot* Machine::slot(std::string_view slot_name) const noexcept {
  const auto it = std::ranges::find_if(slots, [&](const Slot& s) { return s.spec.name.name == slot_name; });
  return it == slots.end() ? nullptr : &*it;
}

const Slot* Machine::slot(std::string_view bus_name, NodeId id) const noexcept {
  const auto it =
      std::ranges::find_if(slots, [&](const Slot& s) { return s.spec.name.bus == bus_name && s.spec.id == id; });
  return it == slots.end() ? nullptr : &*it;
}

std::vector<const Slot*> Machine::slots_named(std::string_view bus_name, std::string_view word) const {
  std::vector<const Slot*> exact;
  std::vector<const Slot*> like;
  for (const auto& each : slots) {
    const auto& known = each.spec.name;
    if (!bus_name.empty() && known.bus != bus_name) continue;
    const std::string path = known.bus + "/" + known.name;
    if (known.name == word || path == word) exact.push_back(&each);
    if (same_word(known.name, word) || same_word(path, word)) like.push_back(&each);
  }
  return exact.empty() ? like : exact;
}

std::shared_ptr<const od::Description> Machine::description(std::string_view bus_name, NodeId id) const noexcept {
  const auto named = std::ranges::find(described, id, &Described::node);
  if (named != described.end()) return named->description;
  if (const Slot* const known = slot(bus_name, id); known != nullptr && known->description) return known->description;
  const auto any = std::ranges::find(described, NodeId(), &Described::node);
  return any == described.end() ? nullptr : any->description;
}

std::vector<places::SlotSpec> Machine::specs(std::string_view bus_name) const {
  std::vector<places::SlotSpec> out;
  for (const auto& s : slots) {
    if (s.spec.name.bus == bus_name) out.push_back(s.spec);
  }
  return out;
}

bool is_canopen_bitrate(std::uint32_t bitrate) noexcept {
  constexpr std::array<std::uint32_t, 8> rates{10'000, 20'000, 50'000, 125'000, 250'000, 500'000, 800'000, 1'000'000};
  return std::ranges::find(rates, bitrate) != rates.end();
}

}  // namespace berth::design
