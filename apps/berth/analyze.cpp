// `berth analyze`: the largest delays of the messages on a machine's buses, from its files alone.
#include <fmt/format.h>

#include <algorithm>
#include <deque>
#include <map>
#include <nlohmann/json.hpp>

#include "berth/analysis/plot.hpp"
#include "berth/base/counted.hpp"
#include "berth/command/can_id_text.hpp"
#include "berth/linker/bounds.hpp"
#include "berth/text/columns.hpp"
#include "berth/traffic/bus_messages.hpp"
#include "berth/traffic/link_network.hpp"
#include "crossing_words.hpp"
#include "machine_file.hpp"
#include "node_words.hpp"
#include "outputs.hpp"
#include "verbs.hpp"

namespace berth::cli {
namespace {

using Json = nlohmann::ordered_json;

struct AnalyzeOptions {
  traffic::Assumptions assumed;
  analysis::Errors errors;
  bool usual = false;
  std::vector<std::string> nodes;  ///< empty: all
  std::string plot;                ///< file; empty: none
};

double ms(rt::Duration time) { return std::chrono::duration<double, std::milli>(time).count(); }

std::string verdict(const analysis::Message& message, const analysis::Response& response) {
  if (!response.worst) return "no bound";
  if (message.deadline.count() == 0) return "";
  return response.meets_deadline ? "kept" : "MISSED";
}

void print_table(const design::Bus& bus, const analysis::Line& line, const analysis::Result& result) {
  std::size_t width = 6;
  for (const auto& sender : line.senders)
    width = std::max(width, std::min<std::size_t>(text::columns(sender.name), 20));
  print_line(fmt::format("{}: {} bit/s, {}, {:.1f} % of the bus at most", bus.name, bus.bitrate,
                         counted(line.messages.size(), "message"), 100 * result.load));
  print_line(fmt::format("{:>9}  {} {:<12} {:>8} {:>9} {:>9}", "id", text::padded("sender", width), "message",
                         "every ms", "worst ms", "deadline"));
  for (const auto& r : result.responses) {
    const auto& m = line.messages[r.message];
    const std::string sender = text::padded(text::cut(line.senders[m.sender].name, width), width);
    const std::string worst = r.arrival ? fmt::format("{:.3f}", ms(*r.arrival)) : "-";
    const std::string deadline = m.deadline.count() > 0 ? fmt::format("{:g}", ms(m.deadline)) : "";
    const std::string every = m.period.count() > 0 ? fmt::format("{:g}", ms(m.period)) : "-";
    print_line(fmt::format("{:>9}  {} {:<12} {:>8} {:>9} {:>9} {}", analysis::key_text(m.key), sender, m.name, every,
                           worst, deadline, verdict(m, r)));
  }
}

Json json_of(const design::Bus& bus, const analysis::Line& line, const analysis::Result& result,
             const Findings& notes) {
  Json messages = Json::array();
  for (const auto& r : result.responses) {
    const auto& m = line.messages[r.message];
    Json row{{"id", command::can_id_text(m.key)},
             {"sender", line.senders[m.sender].name},
             {"message", m.name},
             {"bytes", m.data_bytes},
             {"period_ms", m.period.count() > 0 ? Json(ms(m.period)) : Json()},
             {"frame_ms", ms(r.frame)},
             {"load", r.load},
             {"bus_ms", r.worst ? Json(ms(*r.worst)) : Json()},
             {"worst_ms", r.arrival ? Json(ms(*r.arrival)) : Json()},
             {"deadline_ms", m.deadline.count() > 0 ? Json(ms(m.deadline)) : Json()}};
    row["kept"] = m.deadline.count() > 0 ? Json(r.meets_deadline) : Json();
    messages.push_back(std::move(row));
  }
  Json told = Json::array();
  for (const auto& note : notes) told.push_back(to_string(note));
  return {{"bus", bus.name},       {"bit_rate", bus.bitrate}, {"load", result.load},
          {"good", result.good()}, {"messages", messages},    {"notes", told}};
}

// The sender's name in `messages_of` for a node: its slot, or the bus's NMT master.
tl::expected<std::string, Failure> sender_of(const design::Machine& machine, const MeantNode& node) {
  if (node.slot != nullptr) return node.slot->spec.name.name;
  if (node.node == node.bus->master) return std::string("master");
  return tl::unexpected(failure(
      Exit::usage, fmt::format("{}: node {} on bus {} is neither a slot nor the bus's NMT master: what it sends is not "
                               "known; write a [[slot]] for it",
                               machine.file, node.text, node.bus->name)));
}

// --fifo: names of senders; for slots, any of their names.
tl::expected<std::vector<std::string>, Failure> fifo_senders(const design::Machine& machine, const Options& options,
                                                             const std::vector<std::string>& words) {
  std::vector<std::string> senders;
  for (const auto& word : words) {
    if (word == "all" || word == "master" || machine.slot(word) != nullptr) {
      senders.push_back(word);
      continue;
    }
    const auto node = meant_node(machine, options.bus, word);
    if (!node) return tl::unexpected(failure(Exit::usage, "--fifo: " + node.error().message));
    const auto sender = sender_of(machine, *node);
    if (!sender) return tl::unexpected(sender.error());
    senders.push_back(*sender);
  }
  return senders;
}

/// The buses, or the nodes alone, that are shown.
class Shown {
 public:
  static tl::expected<Shown, Failure> of(const design::Machine& machine, const Options& options,
                                         const AnalyzeOptions& how) {
    const auto nodes = meant_nodes(machine, options.bus, how.nodes);
    if (!nodes) return tl::unexpected(nodes.error());
    Shown shown;
    shown.only_ = options.bus;
    for (const auto& node : *nodes) {
      auto sender = sender_of(machine, node);
      if (!sender) return tl::unexpected(sender.error());
      shown.senders_.emplace_back(node.bus, std::move(*sender));
    }
    return shown;
  }
  [[nodiscard]] bool has(const design::Bus& bus) const {
    if (senders_.empty()) return only_.empty() || bus.name == only_;
    return std::ranges::find(senders_, &bus, &Sender::first) != senders_.end();
  }
  /// Removes all other messages: only those shown are judged.
  void cut(const design::Bus& bus, const analysis::Line& line, analysis::Result& result) const {
    if (senders_.empty()) return;
    std::erase_if(result.responses, [&](const auto& r) {
      const auto& name = line.senders[line.messages[r.message].sender].name;
      return std::ranges::find(senders_, Sender(&bus, name)) == senders_.end();
    });
  }

 private:
  using Sender = std::pair<const design::Bus*, std::string>;
  std::string only_;
  std::vector<Sender> senders_;
};

/// The plot, drawn after all buses are analysed.
class Picture {
 public:
  void add(const design::Bus& bus, const analysis::Line& line, const analysis::Result& result) {
    const auto& [own_line, own_result] = kept_.emplace_back(line, result);
    buses_.push_back(
        {fmt::format("{}: {} bit/s, {:.1f} % of the bus at most", bus.name, bus.bitrate, 100 * result.load), &own_line,
         &own_result});
  }
  [[nodiscard]] std::string svg() const { return analysis::plot(buses_); }

 private:
  std::deque<std::pair<analysis::Line, analysis::Result>> kept_;  // a deque: `buses_` points to the elements
  std::vector<analysis::PlottedBus> buses_;
};

/// The delays of the TPDOs on all buses, and so those of the links across gateways.
class Ends {
 public:
  void add(const design::Bus& bus, const analysis::Line& line, const analysis::Result& result) {
    for (const auto& r : result.responses) {
      const auto& m = line.messages[r.message];
      if (r.arrival) responses_[{bus.name, line.senders[m.sender].name, m.name}] = *r.arrival;
    }
  }
  [[nodiscard]] std::vector<CrossingShown> crossings(const traffic::LinkPlan& links) const {
    std::vector<std::optional<rt::Duration>> worst;
    for (const auto& pdo : links.plan.pdos) worst.push_back(worst_of(links.network, pdo));
    std::vector<CrossingShown> all;
    for (const auto& each : links.plan.crossings)
      all.push_back({links.network, each, linker::worst_of(links.network, each, worst)});
    return all;
  }

 private:
  [[nodiscard]] std::optional<rt::Duration> worst_of(const linker::LinkNetwork& network, const linker::Pdo& pdo) const {
    const auto known = responses_.find(
        {network.buses[pdo.bus].name, network.nodes[pdo.producer].name, fmt::format("TPDO {}", pdo.tpdo)});
    return known == responses_.end() ? std::nullopt : std::optional(known->second);
  }
  std::map<std::tuple<std::string, std::string, std::string>, rt::Duration> responses_;
};

/// The linker's findings about the links: printed, or for --json.
Json told(const Findings& findings, bool json) {
  Json all = Json::array();
  for (const auto& each : findings) {
    if (json) all.push_back(to_string(each));
    if (!json) print_error(to_string(each));
  }
  return all;
}

int analyze(const Options& options, const AnalyzeOptions& how) {
  if (!how.plot.empty()) {
    if (const auto bad = may_write(how.plot, "--plot", options.files.force)) return tell(*bad, options.json);
  }
  const auto machine = machine_by_file(options);
  if (!machine) return tell(machine.error(), options.json);
  if (!options.bus.empty() && machine->bus(options.bus) == nullptr)
    return tell(no_such_bus(*machine, options.bus), options.json);
  const auto fifo = fifo_senders(*machine, options, how.assumed.fifo);
  if (!fifo) return tell(fifo.error(), options.json);
  const auto shown = Shown::of(*machine, options, how);
  if (!shown) return tell(shown.error(), options.json);
  traffic::LinkPlan links;
  if (!machine->links.empty()) links = traffic::plan_links(*machine);
  traffic::Assumptions assumed = how.assumed;
  assumed.fifo = *fifo;
  // Also for links with errors: the analysis shows which messages are late, and by how much.
  if (links.plan.linked.size() == links.network.nodes.size() && !machine->links.empty()) assumed.links = &links;
  bool good = !has_errors(links.findings);
  Ends ends;
  Json buses = Json::array();
  Picture picture;
  for (const auto* const each : machine->all_buses()) {
    const design::Bus& bus = *each;
    if (!shown->has(bus)) continue;
    auto found = traffic::messages_of(*machine, bus, assumed);
    found.line.errors = how.errors;
    if (how.usual) found.line.lengths = analysis::FrameLengths::usual;
    if (const auto wrong = analysis::wrong(found.line); !wrong.empty())
      return tell(failure(Exit::usage, fmt::format("{}: {}", bus.name, wrong)), options.json);
    auto result = analysis::analyze(found.line);
    ends.add(bus, found.line, result);
    shown->cut(bus, found.line, result);
    good = good && result.good();
    if (!how.plot.empty()) picture.add(bus, found.line, result);
    if (options.json) {
      buses.push_back(json_of(bus, found.line, result, found.notes));
      continue;
    }
    print_table(bus, found.line, result);
    for (const auto& note : found.notes) print_error(to_string(note));
  }
  if (!how.plot.empty()) {
    if (const auto bad = write_output(how.plot, picture.svg())) return tell(*bad, options.json);
  }
  // With only some of the buses, no path across gateways is complete.
  Json crossings = Json::array();
  const bool whole = options.bus.empty() && how.nodes.empty() && assumed.links != nullptr;
  const Json wrong = told(links.findings, options.json);
  for (const auto& each : whole ? ends.crossings(links) : std::vector<CrossingShown>{}) {
    good = good && each.kept();
    if (options.json) crossings.push_back(each.json());
    if (!options.json) print_lines(text::wrapped(each.text(), 80));
  }
  if (options.json)
    print_text(Json{{"good", good}, {"buses", buses}, {"crossings", crossings}, {"links", wrong}}.dump(2));
  return good ? Exit::done : Exit::no;
}

}  // namespace

void add_analyze(Verb& berth, Options& options) {
  const auto how = std::make_shared<AnalyzeOptions>();
  Verb verb = berth.add(
      "analyze", "worst-case response time of each message, from the machine's files; exit 1 when one is too late",
      [&options, how] { return analyze(options, *how); });
  json_flag(verb, options);
  force_word(verb, options);
  machine_word(verb, options);
  verb.word("--bus", options.bus, "one bus of the machine").shown("NAME");
  verb.word("--node", how->nodes, "only the messages of these: a slot, a node-ID, a path such as 3/5")
      .shown("NODE,...")
      .separated_by(',')
      .one_each();
  verb.time("--errors", how->errors.interval,
            "least time between two disturbed frames (default: no frame is disturbed)");
  verb.word("--burst", how->errors.burst, "number of disturbed frames at once").from_to(1, 1000).shown("NUMBER");
  verb.time("--event", how->assumed.event,
            "between two events of a PDO without an inhibit time (default: not known: no bound)");
  verb.time("--emcy", how->assumed.emcy, "between two EMCYs of a device without inhibit time (default: 1 s)");
  verb.time("--sdo", how->assumed.sdo, "between two SDO requests (default: 10 ms)");
  verb.time("--nmt", how->assumed.nmt, "between two NMT commands (default: 100 ms)");
  verb.word("--fifo", how->assumed.fifo, "nodes that send frames in the order they were queued; or all")
      .shown("NODE,...")
      .separated_by(',')
      .one_each();
  verb.flag("--usual", how->usual, "use the usual bound of a frame's length instead of its true maximum");
  verb.word("--plot", how->plot, "draw the bounds and the deadlines into this file").shown("FILE.svg");
  verb.footer(
      "Examples:\n  berth analyze machine.toml --plot bounds.svg\n  berth analyze machine.toml --errors \"100 ms\" "
      "--fifo all --json\n"
      "  berth analyze machine.toml --node 3/5");
}

}  // namespace berth::cli
