#include "berth/document/bus_signals.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <map>

#include "berth/co/cob_id.hpp"
#include "berth/od/pdo_objects.hpp"
#include "berth/traffic/configured_values.hpp"

namespace berth::document {
namespace {

struct Pdo {
  std::uint32_t key = 0;
  unsigned number = 1;
  bool is_mpdo = false;
  rt::Duration timer{};
  std::vector<Signal> signals{};
};

std::string name_of(const od::Description& description, ObjectRef ref) {
  const auto* const object = description.find(ref.index);
  const auto* const sub = description.find(ref);
  if (object == nullptr || sub == nullptr) return {};
  const std::string whole(description.name(*object));
  const std::string part(description.name(*sub));
  if (object->count <= 1 || part == whole || whole.empty()) return part.empty() ? whole : part;
  return part.empty() ? whole : whole + " " + part;
}

std::vector<Signal> mapped(const DescribedSlot& device, const std::vector<od::PdoEntry>& entries) {
  std::vector<Signal> signals;
  const auto& description = device.values->description();
  unsigned at = 0;
  for (const auto& entry : entries) {
    if (entry.bits == 0 || at + entry.bits > od::most_pdo_bits) break;
    Signal signal{.name = name_of(description, entry.object), .object = entry.object, .at = at, .bits = entry.bits};
    const auto* const described = description.find(entry.object);
    if (described != nullptr) signal.type = described->type;
    const auto variable = std::ranges::find(device.variables, entry.object, &linker::Variable::object);
    if (variable != device.variables.end()) {
      signal.name = variable->name;
      signal.type = variable->type;
    }
    if (device.notes) signal.meaning = command::meaning_of(device.notes->of(entry.object), signal.type);
    at += entry.bits;
    if (!entry.dummy()) signals.push_back(std::move(signal));
  }
  return signals;
}

// The valid PDOs of one kind.
std::vector<Pdo> pdos_of(const DescribedSlot& device, od::PdoKind kind) {
  std::vector<Pdo> pdos;
  od::for_each_communication(device.values->description(), kind, [&](unsigned number) {
    const auto parameters = od::read_pdo(*device.values, kind, number);
    if (!parameters.cob_id.valid()) return;
    Pdo pdo{.key = parameters.cob_id.key(), .number = number, .is_mpdo = parameters.is_mpdo()};
    pdo.timer = std::chrono::milliseconds(parameters.timer);
    pdo.signals = mapped(device, parameters.entries);
    pdos.push_back(std::move(pdo));
  });
  return pdos;
}

unsigned bytes_of(const Pdo& pdo) noexcept {
  if (pdo.is_mpdo) return 8;
  return pdo.signals.empty() ? 0 : (pdo.signals.back().at + pdo.signals.back().bits + 7) / 8;
}

class Collector {
 public:
  explicit Collector(const design::Bus& bus) : bus_(bus) {
    made_.bus = bus.name;
    made_.bit_rate = bus.bitrate;
  }

  BusSignals run(const std::vector<DescribedSlot>& slots) {
    for (const auto& each : slots) {
      if (each.slot->spec.name.bus == bus_.name) here_.push_back(&each);
    }
    for (const DescribedSlot* const each : here_) add_services(*each);
    for (const DescribedSlot* const each : here_) add_tpdos(*each);
    for (const DescribedSlot* const each : here_) add_rpdos(*each);
    add_master();
    for (auto& [key, message] : messages_) made_.messages.push_back(std::move(message));
    return std::move(made_);
  }

 private:
  // The first message added for an identifier counts.
  Message& add(std::uint32_t key, std::string name, const std::string& sender, unsigned bytes) {
    const auto [it, added] = messages_.try_emplace(key);
    if (added) it->second = {.key = key, .name = std::move(name), .sender = sender, .bytes = bytes};
    return it->second;
  }

  void add_services(const DescribedSlot& device) {
    const auto& spec = device.slot->spec;
    const unsigned id = spec.id.value();
    made_.senders.push_back(spec.name.name);
    const co::CobId emcy(device.values ? device.values->get_or<std::uint32_t>({0x1014, 0}, 0x80U + id) : 0x80 + id);
    if (emcy.valid()) {
      add(emcy.key(), "EMCY", spec.name.name, 8).signals = {
          {.name = "error code", .at = 0, .bits = 16, .type = od::DataType::unsigned16},
          {.name = "error register", .object = {0x1001, 0}, .at = 16, .bits = 8, .type = od::DataType::unsigned8}};
    }
    add(0x580 + id, "SDO response", spec.name.name, 8);
    add(0x600 + id, "SDO request to " + spec.name.name, "master", 8);
    add_heartbeat(spec.name.name, id);
  }

  void add_heartbeat(const std::string& sender, unsigned id) {
    Signal state{.name = "NMT state", .at = 0, .bits = 7, .type = od::DataType::unsigned8};
    state.meaning.values = {{0, "boot-up"}, {4, "stopped"}, {5, "operational"}, {127, "pre-operational"}};
    Message& heartbeat = add(0x700 + id, "heartbeat", sender, 1);
    heartbeat.signals = {std::move(state)};
    heartbeat.period = bus_.timing.heartbeat_period;
  }

  void add_tpdos(const DescribedSlot& device) {
    if (!device.values) return;
    for (Pdo& pdo : pdos_of(device, od::PdoKind::tpdo)) {
      const std::string name = fmt::format("TPDO {}", pdo.number);
      Message& message = add(pdo.key, name, device.slot->spec.name.name, bytes_of(pdo));
      const bool ours = message.name == name && message.sender == device.slot->spec.name.name;
      if (!ours) continue;  // two devices send with one identifier
      if (pdo.timer > rt::Duration{0}) message.period = pdo.timer;
      message.signals = std::move(pdo.signals);
    }
  }

  // Follows the RPDO's own mapping bit by bit: the device does not receive bits that the mapping skips.
  void add_rpdos(const DescribedSlot& device) {
    if (!device.values) return;
    for (Pdo& pdo : pdos_of(device, od::PdoKind::rpdo)) {
      const auto known = messages_.find(pdo.key);
      const auto& name = device.slot->spec.name.name;
      if (known == messages_.end()) {
        Message& message = add(pdo.key, fmt::format("RPDO {} of {}", pdo.number, name), "", bytes_of(pdo));
        message.signals = pdo.signals;
        for (Signal& signal : message.signals) signal.receivers = {name};
        continue;
      }
      for (Signal& sent : known->second.signals) {
        const bool taken = std::ranges::any_of(
            pdo.signals, [&](const Signal& s) { return s.at < sent.at + sent.bits && sent.at < s.at + s.bits; });
        const bool told = std::ranges::find(sent.receivers, name) != sent.receivers.end();
        if (taken && !told) sent.receivers.push_back(name);
      }
    }
  }

  void add_master() {
    made_.senders.emplace_back("master");
    add(0, "NMT", "master", 2).signals = {{.name = "command",
                                           .at = 0,
                                           .bits = 8,
                                           .type = od::DataType::unsigned8,
                                           .meaning = {.values = {{1, "start"},
                                                                  {2, "stop"},
                                                                  {128, "enter pre-operational"},
                                                                  {129, "reset node"},
                                                                  {130, "reset communication"}}}},
                                          {.name = "node-ID", .at = 8, .bits = 8, .type = od::DataType::unsigned8}};
    if (bus_.master.configured()) add_heartbeat("master", bus_.master.value());
    if (!bus_.sync) return;
    Message& sync = add(0x80, "SYNC", "master", bus_.sync->counter != 0 ? 1 : 0);
    sync.period = bus_.sync->period;
  }

  const design::Bus& bus_;
  std::vector<const DescribedSlot*> here_;
  std::map<std::uint32_t, Message> messages_;
  BusSignals made_;
};

}  // namespace

std::vector<DescribedSlot> configured_slots(const design::Machine& machine, const traffic::LinkPlan* links) {
  std::vector<DescribedSlot> all;
  std::map<std::pair<std::shared_ptr<const od::Description>, std::string>, std::shared_ptr<const command::NoteBook>>
      books;
  for (std::size_t i = 0; i < machine.slots.size(); ++i) {
    DescribedSlot& each = all.emplace_back();
    each.slot = &machine.slots[i];
    each.values = traffic::configured_values(machine.slots[i], links, i);
    const auto& description = each.slot->description;
    auto& book = books[{description, each.slot->eds_path}];
    if (!book) book = std::make_shared<command::NoteBook>(description, each.slot->eds_path);
    each.notes = book;
    if (links == nullptr) continue;
    for (const auto& variable : links->plan.variables) {
      if (variable.node == i) each.variables.push_back(variable);
    }
  }
  return all;
}

BusSignals signals_of(const design::Bus& bus, const std::vector<DescribedSlot>& slots) {
  return Collector(bus).run(slots);
}

}  // namespace berth::document
