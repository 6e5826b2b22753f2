#include "contradictions.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <utility>

namespace berth::cli {
namespace {

const plant::PlantDevice* device_of(const plant::PlantFile& plant, std::string_view name) {
  const auto it = std::ranges::find(plant.devices, name, &plant::PlantDevice::name);
  return it == plant.devices.end() ? nullptr : &*it;
}

// The plant's device that is a gateway's own node on this bus beneath; null: none.
const plant::PlantDevice* own_node_on(const plant::PlantFile& plant, const design::Bus& bus) {
  for (const auto& gateway : plant.gateways) {
    for (const auto& name : gateway.beneath) {
      const auto* const device = device_of(plant, name);
      if (device != nullptr && device->bus == bus.name) return device;
    }
  }
  return nullptr;
}

class Contradictions {
 public:
  Contradictions(const design::Machine& machine, const plant::PlantFile& plant, std::string plant_file)
      : machine_(machine), plant_(plant), file_(std::move(plant_file)) {}

  Findings find() {
    for (const auto& bus : machine_.beneath) {
      const bool here = bus.gateway &&
                        std::ranges::find(plant_.buses, bus.gateway->bus, &plant::PlantBus::name) != plant_.buses.end();
      if (here) own_node(bus);
    }
    for (const auto& gateway : plant_.gateways) signals(gateway);
    return std::move(found_);
  }

 private:
  void warn(const std::string& what, std::string message, std::string fix) {
    found_.push_back({Finding::Severity::warning, file_, 0, 0, what, std::move(message), std::move(fix)});
  }

  // A bus beneath has its own master, so Berth needs only the gateway's own node there.
  void own_node(const design::Bus& bus) {
    const auto* const device = own_node_on(plant_, bus);
    if (device == nullptr) {
      return warn("bus." + bus.name,
                  "the machine file has this bus beneath a gateway, and no [[gateway]] here has a device on it",
                  "add the gateway's device there, and name it in beneath = [...] of a [[gateway]]");
    }
    if (device->node_id != bus.master) {
      warn(device->name,
           fmt::format("it is the gateway's own node on bus {}, which has node-ID {} in the machine file (master_id)",
                       bus.name, bus.master.value()),
           fmt::format("node_id = {}", bus.master.value()));
    }
    if (!device->does.master) {
      warn(device->name,
           fmt::format("it is the gateway's own node on bus {}, and no NMT master: its nodes would not be started",
                       bus.name),
           device->eds_path.empty() ? "master = { flying = false }"
                                    : "master = { flying = false } with type = { ... } instead of eds");
    }
  }

  [[nodiscard]] bool crosses(const design::Link& link, const std::string& above,
                             const std::vector<std::string>& beneath) const {
    const auto bus_of = [&](const design::LinkEnd& end) {
      const auto* const slot = machine_.slot(end.slot);
      return slot == nullptr ? std::string() : slot->spec.name.bus;
    };
    const auto within = [&](const std::string& bus) { return std::ranges::find(beneath, bus) != beneath.end(); };
    const std::string from = bus_of(link.from);
    return std::ranges::any_of(link.to, [&](const design::LinkEnd& end) {
      const std::string to = bus_of(end);
      return (from == above && within(to)) || (within(from) && to == above) ||
             (within(from) && within(to) && from != to);
    });
  }

  // A built-in gateway device has only as many places for signals as the plant file says.
  void signals(const plant::PlantGateway& gateway) {
    const auto* const above = device_of(plant_, gateway.above);
    if (above == nullptr || gateway.signals > 0 || !above->eds_path.empty()) return;
    std::vector<std::string> beneath;
    for (const auto& name : gateway.beneath) {
      if (const auto* const device = device_of(plant_, name)) beneath.push_back(device->bus);
    }
    const auto many = static_cast<std::size_t>(std::ranges::count_if(
        machine_.links, [&](const design::Link& link) { return crosses(link, above->bus, beneath); }));
    if (many == 0) return;
    warn(gateway.above, "links of the machine file cross this gateway, and its [[gateway]] has no places for signals",
         fmt::format("signals = {}", std::max<std::size_t>(4, many)));
  }

  const design::Machine& machine_;
  const plant::PlantFile& plant_;
  std::string file_;
  Findings found_;
};

}  // namespace

Findings contradictions(const design::Machine& machine, const plant::PlantFile& plant, const std::string& plant_file) {
  return Contradictions(machine, plant, plant_file).find();
}

}  // namespace berth::cli
