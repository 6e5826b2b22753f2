// `berth up`, and the parts that `berth demo` shares with it.
#include "up.hpp"

#include <fmt/format.h>
#include <unistd.h>

#include <algorithm>
#include <filesystem>
#include <optional>

#include "ask.hpp"
#include "berth/command/control.hpp"
#include "berth/operate/report.hpp"
#include "berth/operate/slot_rows.hpp"
#include "berth/text/printable.hpp"
#include "drive.hpp"
#include "gateway.hpp"
#include "machine_file.hpp"
#include "mqtt_host.hpp"
#include "ports.hpp"
#include "second_word.hpp"
#include "service.hpp"
#include "studio_host.hpp"
#include "verbs.hpp"

namespace berth::cli {
namespace {

// Why the machine is not operational, each reason once.
Failure not_operational(tree::Session& session, Ended ended) {
  std::vector<operate::SlotReport> wanting;
  for (auto& s : session.slots()) {
    const design::Slot* const slot = session.machine().slot(s.bus, s.id);
    const bool optional = slot != nullptr && slot->spec.optional;
    if (optional || s.state == places::SlotState::operational) continue;
    if (s.reason.empty()) s.reason = "it did not become operational in that time";
    s.name = fmt::format("slot {} (node-ID {})", s.name, s.id.value());
    wanting.push_back(std::move(s));
  }
  std::vector<std::string> lines;
  if (ended == Ended::timeout) lines.emplace_back("the time allowed is over");
  std::ranges::copy(operate::reasons_of(wanting), std::back_inserter(lines));
  if (lines.empty()) lines.emplace_back();
  lines.front().insert(0, "not operational: ");
  return failure_in_lines(Exit::no, lines);
}

// The control socket, by which other commands reach this process. If it runs only one of several buses, the machine's
// name is left to a process that runs them all.
std::string control_of(MachineRun& run, const Options& options) {
  if (run.loop() == nullptr || options.dry_run) return {};
  if (!options.control.empty()) return options.control;
  const auto& name = run.machine().name;
  return command::control_path(!run.guards().empty() && !options.bus.empty() ? bus_process(name, options.bus) : name);
}

std::vector<std::string> first_start_lines(MachineRun& run) {
  std::vector<std::string> lines{
      fmt::format("this is the first start of {}: no slot has a device yet.", run.machine().name)};
  for (const auto& bus : run.machine().buses) {
    if (!is_real(bus.port) || bus.role == design::Role::observer) continue;
    lines.push_back(fmt::format(
        "bus {} on {}: Berth will search for devices (LSS, RAND), give the {} slots' node-IDs to those that fit and "
        "let them store these{}",
        bus.name, can::to_string(bus.port), run.machine().specs(bus.name).size(),
        bus.role == design::Role::master ? ", reset and configure them, and start them: outputs may switch" : ""));
  }
  return lines;
}

bool confirmed(MachineRun& run, const Options& options) {
  if (options.yes || !run.first_start()) return true;
  if (options.json || !someone_types()) return false;
  print_lines(first_start_lines(run));
  return ask_yes("Start it?", run.interrupt());
}

Failure unconfirmed(MachineRun& run) {
  auto lines = first_start_lines(run);
  lines.emplace_back("Nothing was sent. Confirm it with --yes; --dry-run shows what would be sent first");
  return failure_in_lines(Exit::no, lines);
}

// Nothing is started if there is another master on a bus, or if the user does not confirm.
std::optional<Failure> refusal(MachineRun& run, const Options& options) {
  if (const auto clear = run.strangers().listen_first(); !clear) return clear.error();
  if (!options.dry_run && !confirmed(run, options)) return unconfirmed(run);
  if (const auto alone = run.strangers().ask(run.first_start()); !alone) return alone.error();
  return no_second_word(run, options);
}

// `table`: print the slot table, because it was not on the screen during the run.
void print_outcome(MachineRun& run, const Options& options, const std::vector<Recorded>& sent, bool table) {
  if (options.dry_run) {
    print_dry_run(sent, nullptr, options.json);
  } else if (options.json) {
    operate::write_json(run.session().take_report(), options.events.lines ? -1 : 2,
                        [](std::string_view piece) { write_text(text::printable(piece)); });
    print_line("");
  } else if (table) {
    print_line("");
    print_lines(operate::to_table(run.session().slots()));
    for (const auto& question : tree::questions_of(run.session())) print_line(question.text);
  }
}

// A journal gets the level of each line, and has the time of day itself.
EventLines::Head head_of(MachineRun& run, const Options& options) {
  if (!options.json && io::is_journal(STDOUT_FILENO)) return EventLines::Head::level;
  return run.guards().empty() ? EventLines::Head::bus_time : EventLines::Head::time_of_day;
}

}  // namespace

int bring_up(const Options& wanted, const Sources& sources, const Story& story) {
  Options options = wanted;
  if (options.events.lines && !options.json) {
    return tell(failure(Exit::usage, "--events are lines of JSON: give --json too"), options.json);
  }
  if (const auto no = studio_refused(options)) return tell(*no, options.json);
  if (const auto no = mqtt_refused(options)) return tell(*no, options.json);
  const bool studio = options.offers.studio.offered();
  const bool watched = on_terminal() && !options.json && !options.dry_run;
  options.sim.pace = (options.sim.pace || watched || studio) && !options.sim.fast && !options.dry_run;
  auto manager = io::ServiceManager::of_environment();
  const auto start = manager && !sources.machine_name.empty() ? Reload::text_of(sources.machine_name) : std::nullopt;
  auto made = MachineRun::make(options, sources);
  if (!made) return tell(made.error(), options.json);
  MachineRun& run = **made;
  const bool live = watched && !options.events.none && can_draw() && run.loop() != nullptr;
  std::vector<Recorded> sent;
  if (options.dry_run) run.record().collect_sent(sent);
  if (const auto no = refusal(run, options)) return tell(*no, options.json);
  if (run.loop() != nullptr && !options.dry_run) write_behind();
  Screen screen(run.session(), {.live = live,
                                .quiet = options.json || options.dry_run || options.events.none,
                                .events = options.events.lines && !options.dry_run,
                                .head = head_of(run, options),
                                .level = log_level(options.events.level),
                                .comment = story.comment});
  for (const auto& line : story.begin) screen.line(line);
  Ending ending(run, options.until);
  const auto say = [&screen](const std::string& line) { screen.line(line); };
  const auto service =
      sources.machine_text.empty() ? Service::start(std::move(manager), run, options, start, say) : nullptr;
  const auto ended = drive(run, ending, screen, options, control_of(run, options), service.get());
  if (!ended) return tell(ended.error(), options.json);
  const bool good =
      run.session().operational() && (*ended != Ended::settled || options.until != "replaced" || ending.reached());
  if (!options.dry_run) run.leave(options);
  if (*ended == Ended::interrupted && !options.json && !options.dry_run && leaves_running(run, options))
    screen.line("the devices run on, without this master; `berth up` takes them over again");
  screen.keep();
  print_outcome(run, options, sent, !live);
  if (options.dry_run && !run.guards().empty()) return Exit::done;
  if (run.record().finish(Exit::done) != Exit::done) return Exit::failed;
  const bool tells = !options.json && !options.dry_run;
  if (tells) print_lines(story.end);
  const bool asked_to_end = service != nullptr && *ended == Ended::interrupted;  // the manager stopped it
  if (good || asked_to_end) return Exit::done;
  if (!options.json && !output_broken()) {
    tell(run.session().operational() ? failure(Exit::no, "no device was replaced")
                                     : not_operational(run.session(), *ended),
         false);
  }
  return Exit::no;
}

namespace {

// A machine whose buses are all simulated needs a plant file: `berth init` writes NAME.plant.toml beside NAME.toml.
std::string plant_of(const Options& options) {
  if (!options.sim.plant.empty() || !options.ports.empty()) return options.sim.plant;
  const auto machine = machine_of(options);
  const bool simulated =
      machine && std::ranges::all_of(machine->buses, [](const auto& b) { return b.port.kind == can::PortKind::sim; });
  if (!simulated) return {};
  namespace fs = std::filesystem;
  const fs::path file(options.machine);
  for (const auto& name : {file.stem().string() + ".plant.toml", std::string("plant.toml")}) {
    const auto beside = file.parent_path() / name;
    std::error_code none;
    if (!fs::is_regular_file(beside, none)) continue;
    if (!options.json) print_error(fmt::format("plant file: {}, beside the machine file", beside.string()));
    return beside.string();
  }
  return {};
}

}  // namespace

int run_up(const Options& options) {
  Options own = options;
  if (own.machine.empty()) {
    Options here = options;  // neither a port nor a socket replaces the machine file
    here.ports.clear();
    here.control.clear();
    own.machine = default_machine(here);
  }
  if (own.machine.empty())
    return tell(failure(Exit::usage,
                        "name the machine file: berth up machine.toml; `berth init` makes one of device descriptions, "
                        "or of a bus that is there" +
                            machines_here()),
                options.json);
  if (!options.offers.gateway.where.empty()) {
    const auto where = gateway_endpoint("--gateway", options.offers.gateway.where, gateway_rights(options));
    if (!where) return tell(where.error(), options.json);
  }
  own.store.made = true;
  own.master.takes_part = true;
  own.sim.plant = plant_of(own);
  return bring_up(own, {own.machine, own.sim.plant, {}, {}, true});
}

namespace {

// Not with --fast: the gateway needs real time.
void gateway_words(const Verb& up, Options& options, const Word& fast) {
  const auto take = [&options](const std::string& where) {
    options.offers.gateway.where = where, options.sim.pace = true;
  };
  up.word("--gateway", take, "offer the buses by CiA 309-3 there too, such as 127.0.0.1:7000")
      .shown("HOST:PORT")
      .excludes(fast);
  up.flag("--gateway-commands", options.offers.gateway.commands,
          "clients of --gateway may command a real machine: NMT, SDO download, PDO, LSS; else they only read");
  anywhere_flag(up, options.offers.gateway.anywhere);
}

}  // namespace

// Not with --fast: the pages need real time.
void studio_words(const Verb& verb, Options& options, const Word& fast) {
  verb.flag_or_value(
          "--studio", options.offers.studio.where,
          "pages for a browser of this computer, at the address that it prints; --studio=HOST:PORT says where "
          "(default 127.0.0.1, the first free port from 8302; other computers with --studio-certificate)")
      .excludes(fast);
  studio_door_words(verb, options, "--studio-");
}

// Not with --fast: hosts have the time of the clock.
void mqtt_words(const Verb& verb, Options& options, const Word& fast) {
  const auto take = [&options](const std::string& where) { options.offers.mqtt = where, options.sim.pace = true; };
  verb.word("--mqtt", take,
            "the machine is a Sparkplug B edge node at this broker, such as mqtts://broker:8883 (default: as [mqtt] of "
            "the machine file)")
      .shown("URL")
      .excludes(fast);
  verb.flag("--no-mqtt", options.offers.no_mqtt, "no broker, even if the machine file names one");
}

void studio_door_words(const Verb& verb, Options& options, const std::string& prefix) {
  StudioOptions& studio = options.offers.studio;
  verb.word(prefix + "role", studio.roles,
            "prints the page's address for this role, too: view (reads and asks) or operate (also starts, stops, "
            "replaces; no objects, programs, LSS)")
      .one_of(std::vector<std::string>{"view", "operate"})
      .one_each()
      .shown("ROLE");
  verb.word(prefix + "tokens", studio.tokens,
            "the page's tokens are kept in this file, which is made when it is not there (default: new ones for each "
            "start)")
      .shown("FILE");
  verb.word(prefix + "certificate", studio.certificate,
            "the page comes by TLS with this certificate (PEM), and may be offered to other computers")
      .shown("FILE");
  verb.word(prefix + "key", studio.key, "the certificate's private key (PEM, without a passphrase)").shown("FILE");
  verb.flag(prefix + "open-metrics", studio.open_metrics,
            "GET /metrics (Prometheus) needs no token: everyone who reaches the address reads the states of all slots");
}

Word drive_words(const Verb& verb, Options& options) {
  verb.word("--until", options.until, "end when this is reached")
      .one_of(std::vector<std::string>{"operational", "replaced"});
  const Word pace =
      verb.flag("--pace", options.sim.pace, "in real time, and stay up until Ctrl-C (on a terminal: always)");
  Word fast = verb.flag("--fast", options.sim.fast, "as fast as possible, on a terminal too; ends by itself");
  fast.excludes(pace);
  verb.flag("--quiet,-q", options.events.none, "no events: only the slot table at the end, and what is wrong");
  verb.flag("--events", options.events.lines,
            "with --json: every event as a line, as it happens; the last is the report");
  verb.word("--listen,--control", options.control, "socket for other commands (default: by the machine's name)")
      .shown("SOCKET");
  return fast;
}

namespace {

void service_words(const Verb& up, Options& options) {
  up.word("--ready", options.master.ready,
          "when a service manager hears that the service is ready: operational (default: every slot that is not "
          "optional) or started")
      .one_of(std::vector<std::string>{"operational", "started"});
  up.word("--log-level", options.events.level,
          "prints events up to this level: error, warning, notice, info or debug (default: all)")
      .one_of(std::vector<std::string>(log_levels.begin(), log_levels.end()))
      .shown("LEVEL");
}

}  // namespace

void add_up(Verb& berth, Options& options) {
  const Verb up = berth.add("up", "bring a machine up and keep it running", [&options] { return run_up(options); });
  machine_words(up, options);
  machine_word(up, options);
  const Word fast = drive_words(up, options);
  up.word("--on-exit", options.master.on_exit,
          "to the devices when it ends: leave, preop, stop (default: as the machine file)")
      .one_of(std::vector<std::string>{"leave", "preop", "stop"});
  gateway_words(up, options, fast);
  studio_words(up, options, fast);
  mqtt_words(up, options, fast);
  up.word("--master-id", options.master.id, "Berth's own node-ID (default: as the machine file)").from_to(1, 127);
  up.word("--priority", options.master.priority,
          "among several masters of a bus: 0 high to 2 low (default: as the machine file)")
      .from_to(0, 2);
  beside_master_flag(up, options);
  service_words(up, options);
  colour_word(up);
  real_time_word(up, options);
  up.footer(
      "Examples:\n  berth up\n  berth up machine.toml --sim plant.toml\n  berth up machine.toml --port can0 --dry-run\n"
      "  berth up machine.toml --sim plant.toml --pace --gateway 127.0.0.1:7000\n"
      "  berth up machine.toml --sim plant.toml --studio");
}

}  // namespace berth::cli
