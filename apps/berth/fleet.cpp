// `berth fleet`: the machines at an MQTT broker, as tables and as JSON (docs/fleet.md).
#include <fmt/format.h>

#include <algorithm>
#include <memory>
#include <nlohmann/json.hpp>

#include "berth/eds/context.hpp"
#include "berth/fleet/machines_json.hpp"
#include "berth/text/columns.hpp"
#include "berth/text/printable.hpp"
#include "fleet_host.hpp"
#include "fleet_roll_out.hpp"
#include "fleet_rows.hpp"
#include "options.hpp"
#include "output.hpp"
#include "redraw.hpp"
#include "verbs.hpp"

namespace berth::cli {
namespace {

using fleet::MachineView;
using Json = nlohmann::ordered_json;

struct FleetOptions {
  FleetConnection connection;
  std::string machine;  // of `fleet show`
  std::string since;    // file of an earlier look
  bool watch = false;
};

#if BERTH_MQTT

constexpr std::size_t longest_look = std::size_t{256} << 20U;  // as much as a host keeps of a fleet

// One look at a fleet: connects, waits, shows.
class Look {
 public:
  Look(const FleetOptions& how, const Options& options) : how_(how), options_(options) {}

  int run() {
    if (const auto no = read_earlier()) return tell(*no, options_.json);
    if (const auto no = host_.connect()) return tell(*no, options_.json);
    if (how_.watch) return watch();
    host_.gather();
    return how_.machine.empty() ? show() : show_machine();
  }

 private:
  std::optional<Failure> read_earlier() {
    if (how_.since.empty()) return std::nullopt;
    const auto text = eds::read_text_file(how_.since, longest_look);
    const auto json = text ? Json::parse(*text, nullptr, false) : Json();
    const auto machines = json.is_object() ? json.find("machines") : json.end();
    if (!json.is_object() || machines == json.end() || !machines->is_array())
      return failure(Exit::usage, fmt::format("--since {}: it is no output of `berth fleet --json`", how_.since));
    for (const auto& each : *machines) {
      if (each.is_object()) earlier_.push_back(fleet::machine_of_json(each));
    }
    return std::nullopt;
  }

  int show() {
    const auto seen = host_.machines();
    if (options_.json) {
      Json json{{"machines", Json::array()}};
      for (const auto& machine : seen) json["machines"].push_back(fleet::machine_json(machine));
      if (!how_.since.empty()) json["changes"] = Json::array();
      if (const auto left_out = host_.watch().status().left_out; !left_out.empty()) json["left_out"] = left_out;
      for (const auto& change : how_.since.empty() ? std::vector<Change>{} : changes(seen))
        json["changes"].push_back(
            {{"group", change.machine.group}, {"machine", change.machine.node}, {"what", change.what}});
      print_text(json.dump(2, ' ', false, Json::error_handler_t::replace));
    } else {
      for (const auto& line : fleet_lines(seen, host_.now_ms(), terminal_size().columns)) print_line(line.text);
      print_line(fleet_headline(seen));
      if (const auto left_out = host_.watch().status().left_out; !left_out.empty())
        print_line("not all is shown: " + text::one_line(left_out));
      print_changes(seen);
    }
    const bool good = !seen.empty() && std::ranges::none_of(seen, &MachineView::needs);
    return good ? Exit::done : Exit::no;
  }

  struct Change {
    sparkplug::EdgeNodeId machine;
    std::string what;
  };

  [[nodiscard]] std::vector<Change> changes(const std::vector<MachineView>& seen) const {
    std::vector<Change> found;
    for (const auto& machine : seen) {
      const auto was = std::ranges::find(earlier_, machine.id, &MachineView::id);
      if (was == earlier_.end()) {
        found.push_back({machine.id, "new"});
      } else {
        for (auto& line : fleet::changes_between(*was, machine)) found.push_back({machine.id, std::move(line)});
      }
    }
    for (const auto& was : earlier_) {
      if (std::ranges::find(seen, was.id, &MachineView::id) == seen.end())
        found.push_back({was.id, "not heard of now"});
    }
    return found;
  }

  void print_changes(const std::vector<MachineView>& seen) const {
    if (how_.since.empty()) return;
    const auto found = changes(seen);
    print_line("");
    print_line(found.empty() ? "nothing has changed since the earlier look" : "since the earlier look:");
    for (const auto& change : found)
      print_line(fmt::format("{}/{}: {}", change.machine.group, change.machine.node, change.what));
  }

  int show_machine() {
    const auto machine = machine_named(host_.machines(), how_.machine);
    if (!machine) return tell(machine.error(), options_.json);
    if (options_.json) {
      print_text(fleet::machine_json(*machine).dump(2, ' ', false, Json::error_handler_t::replace));
    } else {
      print_lines(machine_lines(*machine, host_.now_ms()));
    }
    return machine->needs() ? Exit::no : Exit::done;
  }

  int watch() {
    Redraw redraw;
    std::uint64_t drawn = 0;
    const bool draws = can_draw();
    for (int ticks = 0; !host_.ended(); ++ticks) {
      const auto status = host_.watch().status();
      if (status.gave_up) return tell(failure(Exit::failed, status.trouble), options_.json);
      if (status.changes != drawn || ticks % 10 == 0) {
        if (draws) {
          redraw.draw({}, board(status), terminal_size());
        } else if (status.changes != drawn) {
          print_line(fleet_headline(host_.machines()));
        }
        drawn = status.changes;
      }
      host_.rest();
    }
    redraw.keep();
    return Exit::done;
  }

  [[nodiscard]] std::vector<BoardLine> board(const fleet::Watch::Status& status) {
    const auto seen = host_.machines();
    const auto size = terminal_size();
    std::vector<BoardLine> lines{{.text = fleet_headline(seen)}};
    if (!status.connected) lines.push_back({.text = "not connected: " + status.trouble, .urgent = true});
    auto rows = fleet_lines(seen, host_.now_ms(), size.columns);
    std::ranges::move(rows, std::back_inserter(lines));
    if (lines.size() + 1 > size.rows) {
      const std::size_t kept = size.rows - 2;
      const std::size_t left = lines.size() - kept;
      lines.resize(kept);
      lines.push_back({.text = fmt::format("... {} lines more: `berth fleet` without --watch shows all", left)});
    }
    for (auto& line : lines) line.text = text::cut(line.text, size.columns);
    return lines;
  }

  const FleetOptions& how_;
  const Options& options_;
  FleetHost host_{how_.connection};
  std::vector<MachineView> earlier_;
};

int run_fleet(const FleetOptions& how, const Options& options) { return Look(how, options).run(); }

#else

int run_fleet(const FleetOptions&, const Options& options) {
  return tell(failure(Exit::usage, "this berth was built without MQTT (BERTH_MQTT=OFF)"), options.json);
}

#endif

void add_show(const Verb& fleet, Options& options) {
  const auto how = std::make_shared<FleetOptions>();
  const Verb show = fleet.add("show", "one machine with all its slots, as it last reported",
                              [&options, how] { return run_fleet(*how, options); });
  show.word("machine", how->machine, "NAME or GROUP/NAME").required().shown("MACHINE");
  show.word("--broker", how->connection.broker, broker_help).shown("URL");
  fleet_connection_words(show, how->connection);
  json_flag(show, options);
  show.footer("Example:\n  berth fleet show hall-2/press-3 --broker mqtts://broker:8883");
}

}  // namespace

void add_fleet(Verb& berth, Options& options) {
  const auto how = std::make_shared<FleetOptions>();
  const Verb fleet = berth.add("fleet", "the machines at an MQTT broker, and which of them need somebody",
                               [&options, how] { return run_fleet(*how, options); });
  fleet.word("broker", how->connection.broker, broker_help).shown("URL");
  fleet.word("group", how->connection.group, "only machines of this group").shown("GROUP");
  fleet.flag("--watch", how->watch, "stay, and draw the table again when something changes");
  fleet.word("--since", how->since, "also what has changed since then: the output of an earlier `berth fleet --json`")
      .shown("FILE");
  fleet_connection_words(fleet, how->connection);
  json_flag(fleet, options);
  colour_word(fleet);
  fleet.footer(
      "Examples:\n  berth fleet mqtts://broker:8883\n  berth fleet mqtts://broker:8883 hall-3 --watch\n"
      "  berth fleet mqtts://broker:8883 --since yesterday.json");
  add_show(fleet, options);
  add_roll_out(fleet, options);
}

}  // namespace berth::cli
