// `berth fleet`: the machines at an MQTT broker, as tables and as JSON (docs/fleet.md).
#include <fmt/format.h>
#include <unistd.h>

#include <algorithm>
#include <cstdlib>
#include <fstream>
#include <memory>
#include <nlohmann/json.hpp>
#include <random>
#include <sstream>

#include "berth/io/loop_driver.hpp"
#include "berth/text/columns.hpp"
#include "fleet_rows.hpp"
#include "interrupt.hpp"
#include "options.hpp"
#include "output.hpp"
#include "redraw.hpp"
#include "verbs.hpp"

#if BERTH_MQTT
#include "berth/fleet/edge.hpp"
#include "berth/fleet/watch.hpp"
#include "berth/mqtt/where.hpp"
#endif

namespace berth::cli {
namespace {

using namespace std::chrono_literals;
using fleet::MachineView;
using Json = nlohmann::ordered_json;

struct FleetOptions {
  std::string broker;
  std::string group;    // empty: all
  std::string machine;  // of `fleet show`
  std::string since;    // file of an earlier look
  std::string login, ca, certificate, key;
  std::optional<std::chrono::nanoseconds> listen;  // for this long; empty: until all have answered
  bool watch = false;
};

#if BERTH_MQTT

constexpr auto look_pace = 100ms;
// Every Berth has given its births by then, and another second for their way.
constexpr auto answered_after = fleet::births_within + 1000ms;
constexpr auto quiet_for = 500ms;  // nothing has come for this long: all have answered
constexpr auto longest_listening = 20s;
constexpr auto connect_within = 15s;

// One look at a fleet: connects, waits, shows.
class Look {
 public:
  Look(const FleetOptions& how, const Options& options) : how_(how), options_(options) {}

  int run() {
    if (const auto no = begin()) return tell(*no, options_.json);
    if (const auto no = connect()) return tell(*no, options_.json);
    if (how_.watch) return watch();
    gather();
    return show();
  }

 private:
  std::optional<Failure> begin() {
    const char* const from_environment = std::getenv("BERTH_BROKER");
    const std::string broker = !how_.broker.empty() ? how_.broker : from_environment != nullptr ? from_environment : "";
    if (broker.empty())
      return failure(Exit::usage, "no broker: write its address, such as mqtts://broker:8883, or set BERTH_BROKER");
    const auto where = mqtt::parse_where(broker);
    if (!where) return failure(Exit::usage, where.error());
    if (const auto no = read_earlier()) return no;
    auto thread = fleet::Thread::start();
    if (!thread) return failure(Exit::failed, thread.error());
    thread_ = std::move(*thread);
    std::random_device seed;
    Random random(std::uint64_t{seed()} << 32U | seed());
    fleet::WatchOptions wanted;
    wanted.connection.where = *where;
    wanted.connection.login_file = how_.login;
    if (where->tls) wanted.connection.tls = {.authorities = how_.ca, .certificate = how_.certificate, .key = how_.key};
    wanted.host = fmt::format("berth-fleet-{:08x}", random.next() & 0xFFFFFFFFU);
    wanted.connection.client_id = wanted.host;
    if (!how_.group.empty()) wanted.groups = {how_.group};
    auto watch = fleet::Watch::start(*thread_, std::move(wanted), clock_, random.fork());
    if (!watch) return failure(Exit::usage, watch.error());
    watch_ = std::move(*watch);
    return std::nullopt;
  }

  std::optional<Failure> read_earlier() {
    if (how_.since.empty()) return std::nullopt;
    std::ifstream file(how_.since);
    std::ostringstream text;
    text << file.rdbuf();
    const auto json = Json::parse(text.str(), nullptr, false);
    const auto machines = json.is_object() ? json.find("machines") : json.end();
    if (!file || !json.is_object() || machines == json.end() || !machines->is_array())
      return failure(Exit::usage, fmt::format("--since {}: it is no output of `berth fleet --json`", how_.since));
    for (const auto& each : *machines) {
      if (each.is_object()) earlier_.push_back(machine_of_json(each));
    }
    return std::nullopt;
  }

  std::optional<Failure> connect() {
    for (auto waited = 0ns; waited < connect_within; waited += look_pace) {
      const auto status = watch_->status();
      if (status.connected) return std::nullopt;
      if (ended()) return failure(Exit::failed, "ended before the broker answered");
      if (!status.trouble.empty()) return failure(Exit::failed, status.trouble);
      rest();
    }
    return failure(Exit::failed, "the broker does not answer");
  }

  void gather() {
    std::uint64_t changes = 0;
    auto quiet = 0ns;
    const auto most = how_.listen.value_or(longest_listening);
    for (auto waited = 0ns; waited < most && !ended(); waited += look_pace) {
      rest();
      const auto now = watch_->status().changes;
      quiet = now == changes ? quiet + look_pace : 0ns;
      changes = now;
      if (!how_.listen && waited >= answered_after && quiet >= quiet_for) return;
    }
  }

  [[nodiscard]] std::vector<MachineView> machines() const {
    std::vector<MachineView> seen;
    watch_->look([&](const sparkplug::Fleet& fleet) { seen = fleet::machines_of(fleet); });
    return seen;
  }
  [[nodiscard]] std::uint64_t now_ms() const { return clock_.now().utc.ms; }

  int show() {
    const auto seen = machines();
    if (!how_.machine.empty()) return show_machine(seen);
    if (options_.json) {
      Json json{{"machines", Json::array()}};
      for (const auto& machine : seen) json["machines"].push_back(machine_json(machine));
      print_text(json.dump(2, ' ', false, Json::error_handler_t::replace));
    } else {
      for (const auto& line : fleet_lines(seen, now_ms(), terminal_size().columns)) print_line(line.text);
      print_line(fleet_headline(seen));
      print_changes(seen);
    }
    const bool good = !seen.empty() && std::ranges::none_of(seen, &MachineView::needs);
    return good ? Exit::done : Exit::no;
  }

  void print_changes(const std::vector<MachineView>& seen) const {
    if (how_.since.empty()) return;
    print_line("");
    print_line("since the earlier look:");
    bool any = false;
    const auto say = [&](const sparkplug::EdgeNodeId& id, const std::string& what) {
      print_line(fmt::format("{}/{}: {}", id.group, id.node, what));
      any = true;
    };
    for (const auto& machine : seen) {
      const auto was = std::ranges::find(earlier_, machine.id, &MachineView::id);
      if (was == earlier_.end()) {
        say(machine.id, "new");
      } else {
        for (const auto& line : fleet::changes_between(*was, machine)) say(machine.id, line);
      }
    }
    for (const auto& was : earlier_) {
      if (std::ranges::find(seen, was.id, &MachineView::id) == seen.end()) say(was.id, "not heard of now");
    }
    if (!any) print_line("nothing has changed");
  }

  int show_machine(const std::vector<MachineView>& seen) {
    std::vector<const MachineView*> meant;
    for (const auto& machine : seen) {
      if (machine.id.node == how_.machine || machine.id.group + "/" + machine.id.node == how_.machine)
        meant.push_back(&machine);
    }
    if (meant.empty())
      return tell(failure(Exit::no, fmt::format("no machine {} was heard of at this broker", how_.machine)),
                  options_.json);
    if (meant.size() > 1)
      return tell(failure(Exit::usage,
                          fmt::format("{} is in {} groups: write GROUP/{}", how_.machine, meant.size(), how_.machine)),
                  options_.json);
    if (options_.json) {
      print_text(machine_json(*meant.front()).dump(2, ' ', false, Json::error_handler_t::replace));
    } else {
      print_lines(machine_lines(*meant.front(), now_ms()));
    }
    return meant.front()->needs() ? Exit::no : Exit::done;
  }

  int watch() {
    Redraw redraw;
    std::uint64_t drawn = 0;
    const bool draws = can_draw();
    for (int ticks = 0; !ended(); ++ticks) {
      const auto status = watch_->status();
      if (status.gave_up) return tell(failure(Exit::failed, status.trouble), options_.json);
      if (status.changes != drawn || ticks % 10 == 0) {
        if (draws) {
          redraw.draw({}, board(status), terminal_size());
        } else if (status.changes != drawn) {
          print_line(fleet_headline(machines()));
        }
        drawn = status.changes;
      }
      rest();
    }
    redraw.keep();
    return Exit::done;
  }

  [[nodiscard]] std::vector<BoardLine> board(const fleet::Watch::Status& status) const {
    const auto seen = machines();
    const auto size = terminal_size();
    std::vector<BoardLine> lines{{.text = fleet_headline(seen)}};
    if (!status.connected) lines.push_back({.text = "not connected: " + status.trouble, .urgent = true});
    auto rows = fleet_lines(seen, now_ms(), size.columns);
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

  void rest() { wait_for(driver_, interrupt_, look_pace); }
  [[nodiscard]] bool ended() { return interrupt_.came() || run_must_end(); }

  const FleetOptions& how_;
  const Options& options_;
  rt::Executor executor_;
  io::LoopDriver driver_{executor_};
  Interrupt interrupt_{&driver_.loop()};
  fleet::SystemClock clock_;
  std::unique_ptr<fleet::Thread> thread_;
  std::unique_ptr<fleet::Watch> watch_;
  std::vector<MachineView> earlier_;
};

int run_fleet(const FleetOptions& how, const Options& options) { return Look(how, options).run(); }

#else

int run_fleet(const FleetOptions&, const Options& options) {
  return tell(failure(Exit::usage, "this berth was built without MQTT (BERTH_MQTT=OFF)"), options.json);
}

#endif

void connection_words(const Verb& verb, FleetOptions& how) {
  verb.word("--login", how.login, "file with the user (first line) and the password (second line) at the broker")
      .shown("FILE");
  verb.word("--ca", how.ca, "with mqtts://: certificates of the CAs that are trusted (PEM; default: the system's)")
      .shown("FILE");
  verb.word("--certificate", how.certificate, "this host's own certificate (PEM)").shown("FILE");
  verb.word("--key", how.key, "its private key (PEM, without a passphrase)").shown("FILE");
  verb.time("--for", how.listen, "listen for so long (default: until all machines have answered, about five seconds)");
}

}  // namespace

void add_fleet(Verb& berth, Options& options) {
  const auto how = std::make_shared<FleetOptions>();
  const Verb fleet = berth.add("fleet", "the machines at an MQTT broker, and which of them need somebody",
                               [&options, how] { return run_fleet(*how, options); });
  fleet.word("broker", how->broker, "mqtt://HOST[:PORT] or mqtts://HOST[:PORT] (default: $BERTH_BROKER)").shown("URL");
  fleet.word("group", how->group, "only machines of this group");
  fleet.word("--show", how->machine, "this machine with all its slots; NAME or GROUP/NAME").shown("MACHINE");
  fleet.flag("--watch", how->watch, "stay, and draw the table again when something changes");
  fleet.word("--since", how->since, "also what has changed since then: the output of an earlier `berth fleet --json`")
      .shown("FILE");
  connection_words(fleet, *how);
  json_flag(fleet, options);
  colour_word(fleet);
  fleet.footer(
      "Examples:\n  berth fleet mqtts://broker:8883\n  berth fleet mqtts://broker:8883 hall-3 --watch\n"
      "  berth fleet mqtt://localhost --show line-3\n"
      "  berth fleet mqtts://broker:8883 --since yesterday.json");
}

}  // namespace berth::cli
