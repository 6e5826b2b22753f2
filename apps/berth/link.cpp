// `berth link`: makes PDOs, network variables and files from the links of a machine file.
#include <fmt/format.h>

#include <algorithm>
#include <filesystem>
#include <nlohmann/json.hpp>

#include "berth/command/can_id_text.hpp"
#include "berth/linker/files.hpp"
#include "berth/linker/plan_file.hpp"
#include "berth/od/notation.hpp"
#include "berth/text/columns.hpp"
#include "berth/text/file.hpp"
#include "berth/traffic/bus_messages.hpp"
#include "berth/traffic/link_network.hpp"
#include "crossing_words.hpp"
#include "machine_file.hpp"
#include "node_words.hpp"
#include "outputs.hpp"
#include "verbs.hpp"
#include "whole_files.hpp"

namespace berth::cli {
namespace {

namespace fs = std::filesystem;
using Json = nlohmann::ordered_json;
using linker::LinkNetwork;
using linker::Pdo;
using linker::Plan;

struct LinkOptions {
  std::string output;   ///< folder; empty: no files
  std::string earlier;  ///< the earlier plan's file; empty: that in the output folder
  bool anew = false;
  bool links = false;
  std::vector<std::string> nodes;  ///< only these are shown, with their PDOs; empty: all
};

constexpr std::size_t name_width = 18;

double in_ms(rt::Duration time) { return std::chrono::duration<double, std::milli>(time).count(); }

std::string short_ms(double value) {
  if (value >= 1000) return fmt::format("{:.0f}", value);
  return value >= 100 ? fmt::format("{:.1f}", value) : fmt::format("{:.2f}", value);
}

std::string receivers_text(const LinkNetwork& network, const Pdo& pdo) {
  std::string made;
  for (const auto& each : pdo.receivers) made += (made.empty() ? "" : ", ") + network.nodes[each.node].name;
  return made;
}

void print_pdo(const LinkNetwork& network, const Pdo& pdo) {
  unsigned bits = 0;
  for (const auto& each : pdo.carried) bits += each.bits;
  const auto name = text::padded(text::cut(network.nodes[pdo.producer].name, name_width), name_width);
  print_line(fmt::format(
      " {:03X}h  {} {:>4} {:>4} {:>4} {:>4} {:>7} {:>7} {:>7} {:>8}", pdo.can_id, name, pdo.tpdo, pdo.carried.size(),
      pdo.mpdo ? "MPDO" : std::to_string(bits), pdo.transmission, pdo.inhibit == 0 ? "-" : short_ms(pdo.inhibit / 10.0),
      pdo.event_ms == 0 ? "-" : std::to_string(pdo.event_ms), pdo.worst ? short_ms(in_ms(*pdo.worst)) : "-",
      pdo.deadline ? short_ms(in_ms(*pdo.deadline)) : ""));
  for (const auto& line : text::wrapped("to " + receivers_text(network, pdo), 72)) print_line("       " + line);
}

void print_bus(const LinkNetwork& network, const Plan& plan, std::size_t bus) {
  const auto& load = plan.buses[bus];
  const auto here = [bus](const Pdo& pdo) { return pdo.bus == bus; };
  const auto count = std::ranges::count_if(plan.pdos, here);
  print_line(fmt::format("{}: {} kbit/s, {} object{} in {} PDO{}", network.buses[bus].name,
                         network.buses[bus].others.bit_rate / 1000, load.objects, load.objects == 1 ? "" : "s", count,
                         count == 1 ? "" : "s"));
  print_line(fmt::format("  at most {:.1f} % of the bus, {:.1f} % by these PDOs; one object each: {:.1f} %",
                         100 * load.load, 100 * load.pdos, 100 * load.one_object_each));
  if (count == 0) return;
  print_line(fmt::format(" {:<5} {} {:>4} {:>4} {:>4} {:>4} {:>7} {:>7} {:>7} {:>8}", "id",
                         text::padded("producer", name_width), "TPDO", "objs", "bits", "type", "inhibit", "timer",
                         "worst", "deadline"));
  for (const Pdo& pdo : plan.pdos) {
    if (here(pdo)) print_pdo(network, pdo);
  }
}

/// Wraps: long names may need a second line.
void print_wrapped(const std::string& line) {
  constexpr std::size_t width = 80;
  print_lines(text::wrapped(line, width));
}

/// Prints the PDO of each link.
void print_links(const LinkNetwork& network, const Plan& plan) {
  for (const auto& each : plan.variables) {
    print_wrapped(fmt::format("{}/{}: {} {}, {}, byte {} of the image", network.nodes[each.node].name, each.name,
                              od::name(each.type), each.input ? "input" : "output", od::write_object(each.object),
                              each.offset));
  }
  for (const Pdo& pdo : plan.pdos) {
    for (const auto& receiver : pdo.receivers) {
      for (const auto& got : receiver.received) {
        const auto& from = pdo.carried[got.carried];
        print_wrapped(fmt::format("{}/{} -> {}/{}", network.nodes[pdo.producer].name, od::write_object(from.object),
                                  network.nodes[receiver.node].name, od::write_object(got.object)));
        print_line(pdo.mpdo ? fmt::format("  TPDO {} to RPDO {}, {:03X}h, MPDO", pdo.tpdo, receiver.rpdo, pdo.can_id)
                            : fmt::format("  TPDO {} to RPDO {}, {:03X}h, bits {} to {}", pdo.tpdo, receiver.rpdo,
                                          pdo.can_id, from.at, from.at + from.bits - 1));
      }
    }
  }
}

/// Prints the links through gateways, and with `routes` their routing.
void print_crossings(const LinkNetwork& network, const Plan& plan, bool routes) {
  for (const auto& each : plan.crossings) print_wrapped(CrossingShown{network, each, each.worst}.text());
  for (const auto& each : plan.routes) {
    if (!routes) break;
    const auto side = [](std::uint8_t number) { return number == 0 ? "above" : fmt::format("port {}", number); };
    print_wrapped(fmt::format("{}: route {}, {} {} to {} {}, of {}/{}", network.nodes[each.node].name, each.row,
                              side(each.from), od::write_object(each.source), side(each.to),
                              od::write_object(each.target), network.nodes[each.producer].name,
                              od::write_object(each.object)));
  }
}

Json routes_json(const LinkNetwork& network, const Plan& plan) {
  Json routes = Json::array();
  for (const auto& each : plan.routes) {
    routes.push_back({{"gateway", network.nodes[each.node].name},
                      {"row", each.row},
                      {"from", each.from},
                      {"source", od::write_object(each.source)},
                      {"to", each.to},
                      {"target", od::write_object(each.target)},
                      {"producer", network.nodes[each.producer].name},
                      {"object", od::write_object(each.object)},
                      {"budget_ms", in_ms(each.budget)},
                      {"freshness_ms", each.freshness_ms}});
  }
  return routes;
}

Json json_of(const LinkNetwork& network, const Pdo& pdo) {
  Json objects = Json::array();
  for (const auto& each : pdo.carried) {
    objects.push_back({{"object", od::write_object(each.object)}, {"bits", each.bits}, {"at", each.at}});
  }
  Json receivers = Json::array();
  for (const auto& each : pdo.receivers) {
    Json mapping = Json::array();
    for (const auto& entry : each.mapping)
      mapping.push_back({{"object", od::write_object(entry.object)}, {"bits", entry.bits}});
    Json received = Json::array();
    for (const auto& got : each.received) {
      received.push_back(
          {{"from", od::write_object(pdo.carried[got.carried].object)}, {"to", od::write_object(got.object)}});
    }
    receivers.push_back({{"slot", network.nodes[each.node].name},
                         {"rpdo", each.rpdo},
                         {"type", each.transmission},
                         {"event_ms", each.event_ms},
                         {"mapping", mapping},
                         {"received", received}});
  }
  return {{"bus", network.buses[pdo.bus].name},
          {"producer", network.nodes[pdo.producer].name},
          {"tpdo", pdo.tpdo},
          {"can_id", command::can_id_text(pdo.can_id)},
          {"mpdo", pdo.mpdo},
          {"type", pdo.transmission},
          {"inhibit_ms", pdo.inhibit / 10.0},
          {"event_ms", pdo.event_ms},
          {"deadline_ms", pdo.deadline ? Json(in_ms(*pdo.deadline)) : Json()},
          {"worst_ms", pdo.worst ? Json(in_ms(*pdo.worst)) : Json()},
          {"objects", objects},
          {"receivers", receivers}};
}

Json json_of(const LinkNetwork& network, const linker::Planned& planned) {
  Json variables = Json::array();
  for (const auto& each : planned.plan.variables) {
    variables.push_back({{"slot", network.nodes[each.node].name},
                         {"name", each.name},
                         {"type", od::name(each.type)},
                         {"direction", each.input ? "input" : "output"},
                         {"object", od::write_object(each.object)},
                         {"offset", each.offset}});
  }
  Json pdos = Json::array();
  for (const Pdo& pdo : planned.plan.pdos) pdos.push_back(json_of(network, pdo));
  Json buses = Json::array();
  for (std::size_t i = 0; i < planned.plan.buses.size(); ++i) {
    const auto& load = planned.plan.buses[i];
    buses.push_back({{"bus", network.buses[i].name},
                     {"load", load.load},
                     {"pdo_load", load.pdos},
                     {"one_object_each_load", load.one_object_each},
                     {"objects", load.objects}});
  }
  Json crossings = Json::array();
  for (const auto& each : planned.plan.crossings) crossings.push_back(CrossingShown{network, each, each.worst}.json());
  Json findings = Json::array();
  for (const auto& each : planned.findings) findings.push_back(to_string(each));
  return {{"good", planned.good()},
          {"buses", buses},
          {"pdos", pdos},
          {"variables", variables},
          {"routes", routes_json(network, planned.plan)},
          {"crossings", crossings},
          {"findings", findings}};
}

/// The plan that the new one continues.
tl::expected<linker::Earlier, Failure> earlier_plan(const design::Machine& machine, const LinkOptions& how) {
  if (how.anew) return linker::Earlier{};
  std::string path = how.earlier;
  std::error_code ignored;
  const std::string beside = (fs::path(how.output) / "plan.toml").string();
  if (path.empty() && !how.output.empty() && fs::exists(beside, ignored)) path = beside;
  Findings findings;
  std::optional<linker::Earlier> plan;
  if (path.empty()) {
    plan = traffic::earlier_plan(machine, findings);
  } else if (const auto text = text::read_file(path, findings)) {
    plan = linker::read_plan(*text, path, findings);
  }
  if (!plan) return tl::unexpected(failure(findings));
  return *plan;
}

bool differs(const fs::path& path, const std::string& bytes) {
  std::error_code ignored;
  if (!fs::exists(path, ignored)) return true;
  Findings findings;
  return text::read_file(path.string(), findings) != bytes;
}

/// Files of the plan that do not exist yet with the wanted content.
std::vector<std::string> changed_files(const std::vector<linker::MadeFile>& files, const fs::path& folder) {
  std::vector<std::string> changed;
  for (const auto& file : files) {
    if (differs(folder / file.name, file.bytes)) changed.push_back((folder / file.name).string());
  }
  return changed;
}

// A folder with a plan is Berth's own: its files are made again. In another folder the files are the user's.
std::optional<Failure> may_fill(const std::vector<linker::MadeFile>& files, const fs::path& folder, bool force) {
  std::error_code ignored;
  if (force || fs::exists(folder / "plan.toml", ignored)) return std::nullopt;
  for (const auto& file : files) {
    if (auto bad = may_write((folder / file.name).string(), "--output", false)) return bad;
  }
  return std::nullopt;
}

std::optional<Failure> write_files(const std::vector<linker::MadeFile>& files, const fs::path& folder) {
  if (auto bad = make_folder(folder.string())) return bad;
  std::vector<std::string> paths;
  for (const auto& file : files) paths.push_back((folder / file.name).string());
  std::vector<WholeFile> whole;
  for (std::size_t i = 0; i < files.size(); ++i) {
    if (differs(paths[i], files[i].bytes)) whole.push_back({paths[i], files[i].bytes});
  }
  return whole.empty() ? std::nullopt : write_whole(whole, true);
}

/// For a good plan, adds the assumptions of its bounds, and reports messages on buses with links that have no bound or
/// are too late. Judges as `berth analyze` does.
void judge_buses(const design::Machine& machine, const LinkNetwork& network, linker::Planned& planned) {
  if (!planned.good()) return;
  constexpr std::size_t most = 3;
  const traffic::LinkPlan links{network, planned.plan, {}};
  for (const auto* const bus : machine.all_buses()) {
    const bool linked = std::ranges::any_of(planned.plan.pdos,
                                            [&](const Pdo& pdo) { return network.buses[pdo.bus].name == bus->name; });
    if (!linked) continue;
    auto found = traffic::messages_of(machine, *bus, {.links = &links});
    for (auto& note : found.notes) planned.findings.push_back(std::move(note));
    const auto result = analysis::analyze(found.line);
    const auto tell = [&](std::string message, std::string fix) {
      planned.findings.push_back({Finding::Severity::error, machine.file, 0, 0, fmt::format("bus.{}", bus->name),
                                  std::move(message), std::move(fix)});
    };
    std::size_t wrong = 0;
    for (const auto& response : result.responses) {
      if (response.meets_deadline) continue;
      if (++wrong > most) continue;
      const auto& message = found.line.messages[response.message];
      const std::string why = response.arrival ? fmt::format("it can take {:g} ms, and has {:g} ms",
                                                             in_ms(*response.arrival), in_ms(message.deadline))
                                               : std::string("it has no bound");
      tell(fmt::format("{} of {}, {}: {}", message.name, found.line.senders[message.sender].name,
                       analysis::key_text(message.key), why),
           "`berth analyze` shows all messages of the bus");
    }
    if (wrong > most) tell(fmt::format("{} more messages are late or have no bound", wrong - most), "");
    if (result.load > 1) {
      tell(fmt::format("all messages take {:.1f} % of the bus", 100 * result.load),
           "raise the bit rate, give longer deadlines, or link fewer objects");
    }
  }
}

// The part of the plan in which these nodes are producers or consumers. A node's index is its slot's in the machine.
linker::Plan of_nodes(const design::Machine& machine, linker::Plan plan, const std::vector<MeantNode>& nodes) {
  const auto meant = [&](std::size_t node) {
    if (node >= machine.slots.size()) return false;  // a gateway's own node on a bus beneath
    const auto* const slot = &machine.slots[node];
    return std::ranges::find(nodes, slot, &MeantNode::slot) != nodes.end();
  };
  std::erase_if(plan.variables, [&](const auto& each) { return !meant(each.node); });
  for (auto& pdo : plan.pdos) {
    if (!meant(pdo.producer)) std::erase_if(pdo.receivers, [&](const auto& each) { return !meant(each.node); });
  }
  plan.crossings.clear();  // they refer to PDOs of all nodes
  std::erase_if(plan.routes, [&](const auto& each) { return !meant(each.node) && !meant(each.producer); });
  std::erase_if(plan.pdos, [&](const auto& pdo) { return !meant(pdo.producer) && pdo.receivers.empty(); });
  for (auto& bus : plan.buses) bus.objects = 0;
  for (const auto& pdo : plan.pdos) plan.buses[pdo.bus].objects += pdo.carried.size();
  return plan;
}

int show(const Options& options, const LinkOptions& how, const LinkNetwork& network, const linker::Planned& planned,
         const std::vector<MeantNode>& nodes, const std::vector<std::string>& changed) {
  if (options.json) {
    Json all = json_of(network, planned);
    all["files"] = changed;
    all["written"] = !options.dry_run && planned.good() && !how.output.empty();
    print_text(all.dump(2));
    return planned.good() ? Exit::done : Exit::no;
  }
  for (std::size_t bus = 0; bus < planned.plan.buses.size(); ++bus) {
    const auto is_there = [&](const MeantNode& node) { return node.bus->name == network.buses[bus].name; };
    if (nodes.empty() || std::ranges::any_of(nodes, is_there)) print_bus(network, planned.plan, bus);
  }
  print_crossings(network, planned.plan, how.links);
  if (how.links) print_links(network, planned.plan);
  for (const auto& finding : planned.findings) print_error(to_string(finding));
  if (!planned.good()) {
    print_error("no files are made of a plan with errors");
    return Exit::no;
  }
  if (how.output.empty()) return Exit::done;
  if (changed.empty()) print_line(fmt::format("{}: all files are up to date", how.output));
  for (const auto& path : changed) print_line(fmt::format("{} {}", options.dry_run ? "would write" : "written", path));
  return Exit::done;
}

int link(const Options& options, const LinkOptions& how) {
  const auto machine = machine_by_file(options);
  if (!machine) return tell(machine.error(), options.json);
  if (machine->links.empty()) {
    return tell(
        failure(Exit::usage, fmt::format("{}: there is no [[link]] in it; write from = \"slot/object\" and to = "
                                         "[\"slot/object\"] (docs/linking.md)",
                                         machine->file)),
        options.json);
  }
  const auto nodes = meant_nodes(*machine, {}, how.nodes);
  if (!nodes) return tell(nodes.error(), options.json);
  const auto empty = std::ranges::find(*nodes, nullptr, [](const MeantNode& node) { return node.slot; });
  if (empty != nodes->end()) {
    return tell(failure(Exit::usage, fmt::format("{}: node {} on bus {} is not a slot: no link leads to it",
                                                 machine->file, empty->text, empty->bus->name)),
                options.json);
  }
  const auto made = traffic::link_network(*machine);
  if (has_errors(made.findings)) return tell(failure(made.findings), options.json);
  const auto earlier = earlier_plan(*machine, how);
  if (!earlier) return tell(earlier.error(), options.json);
  auto planned = linker::make_plan(made.network, *earlier);
  judge_buses(*machine, made.network, planned);
  std::vector<std::string> changed;
  if (planned.good() && !how.output.empty()) {
    const auto files = linker::make_files(made.network, planned.plan);
    if (!files) return tell(failure(Exit::usage, files.error()), options.json);
    if (const auto bad = may_fill(*files, how.output, options.files.force)) return tell(*bad, options.json);
    changed = changed_files(*files, how.output);
    if (!options.dry_run) {
      if (const auto wrong = write_files(*files, how.output)) return tell(*wrong, options.json);
    }
  }
  linker::Planned shown = planned;
  if (!how.nodes.empty()) shown.plan = of_nodes(*machine, planned.plan, *nodes);
  return show(options, how, made.network, shown, *nodes, changed);
}

}  // namespace

void add_link(Verb& berth, Options& options) {
  const auto how = std::make_shared<LinkOptions>();
  Verb verb = berth.add("link", "make PDOs and network variables of the machine's links; exit 1 when one cannot be",
                        [&options, how] { return link(options, *how); });
  json_flag(verb, options);
  force_word(verb, options);
  machine_word(verb, options);
  verb.word("--output,-o", how->output, "write DCFs, concise DCFs, network.cpj, symbols and plan.toml there")
      .shown("FOLDER");
  verb.flag("--dry-run", options.dry_run, "say which files would be written, and write none");
  verb.word("--plan", how->earlier,
            "go on from this plan (default: plan.toml of --output, else link_plan of the machine file)")
      .shown("FILE");
  verb.flag("--anew", how->anew, "plan as if nothing had been planned before: PDOs and CAN-IDs may change");
  verb.flag("--links", how->links, "show each link with its PDOs, and the network variables");
  verb.word("--node", how->nodes, "show only the PDOs of these: a slot, a node-ID, a path such as 3/5")
      .shown("NODE,...")
      .separated_by(',')
      .one_each();
  verb.footer(
      "Examples:\n  berth link machine.toml\n  berth link machine.toml --node 3/5\n  berth link machine.toml --output "
      "linked --dry-run\n"
      "  berth link machine.toml --output linked\n");
}

}  // namespace berth::cli
