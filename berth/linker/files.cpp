#include "berth/linker/files.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <map>
#include <set>

#include "berth/eds/concise_dcf.hpp"
#include "berth/eds/cpj.hpp"
#include "berth/eds/dcf.hpp"
#include "berth/eds/eds.hpp"
#include "berth/eds/write.hpp"
#include "berth/linker/device_pdos_parts.hpp"
#include "berth/linker/plan_file.hpp"
#include "berth/linker/symbols.hpp"
#include "berth/linker/variable_sections_parts.hpp"
#include "berth/multilevel/routing_objects.hpp"
#include "berth/od/cia301.hpp"

namespace berth::linker {
namespace {

using co::PdoKind;
using eds::Parameter;

constexpr std::uint32_t no_rtr = 0x4000'0000;

/// The settings of one node, object by object.
class Settings {
 public:
  Settings(const LinkNetwork& network, const Plan& plan, std::size_t node)
      : network_(network), plan_(plan), at_(node), node_(network.nodes[node]), device_(pdos_of(node_)) {}

  std::vector<Parameter> run() {
    for (const Pdo& pdo : plan_.pdos) {
      if (pdo.producer == at_) send(pdo);
      for (const Receiver& each : pdo.receivers) {
        if (each.node == at_) receive(pdo, each);
      }
    }
    switch_off(PdoKind::tpdo);
    switch_off(PdoKind::rpdo);
    fill_lists();
    fill_routes();
    std::vector<Parameter> all;
    for (const auto& [object, value] : values_) all.push_back({object, type_of(object), value});
    return all;
  }

 private:
  od::DataType type_of(ObjectRef object) const {
    const auto* const sub = node_.file->description->find(object);
    return sub == nullptr ? od::DataType::none : sub->type;
  }
  void set(std::uint16_t index, unsigned sub, std::uint64_t raw) {
    const ObjectRef object{index, static_cast<std::uint8_t>(sub)};
    values_[object] = eds::with_formula(*node_.file->description, object, od::Literal::number(raw), node_.id);
  }

  void set_communication(PdoKind kind, const DevicePdo& pdo, std::uint32_t cob_id, TransmissionType type,
                         std::uint16_t inhibit, std::uint16_t event_ms) {
    const auto index = od::communication_index(kind, pdo.number);
    if (!pdo.fixed_id) set(index, 1, cob_id);
    if (!pdo.fixed_type) set(index, 2, type);
    if (pdo.has_inhibit && kind == PdoKind::tpdo) set(index, 3, inhibit);
    if (pdo.has_event) set(index, 5, event_ms);
    done_.insert({kind, pdo.number});
  }
  void set_mapping(PdoKind kind, const DevicePdo& pdo, const std::vector<co::PdoEntry>& entries) {
    if (pdo.fixed_mapping) return;
    const auto index = od::mapping_index(kind, pdo.number);
    set(index, 0, entries.size());
    for (std::size_t i = 0; i < entries.size(); ++i) set(index, static_cast<unsigned>(i + 1), entries[i].raw());
  }

  void send(const Pdo& pdo) {
    const DevicePdo* const device = device_.find(PdoKind::tpdo, pdo.tpdo);
    if (device == nullptr) return;
    const auto now = node_.file->description->find({od::communication_index(PdoKind::tpdo, pdo.tpdo), 1});
    const auto rtr = node_.file->description->default_of(*now).raw & no_rtr;
    set_communication(PdoKind::tpdo, *device, static_cast<std::uint32_t>(pdo.can_id | rtr), pdo.transmission,
                      pdo.inhibit, pdo.event_ms);
    if (pdo.mpdo) {
      set(od::mapping_index(PdoKind::tpdo, pdo.tpdo), 0, sam_mpdo);
      for (const Carried& each : pdo.carried) {
        scanner_.push_back(1U << 24U | static_cast<std::uint32_t>(each.object.index) << 8U | each.object.sub);
      }
      return;
    }
    std::vector<co::PdoEntry> entries;
    for (const Carried& each : pdo.carried) entries.push_back({each.object, each.bits});
    set_mapping(PdoKind::tpdo, *device, entries);
  }

  void receive(const Pdo& pdo, const Receiver& receiver) {
    const DevicePdo* const device = device_.find(PdoKind::rpdo, receiver.rpdo);
    if (device == nullptr) return;
    set_communication(PdoKind::rpdo, *device, pdo.can_id, receiver.transmission, 0, receiver.event_ms);
    if (!pdo.mpdo) return set_mapping(PdoKind::rpdo, *device, receiver.mapping);
    set(od::mapping_index(PdoKind::rpdo, receiver.rpdo), 0, sam_mpdo);
    for (const Received& each : receiver.received) {
      const ObjectRef from = pdo.carried[each.carried].object;
      dispatching_.push_back(std::uint64_t{1} << 56U | std::uint64_t{each.object.index} << 40U |
                             std::uint64_t{each.object.sub} << 32U | std::uint64_t{from.index} << 16U |
                             std::uint64_t{from.sub} << 8U | network_.nodes[pdo.producer].id.value());
    }
  }

  /// Switches off every PDO that no link uses: an earlier plan may have switched it on.
  void switch_off(PdoKind kind) {
    for (const DevicePdo& pdo : device_.of(kind)) {
      if (pdo.kept || pdo.fixed_id || done_.contains({kind, pdo.number})) continue;
      const ObjectRef object{od::communication_index(kind, pdo.number), 1};
      od::Literal value = node_.file->description->default_of(*node_.file->description->find(object));
      if (!value.present()) value = od::Literal::number(0);
      value.raw |= cob_id_invalid;
      values_[object] = value;
    }
  }

  /// Writes the rows up to the last one in use. Rows of the node's own configuration stay.
  void fill_routes() {
    using Objects = multilevel::RoutingObjects;
    std::map<unsigned, const Route*> rows;
    for (const Route& each : plan_.routes) {
      if (each.node == at_) rows[each.row] = &each;
    }
    if (rows.empty()) return;
    for (const Parameter& each : node_.file->parameters) {
      const bool by_hand = each.object.index == Objects::routes && each.object.sub != 0 && each.value.raw != 0;
      if (by_hand && !node_.linked_before) rows.try_emplace(each.object.sub, nullptr);
    }
    const unsigned last = rows.rbegin()->first;
    set(Objects::routes, 0, last);
    for (unsigned row = 1; row <= last; ++row) {
      const auto known = rows.find(row);
      if (known == rows.end()) {
        set(Objects::routes, row, 0);
      } else if (known->second != nullptr) {
        fill_route(row, *known->second);
      }
    }
  }
  void fill_route(unsigned row, const Route& route) {
    using Objects = multilevel::RoutingObjects;
    constexpr unsigned silent = 2, every = 0x80;
    set(Objects::routes, row, multilevel::RouteEntry{route.from, route.to, route.source, route.target}.raw());
    const auto budget = std::chrono::ceil<std::chrono::microseconds>(route.budget).count();
    set_if_there(Objects::budgets, row, static_cast<std::uint64_t>(budget));
    set_if_there(Objects::freshness, row, route.freshness_ms);
    set_if_there(Objects::stopped, row, (route.freshness_ms != 0 ? silent : 0U) | every);
  }
  void set_if_there(std::uint16_t index, unsigned sub, std::uint64_t raw) {
    if (node_.file->description->find({index, static_cast<std::uint8_t>(sub)}) != nullptr) set(index, sub, raw);
  }

  void fill_lists() {
    fill_list(od::cia301::first_scanner_list, scanner_);
    fill_list(od::cia301::first_dispatching_list, dispatching_);
  }
  /// Puts the entries in order into the sub-indices that exist, and 0 after them.
  template <class Entries>
  void fill_list(std::uint16_t first, const Entries& entries) {
    std::size_t next = 0;
    for (unsigned i = 0; i < od::cia301::most_mpdo_lists; ++i) {
      const auto index = static_cast<std::uint16_t>(first + i);
      for (unsigned sub = 1; sub < 255; ++sub) {
        const ObjectRef object{index, static_cast<std::uint8_t>(sub)};
        const auto* const there = node_.file->description->find(object);
        if (there == nullptr || !od::writable(there->access)) break;
        values_[object] = od::Literal::number(next < entries.size() ? entries[next] : 0);
        ++next;
      }
    }
  }

  const LinkNetwork& network_;
  const Plan& plan_;
  std::size_t at_;
  const Node& node_;
  DevicePdos device_;
  std::map<ObjectRef, od::Literal> values_;
  std::set<std::pair<PdoKind, unsigned>> done_;
  std::vector<std::uint32_t> scanner_;
  std::vector<std::uint64_t> dispatching_;
};

std::string slug(std::string_view name) {
  std::string made;
  for (const char c : name) {
    const bool plain =
        (c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z') || (c >= '0' && c <= '9') || c == '-' || c == '_';
    made += plain ? c : '_';
  }
  return made;
}

class FileMaker {
 public:
  FileMaker(const LinkNetwork& network, const Plan& plan) : network_(network), plan_(plan) {}

  tl::expected<std::vector<MadeFile>, std::string> run() {
    for (std::size_t node = 0; node < network_.nodes.size(); ++node) {
      if (!plan_.linked[node]) continue;
      if (const auto wrong = device_files(node); !wrong.empty()) return tl::unexpected(wrong);
    }
    files_.push_back({"network.cpj", eds::write_cpj(project()).text});
    files_.push_back({"plan.toml", write(earlier_of(network_, plan_))});
    return std::move(files_);
  }

 private:
  static std::string about(const Node& node, const Error& error) {
    return fmt::format("{}: no DCF can be made of its description: {}", node.name, describe(error));
  }

  std::string device_files(std::size_t at) {
    const Node& node = network_.nodes[at];
    auto base = with_variables(network_, plan_, at);
    if (!base) return fmt::format("{}: {}", node.name, base.error());
    eds::Configuration wanted{.parameters = settings_of(network_, plan_, at), .modified_by = linker_mark};
    wanted.commissioning = commissioning(node);
    for (const ObjectRef date : {ObjectRef{0x1020, 1}, ObjectRef{0x1020, 2}}) {
      const auto old = std::ranges::find(base->parameters, date, &Parameter::object);
      if (old != base->parameters.end()) wanted.parameters.push_back({date, old->type, {}});
    }
    wanted.file_name = file_stem(network_, at) + ".dcf";
    for (const Variable& each : plan_.variables) {
      if (each.node == at) wanted.denotations.push_back({each.object, each.name});
    }
    auto dcf = eds::make_dcf(*base, wanted);
    if (!dcf) return about(node, dcf.error());
    const auto concise = eds::concise_dcf(*base->description, merged(base->parameters, wanted.parameters), node.id);
    if (!concise) return about(node, concise.error());
    const auto stream = eds::encode(*concise);
    files_.push_back({wanted.file_name, std::move(*dcf)});
    files_.push_back({file_stem(network_, at) + ".cdcf", std::string(stream.begin(), stream.end())});
    const bool programmable =
        std::ranges::any_of(plan_.variables, [at](const Variable& each) { return each.node == at; });
    if (!programmable) return {};
    files_.push_back({file_stem(network_, at) + ".plcopen.xml", plcopen_xml(network_, plan_, at)});
    files_.push_back({file_stem(network_, at) + ".gvl.st", global_variables(network_, plan_, at)});
    return {};
  }

  static std::vector<Parameter> merged(const std::vector<Parameter>& base, const std::vector<Parameter>& ours) {
    std::map<ObjectRef, Parameter> all;
    for (const auto& each : base) all[each.object] = each;
    for (const auto& each : ours) all[each.object] = each;
    std::vector<Parameter> made;
    for (auto& [object, each] : all) {
      if (each.value.present()) made.push_back(std::move(each));
    }
    return made;
  }

  eds::Commissioning commissioning(const Node& node) const {
    eds::Commissioning made = node.file->commissioning.value_or(eds::Commissioning{});
    made.node_id = node.id;
    made.node_name = node.name;
    made.baud_rate = static_cast<std::uint16_t>(network_.buses[node.bus].others.bit_rate / 1000);
    made.network_name = network_.buses[node.bus].name;
    return made;
  }

  eds::Project project() const {
    eds::Project made;
    for (std::size_t bus = 0; bus < network_.buses.size(); ++bus) {
      eds::Topology topology{.number = static_cast<std::uint16_t>(bus + 1), .net_name = network_.buses[bus].name};
      for (std::size_t i = 0; i < network_.nodes.size(); ++i) {
        const Node& node = network_.nodes[i];
        if (node.bus != bus) continue;
        topology.nodes.push_back({.node_id = node.id.value(),
                                  .name = node.name,
                                  .dcf_name = plan_.linked[i] ? file_stem(network_, i) + ".dcf" : ""});
      }
      std::ranges::sort(topology.nodes, {}, &eds::ProjectNode::node_id);
      made.topologies.push_back(std::move(topology));
    }
    return made;
  }

  const LinkNetwork& network_;
  const Plan& plan_;
  std::vector<MadeFile> files_;
};

}  // namespace

std::string file_stem(const LinkNetwork& network, std::size_t node) {
  const std::string stem = slug(network.nodes[node].name);
  const auto twice = std::ranges::count_if(network.nodes, [&](const Node& n) { return same_word(slug(n.name), stem); });
  if (twice <= 1) return stem;
  const Node& it = network.nodes[node];
  return fmt::format("{}-{}-{}", stem, it.bus + 1, it.id.value());
}

std::vector<Parameter> settings_of(const LinkNetwork& network, const Plan& plan, std::size_t node) {
  return Settings(network, plan, node).run();
}

tl::expected<std::vector<MadeFile>, std::string> make_files(const LinkNetwork& network, const Plan& plan) {
  return FileMaker(network, plan).run();
}

}  // namespace berth::linker
