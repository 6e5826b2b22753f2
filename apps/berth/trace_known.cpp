#include "trace_known.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <charconv>
#include <filesystem>
#include <map>

#include "berth/command/notes.hpp"
#include "berth/eds/xdd.hpp"
#include "berth/manager/configuration.hpp"
#include "berth/traffic/link_network.hpp"
#include "berth/tree/beneath.hpp"
#include "node_words.hpp"

namespace berth::cli {
namespace {

using Described = tl::expected<std::shared_ptr<const od::Description>, Failure>;

Described description(const std::string& path) {
  auto reading = eds::read_any_file(path);
  if (!reading.usable()) return tl::unexpected(failure(reading.findings));
  return reading.file.description;
}

bool describes(const std::string& path) {
  const auto ending = std::filesystem::path(path).extension().string();
  return ending == ".dcf" || ending == ".eds" || ending == ".xdc" || ending == ".xdd";
}

// Reports errors in the notes, and reads the trace without them.
std::shared_ptr<const decode::ValueWords> words_of(const std::shared_ptr<const od::Description>& description,
                                                   const std::string& file) {
  command::NoteBook notes(description, file);
  if (!notes.problem().empty()) print_errors(notes.problem());
  return std::make_shared<command::NoteWords>(std::move(notes));
}

// The values that the device gets in addition to its defaults.
void add_settings(decode::Profile& profile, const manager::Configuration& configuration, NodeId node) {
  const auto wanted = manager::wanted(configuration, node);
  if (!wanted) return;
  for (const auto& entry : wanted->entries) profile.settings.emplace_back(entry.object, entry.bytes);
}

}  // namespace

tl::expected<KnownNodes, Failure> KnownNodes::load(const Options& options, const TraceOptions& trace) {
  KnownNodes known;
  if (!options.machine.empty()) {
    if (auto bad = known.add_machine(options)) return tl::unexpected(std::move(*bad));
  }
  for (const auto& text : trace.eds) {
    if (auto bad = known.add_eds(text, trace)) return tl::unexpected(std::move(*bad));
  }
  return known;
}

std::optional<Failure> KnownNodes::add_machine(const Options& options) {
  auto loaded = design::load_machine(options.machine, options.files.allow_outside);
  if (!loaded.machine) return failure(loaded.findings);
  machine_ = std::move(*loaded.machine);
  struct Read {
    std::shared_ptr<const od::Description> description;
    std::shared_ptr<const decode::ValueWords> words;
  };
  std::map<std::string, Read> read;
  for (const auto& slot : machine_->slots) {
    Known known{slot.spec.name.bus, slot.spec.id, {.name = slot.spec.name.name, .description = nullptr}};
    // A configuration that is a description itself has the values that the device is given.
    const std::string& file = !slot.eds_path.empty()        ? slot.eds_path
                              : describes(slot.spec.config) ? slot.spec.config
                                                            : "";
    if (!file.empty()) {
      auto& found = read[file];
      if (!found.description) {
        auto described = description(file);
        if (!described) return described.error();
        found = {*described, words_of(*described, file)};
      }
      known.profile.description = found.description;
      known.profile.words = found.words;
    } else {
      known.profile.description = slot.description;  // the library's description
    }
    if (!slot.spec.config.empty() && known.profile.description) {
      const auto configuration = manager::load_configuration(slot.spec.config);
      if (!configuration.usable()) return failure(configuration.findings);
      add_settings(known.profile, configuration.configuration, slot.spec.id);
    }
    nodes_.push_back(std::move(known));
  }
  add_links();
  return std::nullopt;
}

// The PDOs that `berth up` makes for the machine's links.
void KnownNodes::add_links() {
  if (machine_->links.empty()) return;
  const auto planned = traffic::plan_links(*machine_);
  if (has_errors(planned.findings)) {
    print_errors(failure(planned.findings).message);
    return print_errors("the links have no plan: PDOs are shown as the devices' files define them");
  }
  for (const auto& [slot, configuration] : traffic::settings_of(planned)) {
    const auto known = std::ranges::find(nodes_, slot, [](const Known& each) { return each.profile.name; });
    if (known == nodes_.end()) continue;
    add_settings(known->profile, *configuration, known->node);
  }
  // Names network variables as the links do.
  for (const auto& variable : linker::earlier_of(planned.network, planned.plan).variables) {
    const auto known = std::ranges::find(nodes_, variable.node, [](const Known& each) { return each.profile.name; });
    if (known != nodes_.end()) known->profile.named.push_back({variable.object, variable.name, variable.type});
  }
}

std::optional<Failure> KnownNodes::add_eds(const std::string& text, const TraceOptions& trace) {
  const auto equals = text.find('=');
  unsigned node = 0;
  std::string path = text;
  if (equals != std::string::npos) {
    const auto [end, bad] = std::from_chars(text.data(), text.data() + equals, node);
    if (bad == std::errc{} && end == text.data() + equals) path = text.substr(equals + 1);
    if (bad != std::errc{} || end != text.data() + equals) node = 0;
  }
  if (node == 0 && trace.nodes.size() == 1) {
    const auto meant = multilevel::parse_path(trace.nodes.front());
    if (meant) node = meant->node.value();
  }
  const auto id = NodeId::make(node);
  if (!id || !id->configured())
    return failure(Exit::usage, fmt::format("--eds {}: of which node? Write --eds 5={}, or one --node", text, path));
  auto described = description(path);
  if (!described) return described.error();
  // The user's choice here has priority over the machine file.
  std::erase_if(nodes_, [&](const Known& k) { return k.node == *id; });
  nodes_.push_back(
      {{}, *id, {.name = {}, .description = *described, .settings = {}, .words = words_of(*described, path)}});
  return std::nullopt;
}

bool NodeView::has(const std::string& machine_bus, unsigned node, const std::optional<multilevel::Path>& about,
                   bool ports_told) const {
  if (!bus.empty() && bus != machine_bus) return false;
  if (path.gateways.empty()) return node == path.node.value();
  if (!about || about->node != path.node) return false;
  return ports_told ? about->gateways == path.gateways
                    : std::ranges::equal(about->gateways, path.gateways, {}, &multilevel::Hop::gateway,
                                         &multilevel::Hop::gateway);
}

// For each bus on the way: the rest of the path.
std::vector<NodeView> KnownNodes::views_from(const design::Bus& top, const multilevel::Path& path) const {
  std::vector<NodeView> all;
  const design::Bus* at = &top;
  multilevel::Path left = path;
  while (at != nullptr) {
    all.push_back({at->name, left});
    if (left.gateways.empty()) return all;
    at = machine_->bus_beneath(*at, left.gateways.front().gateway.value(), left.gateways.front().port);
    left.gateways.erase(left.gateways.begin());
  }
  return {};
}

tl::expected<std::vector<NodeView>, Failure> KnownNodes::views(const std::string& word) const {
  const auto path = multilevel::parse_path(word);
  if (path && (path->gateways.empty() || !machine_)) return std::vector<NodeView>{{.path = *path}};
  if (!machine_) {
    return tl::unexpected(failure(Exit::usage, fmt::format("--node {}: write a node-ID from 1 to 127, a path such as "
                                                           "3/5, or with --machine a slot's name",
                                                           word)));
  }
  std::vector<NodeView> all;
  for (const auto& top : machine_->buses) {
    if (!path) break;
    const auto more = views_from(top, *path);
    all.insert(all.end(), more.begin(), more.end());
  }
  if (!all.empty()) return all;
  const auto meant = meant_node(*machine_, {}, word);
  if (!meant) return tl::unexpected(meant.error());
  const auto way = tree::way_to(*machine_, meant->bus->name);
  return views_from(*machine_->bus(way.bus), {way.gateways, meant->node});
}

tl::expected<std::vector<NodeView>, Failure> KnownNodes::views(const std::vector<std::string>& words) const {
  std::vector<NodeView> all;
  for (const auto& word : words) {
    const auto more = views(word);
    if (!more) return tl::unexpected(more.error());
    all.insert(all.end(), more->begin(), more->end());
  }
  return all;
}

std::bitset<128> KnownNodes::gateways(const std::string& machine_bus) const {
  std::bitset<128> nodes;
  if (!machine_) return nodes;
  for (const auto* const bus : machine_->all_buses()) {
    if (bus->gateway && bus->gateway->bus == machine_bus) nodes.set(bus->gateway->slot.value());
  }
  return nodes;
}

std::string KnownNodes::machine_bus(const std::string& log_name) const {
  if (!machine_) return {};
  if (machine_->bus(log_name) != nullptr) return log_name;
  for (const auto& bus : machine_->buses) {
    if (!bus.port.address.empty() && bus.port.address == log_name) return bus.name;
  }
  return machine_->buses.size() == 1 ? machine_->buses.front().name : std::string();
}

void KnownNodes::tell(decode::Decoder& decoder, std::uint16_t bus, const std::string& log_name) const {
  const std::string name = machine_bus(log_name);
  for (const auto& known : nodes_) {
    if (known.bus.empty() || known.bus == name) decoder.know(bus, known.node, known.profile);
  }
}

}  // namespace berth::cli
