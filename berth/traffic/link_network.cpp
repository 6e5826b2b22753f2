#include "berth/traffic/link_network.hpp"

#include <algorithm>
#include <array>
#include <filesystem>
#include <map>
#include <memory>

#include "berth/base/words.hpp"
#include "berth/eds/concise_dcf.hpp"
#include "berth/eds/xdd.hpp"
#include "berth/linker/files.hpp"
#include "berth/linker/plan_file.hpp"
#include "berth/od/names.hpp"
#include "berth/text/file.hpp"
#include "berth/traffic/bus_messages.hpp"

namespace berth::traffic {
namespace {

using FilePtr = std::shared_ptr<const eds::File>;

class Builder {
 public:
  explicit Builder(const design::Machine& machine) : machine_(machine) {}

  LinkNetwork run() {
    auto& network = made_.network;
    network.name = machine_.name;
    network.file = machine_.file;
    for (const auto* const bus : machine_.all_buses()) network.buses.push_back(bus_of(*bus));
    for (const auto& slot : machine_.slots) network.nodes.push_back(node_of(slot));
    for (const auto* const bus : machine_.all_buses()) add_gateway(*bus);
    for (const auto& link : machine_.links) network.links.push_back(link_of(link));
    return std::move(made_);
  }

 private:
  void error(const std::string& file, std::string message, std::string fix) {
    made_.findings.push_back({Finding::Severity::error, file, 0, 0, "", std::move(message), std::move(fix)});
  }

  linker::Bus bus_of(const design::Bus& bus) const {
    auto found = messages_of(machine_, bus, {.pdos = false});
    linker::Bus made{.name = bus.name, .master = {}};
    if (bus.role != design::Role::observer) made.master = bus.master;
    made.others = std::move(found.line);
    for (const auto& channel : bus.channels)
      made.channels.insert(made.channels.end(), {channel.request, channel.request + 1});
    for (const auto& message : made.others.messages) {
      if (message.name != "SYNC") continue;
      made.sync = made.sync.count() == 0 ? message.period : std::min(made.sync, message.period);
      made.sync_key = message.key;
    }
    return made;
  }

  // Reads each file once: forty slots of one type have one description.
  FilePtr read(const std::string& path) {
    const auto [known, fresh] = files_.try_emplace(path);
    if (!fresh) return known->second;
    auto reading = eds::read_any_file(path);
    if (!reading.usable()) {
      for (const auto& each : reading.findings) {
        if (each.severity == Finding::Severity::error) made_.findings.push_back(each);
      }
    } else {
      known->second = std::make_shared<const eds::File>(std::move(reading.file));
    }
    return known->second;
  }

  // Distinguishes them as manager::load_configuration does.
  static bool is_concise(const std::string& path) {
    return std::ranges::none_of(std::array{".dcf", ".eds", ".xdc", ".xdd"}, [&](std::string_view end) {
      return path.size() >= end.size() && same_word(std::string_view(path).substr(path.size() - end.size()), end);
    });
  }

  FilePtr with_concise(const FilePtr& base, const std::string& path, NodeId id) {
    const auto bytes = text::read_file(path, made_.findings);
    if (!bytes) return nullptr;
    const std::vector<std::uint8_t> stream(bytes->begin(), bytes->end());
    const auto dcf = eds::decode_concise_dcf(stream);
    const auto values = dcf ? eds::parameters(*dcf, *base->description, id) : tl::unexpected(dcf.error());
    if (!values) {
      error(path, describe(values.error()), "give a concise DCF for the device that the slot describes");
      return nullptr;
    }
    auto file = std::make_shared<eds::File>(*base);
    file->parameters = *values;
    return file;
  }

  linker::Node node_of(const design::Slot& slot) {
    linker::Node node{.name = slot.spec.name.name, .id = slot.spec.id};
    node.interval = slot.inhibit.value_or(rt::Duration(0));
    const auto& buses = made_.network.buses;
    const auto bus = std::ranges::find(buses, slot.spec.name.bus, &linker::Bus::name);
    node.bus = static_cast<std::size_t>(bus - buses.begin());
    const std::string& config = slot.spec.config;
    if (!config.empty() && !is_concise(config)) {
      node.file = read(config);
      node.linked_before = node.file && linker::written_by_linker(*node.file);
      return node;
    }
    if (slot.eds_path.empty()) return node;
    node.file = read(slot.eds_path);
    if (node.file && !config.empty()) node.file = with_concise(node.file, config, node.id);
    return node;
  }

  [[nodiscard]] std::size_t bus_index(const std::string& name) const {
    const auto& buses = made_.network.buses;
    return static_cast<std::size_t>(std::ranges::find(buses, name, &linker::Bus::name) - buses.begin());
  }
  [[nodiscard]] std::size_t slot_index(const design::Slot& slot) const {
    return static_cast<std::size_t>(&slot - machine_.slots.data());
  }

  // Adds, after the slots, each gateway's own node on a bus where Berth has no port.
  void add_gateway(const design::Bus& bus) {
    if (!bus.gateway) return;
    const auto* const above = machine_.slot(bus.gateway->bus, bus.gateway->slot);
    if (above == nullptr) return;
    auto& network = made_.network;
    linker::Gateway gateway{.above = slot_index(*above), .bus = bus_index(bus.name)};
    gateway.port = bus.gateway->port;
    gateway.delay = bus.gateway->delay;
    if (bus.own_port) {
      const auto* const node = machine_.slot(bus.name, bus.gateway->node);
      if (node != nullptr) gateway.beneath = slot_index(*node);
    } else if (!bus.gateway->eds_path.empty()) {
      gateway.beneath = network.nodes.size();
      network.buses[gateway.bus].master = {};  // this node's own identifiers
      network.nodes.push_back({.name = design::gateway_node_name(bus), .bus = gateway.bus, .id = bus.master});
      network.nodes.back().file = read(bus.gateway->eds_path);
    }
    network.gateways.push_back(gateway);
  }

  linker::End end_of(const design::LinkEnd& end) const {
    const auto slot =
        std::ranges::find_if(machine_.slots, [&](const auto& each) { return each.spec.name.name == end.slot; });
    return {static_cast<std::size_t>(slot - machine_.slots.begin()), end.object};
  }

  linker::Link link_of(const design::Link& link) const {
    linker::Link made{.from = end_of(link.from), .to = {}, .transmission = link.transmission, .type = link.type};
    for (const auto& end : link.to) made.to.push_back(end_of(end));
    if (link.deadline) made.deadline = *link.deadline;
    if (link.inhibit) made.inhibit = *link.inhibit;
    made.place = {link.place.line, link.place.column};
    return made;
  }

  const design::Machine& machine_;
  LinkNetwork made_;
  std::map<std::string, FilePtr> files_;
};

}  // namespace

LinkNetwork link_network(const design::Machine& machine) { return Builder(machine).run(); }

std::optional<linker::Earlier> earlier_plan(const design::Machine& machine, Findings& findings) {
  std::error_code ignored;
  if (machine.link_plan.empty() || !std::filesystem::exists(machine.link_plan, ignored)) return linker::Earlier{};
  const auto text = text::read_file(machine.link_plan, findings);
  return text ? linker::read_plan(*text, machine.link_plan, findings) : std::nullopt;
}

LinkPlan plan_links(const design::Machine& machine) {
  LinkPlan made;
  auto [network, wrong] = link_network(machine);
  made.findings = std::move(wrong);
  const auto earlier = earlier_plan(machine, made.findings);
  if (!has_errors(made.findings) && earlier) {
    auto planned = linker::make_plan(network, *earlier);
    made.findings = std::move(planned.findings);
    made.plan = std::move(planned.plan);
  }
  made.network = std::move(network);
  return made;
}

manager::SlotSettings settings_of(const LinkPlan& links) {
  manager::SlotSettings made;
  for (std::size_t i = 0; i < links.network.nodes.size(); ++i) {
    if (!links.plan.linked[i]) continue;
    const auto& node = links.network.nodes[i];
    manager::Configuration configuration;
    configuration.file = links.network.file;
    for (auto& each : linker::settings_of(links.network, links.plan, i)) {
      configuration.settings.push_back({.object = each.object,
                                        .type = each.type,
                                        .value = std::move(each.value),
                                        .name = od::full_name(*node.file->description, each.object)});
    }
    made.emplace(node.name, std::make_shared<const manager::Configuration>(std::move(configuration)));
  }
  return made;
}

}  // namespace berth::traffic
