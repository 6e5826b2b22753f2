// scan, bind, replace, sdo, nmt, lss, status: one request, carried out in its own simulated world (`--sim`), by a
// running `berth up`, or by this process on the machine's ports.
#include <fmt/format.h>
#include <poll.h>

#include <algorithm>
#include <array>
#include <filesystem>
#include <memory>
#include <nlohmann/json.hpp>

#include "ask.hpp"
#include "berth/command/control.hpp"
#include "berth/command/stored.hpp"
#include "berth/command/verbs.hpp"
#include "berth/operate/slot_rows.hpp"
#include "berth/text/columns.hpp"
#include "berth/text/printable.hpp"
#include "drive.hpp"
#include "execute.hpp"
#include "machine_file.hpp"
#include "ports.hpp"
#include "redraw.hpp"
#include "second_word.hpp"
#include "single.hpp"
#include "slot_table.hpp"

namespace berth::cli {
namespace {

using namespace std::chrono_literals;
using Json = nlohmann::ordered_json;

// Does the reply ask for the user's confirmation?
bool wants_yes(const command::Reply& reply) {
  const auto json = Json::parse(reply.json, nullptr, false);
  return reply.status == Exit::no && json.is_object() && json.value("result", "") == "unconfirmed";
}

bool may_ask(const Options& options) { return !options.json && !options.yes && someone_types(); }

// A state of a slot in which the user has to do something.
bool is_trouble(const std::string& state) {
  using enum places::SlotState;
  return std::ranges::any_of(std::array{absent, failed, question, duplicate, wrong_type, power_cycle},
                             [&](places::SlotState one) { return state == places::name(one); });
}

// The reply's lines. In a slot table (a heading, then one row per slot), rows of slots in trouble are urgent.
std::vector<BoardLine> drawn_lines(const command::Reply& reply) {
  const auto json = Json::parse(reply.json, nullptr, false);
  const auto slots = json.is_object() ? json.find("slots") : json.end();
  const bool table = slots != json.end() && slots->is_array() && slots->size() < reply.lines.size();
  std::vector<BoardLine> lines;
  for (std::size_t i = 0; i < reply.lines.size(); ++i) {
    const bool row = table && i > 0 && i <= slots->size();
    lines.push_back({text::one_line(reply.lines[i]), row && is_trouble((*slots)[i - 1].value("state", ""))});
  }
  return lines;
}

void print_reply(const command::Reply& reply) {
  if (!coloured()) return print_lines(reply.lines);
  for (const auto& line : drawn_lines(reply)) {
    if (line.urgent) write_text("\x1b[33m" + line.text + "\x1b[0m\n");
    if (!line.urgent) print_line(line.text);
  }
}

// With --watch, JSON takes one line per reply.
int show(const command::Reply& reply, const Options& options) {
  if (options.json) {
    print_text(Json::parse(reply.json).dump(options.single.watch ? -1 : 2));
    return reply.status;
  }
  print_reply(reply);
  if (!reply.error.empty()) print_errors(reply.error);
  return reply.status;
}

// The simulated devices need their time to boot; with --up the main job gets the time it needs.
tl::expected<void, Failure> prepare_rig(MachineRun& run, const Options& options) {
  if (!options.single.bring_up) {
    run.power_on_and_boot(100ms);
    return {};
  }
  Options up = options;
  up.timeout.reset();
  if (run.loop() != nullptr) up.timeout = options.timeout.value_or(5min);
  Screen screen(run.session(), {.quiet = true});
  Ending ending(run, "operational");
  const auto ended = drive(run, ending, screen, up, {}, nullptr);
  if (!ended) return tl::unexpected(ended.error());
  return {};
}

using Replied = tl::expected<command::Reply, Failure>;
/// Gets each reply except the last; empty: the request is made once.
using Repeat = std::function<void(const command::Reply&)>;

// A scan of heard nodes sends only SDO upload requests: also permitted on a bus with another master.
bool only_looks(const command::Request& request) {
  return request.verb == "scan" && !request.arguments.contains("all");
}

// Only `bind` and `replace` may make a slot table: they are the first to write one.
Options own_options(const Options& options, const command::Request& request) {
  Options own = options;
  own.store.made = request.verb == "bind" || request.verb == "replace";
  own.outside.read_only = only_looks(request) && !options.single.bring_up;
  return own;
}

// The request searches for devices by LSS and RAND, which only a master may do.
bool takes_bus(const command::Request& request) {
  const bool searches = request.verb == "scan" && !only_looks(request);
  return searches || request.verb == "bind" || request.verb == "replace";
}

// Adds the other masters on the examined buses to the reply.
void add_masters(MachineRun& run, command::Reply& reply) {
  for (const auto& bus : run.machine().buses) {
    const auto* const gate = run.guards().gate(bus.name);
    const auto report = gate == nullptr ? std::vector<std::string>() : gate->report();
    if (!report.empty()) reply.lines.push_back(fmt::format("bus {}: {}", bus.name, report.front()));
  }
}

// Says what binding would do to a machine that never ran.
command::Reply unconfirmed_binding() {
  auto reply = command::refusal(Exit::no,
                                "no slot of this machine has a device yet: binding searches for devices by LSS and "
                                "RAND, gives them node-IDs and lets them store these; nothing was sent; confirm it "
                                "with --yes");
  reply.json = R"({"result": "unconfirmed"})";
  return reply;
}

// After binding in a simulated world, which can wait: asks the user which device sits where.
void ask_where_devices_sit(MachineRun& run, command::Reply& reply, rt::Duration limit) {
  print_lines(reply.lines);
  ask_here(run, limit);
  const auto now = run.session().report();
  reply.lines = operate::to_table(now.slots);
  if (!now.questions.empty() || reply.status != Exit::no) return;
  const bool all = std::ranges::none_of(now.slots, [&](const auto& s) {
    const design::Slot* const slot = run.machine().slot(s.bus, s.id);
    const bool needed = slot == nullptr || !slot->spec.optional;
    return needed && s.state != places::SlotState::present && s.state != places::SlotState::operational;
  });
  if (!all) return;
  reply.status = Exit::done;
  reply.error.clear();
}

// Repeats the request until a signal comes, the time of --timeout is over, or the request fails.
command::Reply repeated(MachineRun& run, const command::Request& request, command::Reply reply, const Options& options,
                        const Repeat& repeat) {
  const rt::Time end = run.now() + options.timeout.value_or(24h * 365);
  while (reply.status <= Exit::no && run.now() + *options.single.watch < end) {
    repeat(reply);
    if (run_must_end()) break;  // nobody reads the output any more
    wait_for(run.driver(), run.interrupt(), *options.single.watch);
    command::Reply next;
    if (run.interrupt().came() || !execute_in(run, request, next, end - run.now())) {
      reply.lines.clear();  // the reply has been shown already
      break;
    }
    reply = std::move(next);
  }
  return reply;
}

// A request that takes long reports its progress, unless a program reads the answer.
bool tells_progress(const Options& options) { return !options.json && !options.dry_run; }

void tell_progress(MachineRun& run, const command::Request& request, const Options& options) {
  const bool takes_long = request.verb == "configure" || request.verb == "boot";
  if (!takes_long || !tells_progress(options) || !on_terminal()) return;
  run.session().on_event([](const operate::Event& event) {
    print_line(event.slot.empty() ? event.text : event.slot + ": " + event.text);
  });
}

// `seats`: the request gives devices node-IDs.
tl::expected<void, Failure> takes_alone(MachineRun& run, const Options& options, bool seats = true) {
  const bool first = seats && run.first_start();
  if (auto alone = run.strangers().ask(first); !alone) return alone;
  if (auto no = no_second_word(run, options)) return tl::unexpected(std::move(*no));
  return {};
}

// Listens on buses outside this process before anything is sent, and asks for other masters before the request uses a
// master's rights.
Replied done_in(MachineRun& run, const Options& options, const command::Request& request, std::vector<Recorded>& sent,
                const Repeat& repeat) {
  Strangers& strangers = run.strangers();
  if (const auto clear = strangers.listen_first(); !clear) return tl::unexpected(clear.error());
  if (options.single.bring_up) {
    if (const auto alone = takes_alone(run, options); !alone) return tl::unexpected(alone.error());
  }
  const auto ready = prepare_rig(run, options);
  if (!ready) return tl::unexpected(ready.error());
  const bool binds = request.verb == "bind";
  if (binds && !options.dry_run && !options.yes && run.first_start()) return unconfirmed_binding();
  if (options.dry_run) run.record().collect_sent(sent);
  if (takes_bus(request)) {
    if (const auto alone = takes_alone(run, options, request.verb != "scan"); !alone)
      return tl::unexpected(alone.error());
  }
  tell_progress(run, request, options);
  command::Reply reply;
  if (tells_progress(options)) reply.progress = print_progress;
  const auto limit = options.timeout.value_or(5min);
  if (execute_in(run, request, reply, limit)) {
    if (only_looks(request)) add_masters(run, reply);
    if (repeat) return repeated(run, request, std::move(reply), options, repeat);
    const bool asks = binds && run.loop() == nullptr && !options.json && !options.dry_run;
    if (asks && on_terminal() && someone_types()) ask_where_devices_sit(run, reply, limit);
    return reply;
  }
  if (options.dry_run && !run.guards().empty()) {
    reply = {};
    reply.json = R"({"result": "what comes next depends on the answer"})";
    return reply;
  }
  if (run.interrupt().came()) return command::refusal(Exit::failed, request.verb + ": ended before it was done");
  const double s = std::chrono::duration<double>(limit).count();
  return command::refusal(
      Exit::failed, fmt::format("{}: not done within {} s of bus time; give a longer --timeout", request.verb, s));
}

Replied reply_of_own_world(const Options& options, const command::Request& request, std::vector<Recorded>& sent,
                           const Repeat& repeat) {
  const bool links = options.single.bring_up || request.verb == "boot" || request.verb == "configure";
  auto made = MachineRun::make(own_options(options, request), {options.machine, options.sim.plant, {}, {}, links});
  if (!made) return tl::unexpected(made.error());
  auto reply = done_in(**made, options, request, sent, repeat);
  if (reply) reply->status = (*made)->record().finish(reply->status);
  return reply;
}

// Nothing leaves the simulated world, so no confirmation is needed.
int dry_in_own_world(const Options& options, command::Request request) {
  request.arguments["yes"] = "1";
  std::vector<Recorded> sent;
  const auto reply = reply_of_own_world(options, request, sent, {});
  if (!reply) return tell(reply.error(), options.json);
  print_dry_run(sent, &*reply, options.json);
  return reply->status;
}

int foreseen(const Options& options, const command::Request& request, const design::Machine& machine) {
  std::string problem;
  const auto frames = command::foreseeable_frames(request, machine, problem);
  if (!problem.empty()) {
    return tell(
        failure(Exit::usage, problem + "; a dry run of it needs a simulated world of its own: give --sim PLANT"),
        options.json);
  }
  std::vector<Recorded> sent;
  for (const auto& f : frames) sent.push_back({std::nullopt, options.bus, can::to_string(f), true});
  print_dry_run(sent, nullptr, options.json);
  return Exit::done;
}

Replied ask_running_up(const Options& options, const command::Request& request, const std::string& path,
                       const std::function<bool()>& goes_on = {}) {
  const auto patience = std::chrono::duration_cast<std::chrono::milliseconds>(options.timeout.value_or(2min)).count();
  command::Request wanted = request;
  wanted.progress = true;
  name_machine(wanted, options);
  std::string last;
  const auto tell_progress = [&](const std::string& line) {
    last = line;
    if (tells_progress(options)) print_progress(line);
  };
  const auto reply = command::control_call(
      path, wanted, static_cast<int>(std::min<std::int64_t>(patience, 24 * 3'600'000)), tell_progress, goes_on);
  if (reply) return *reply;
  const std::string machine = options.machine.empty() ? "MACHINE" : options.machine;
  // The process exists but did not answer: another would not help.
  const std::string behind = last.empty() ? "" : fmt::format(" ({})", last);
  if (command::control_answers(path)) return tl::unexpected(failure(Exit::failed, reply.error() + behind));
  return tl::unexpected(failure_in_lines(
      Exit::failed, {fmt::format("no running `berth up` does this for {}: {}", machine, reply.error()),
                     fmt::format("start one (berth up {} --sim PLANT --pace), or give --sim PLANT to do it in a "
                                 "simulated world of its own",
                                 machine)}));
}

// --watch, answered by a running `berth up`.
Replied ask_again(const Options& options, const command::Request& request, const std::string& path,
                  const Repeat& repeat) {
  auto reply = ask_running_up(options, request, path);
  if (!repeat) return reply;
  Interrupt interrupt;
  const auto began = std::chrono::steady_clock::now();
  const auto end = began + options.timeout.value_or(24h * 365);
  while (reply && reply->status <= Exit::no && std::chrono::steady_clock::now() + *options.single.watch < end) {
    repeat(*reply);
    if (run_must_end()) return reply;
    const auto pause = std::chrono::ceil<std::chrono::milliseconds>(*options.single.watch).count();
    pollfd signals{interrupt.descriptor(), POLLIN, 0};
    if (::poll(&signals, 1, static_cast<int>(pause)) > 0) {
      reply->lines.clear();
      return reply;
    }
    reply = ask_running_up(options, request, path);
  }
  return reply;
}

// ---- many requests ----

using Talk = std::function<int(const Conversation&)>;

tl::expected<int, Failure> converse_in_own_world(const Options& options, const command::Request& kind,
                                                 const Talk& talk) {
  auto made = MachineRun::make(own_options(options, kind),
                               {options.machine, options.sim.plant, {}, {}, options.single.bring_up});
  if (!made) return tl::unexpected(made.error());
  MachineRun& run = **made;
  if (const auto clear = run.strangers().listen_first(); !clear) return tl::unexpected(clear.error());
  if (options.single.bring_up) {
    if (const auto alone = takes_alone(run, options); !alone) return tl::unexpected(alone.error());
  }
  if (const auto ready = prepare_rig(run, options); !ready) return tl::unexpected(ready.error());
  const Conversation by_rig{[&run](const command::Request& request, const std::function<bool()>& goes_on) -> Replied {
                              command::Reply reply;
                              if (execute_in(run, request, reply, 5min, goes_on)) return reply;
                              return tl::unexpected(failure(Exit::failed, request.verb + ": ended before it was done"));
                            },
                            [&run](std::chrono::nanoseconds time) {
                              wait_for(run.driver(), run.interrupt(), time);
                              return !run.interrupt().came();
                            },
                            [&run] { return run.now(); }, run.loop()};
  return run.record().finish(talk(by_rig));
}

tl::expected<int, Failure> converse_by_control(const Options& options, const std::string& path, const Talk& talk) {
  rt::Executor executor;
  io::LoopDriver driver(executor);
  Interrupt interrupt(&driver.loop());
  // The call blocks while it waits, so the loop is turned from within it, for the keys.
  return talk({[&](const command::Request& request, const std::function<bool()>& goes_on) {
                 return ask_running_up(options, request, path, [&] {
                   driver.loop().turn(rt::Duration{0});
                   return goes_on() && !interrupt.came();
                 });
               },
               [&](std::chrono::nanoseconds time) {
                 driver.loop().turn(rt::Duration{0});  // reads keys even if no time is left
                 wait_for(driver, interrupt, time);
                 return !interrupt.came();
               },
               [&driver] { return driver.loop().clock(); }, &driver.loop()});
}

// ---- from the slot table ----

// The machine's port is not used. A simulated machine has a slot table only if one is named, or lies beside its file.
bool by_slot_table(const design::Machine& machine, const Options& options, const command::Request& request) {
  const bool asks = request.verb == "report" || request.verb == "history";
  const bool kept = !options.store.file.empty() || std::filesystem::exists(default_store(machine.file));
  return asks && options.control.empty() && (all_elsewhere(machine) || kept);
}

Replied reply_of_slot_table(const design::Machine& machine, const Options& options, const command::Request& request) {
  Options own = options;
  own.outside.observe = true;  // a copy: the table belongs to the process that runs the machine, or is about to
  const std::string beside = default_store(machine.file);
  if (own.store.file.empty() && !all_elsewhere(machine)) own.store.file = beside;
  Interrupt interrupt;
  auto table = SlotTable::open(machine, own);
  if (!table) return tl::unexpected(table.error());
  command::Reply reply;
  if (request.verb == "report") {
    command::tell_report((*table)->store(), machine, request, reply);
  } else {
    command::tell_history((*table)->store(), machine, request, reply);
  }
  return reply;
}

// Carries the request out by a running `berth up`, since one process owns a port; else by this process on the machine's
// ports; else not at all, and the failure says so. Requests about the slot table need neither.
Replied reply_outside(const Options& options, const command::Request& request, std::vector<Recorded>& sent,
                      const Repeat& repeat) {
  const bool bus_alone = options.machine.empty() && !options.ports.empty();
  if (options.machine.empty() && !bus_alone) return ask_again(options, request, options.control, repeat);
  auto loaded = machine_of(options);
  if (!loaded) return tl::unexpected(loaded.error());
  design::Machine machine = std::move(*loaded);
  const auto path = bus_alone ? std::string() : running_control(options, machine);
  if (!path.empty()) return ask_again(options, request, path, repeat);
  if (auto good = override_ports(machine, options); !good) return tl::unexpected(good.error());
  if (!options.bus.empty()) restrict_to(machine, options.bus);
  if (options.control.empty() && request.verb.starts_with("note ")) {
    command::Reply reply;
    command::tell_note(machine, request, reply);
    return reply;
  }
  if (by_slot_table(machine, options, request)) return reply_of_slot_table(machine, options, request);
  if (options.control.empty() && all_elsewhere(machine)) return reply_of_own_world(options, request, sent, repeat);
  return ask_running_up(options, request, control_paths(options, machine).front());
}

// Other requests can go to a bus without a machine file.
bool needs_slots(const command::Request& request) {
  static constexpr std::array<std::string_view, 12> verbs{"report",  "bind",      "replace",    "forget",
                                                          "poll",    "configure", "upload",     "boot",
                                                          "history", "note read", "note write", "note remove"};
  return std::ranges::find(verbs, request.verb) != verbs.end();
}

// A dry run without a simulated world: the frames that are sent whatever the answers are; or, on the machine's own
// ports, the frames up to the first question.
int dry_outside(const Options& options, const command::Request& request) {
  if (options.machine.empty() && options.ports.empty()) return foreseen(options, request, design::Machine());
  auto loaded = machine_of(options);
  if (!loaded) return tell(loaded.error(), options.json);
  design::Machine& machine = *loaded;
  std::string problem;
  static_cast<void>(command::foreseeable_frames(request, machine, problem));
  if (problem.empty() || !options.control.empty()) return foreseen(options, request, machine);
  if (auto good = override_ports(machine, options); !good) return tell(good.error(), options.json);
  if (!options.bus.empty()) restrict_to(machine, options.bus);
  return all_elsewhere(machine) ? dry_in_own_world(options, request) : foreseen(options, request, machine);
}

tl::expected<void, Failure> complete(Options& options, command::Request& request) {
  if (!options.bus.empty()) request.arguments["bus"] = options.bus;
  options.machine = default_machine(options);
  if (!options.machine.empty() || (!options.control.empty() && options.sim.plant.empty())) return {};
  const bool bus_alone = !options.ports.empty() && options.sim.plant.empty();
  if (bus_alone && !needs_slots(request)) {
    request.arguments.erase("bus");  // there is only one bus, whatever its name
    return {};
  }
  const std::string wanted = bus_alone ? "this command needs slots: name the machine file, --machine FILE"
                                       : "name the machine file, --machine FILE, or a port, --port can0";
  return tl::unexpected(failure(Exit::usage, wanted + machines_here()));
}

Replied carry_out_again(const Options& options, const command::Request& request, const Repeat& repeat) {
  std::vector<Recorded> sent;
  return options.sim.plant.empty() ? reply_outside(options, request, sent, repeat)
                                   : reply_of_own_world(options, request, sent, repeat);
}

// --watch: shows every reply except the last, which the caller shows.
Repeat watching(const Options& options) {
  if (!options.single.watch) return {};
  const auto plain = [&options](const command::Reply& reply) { static_cast<void>(show(reply, options)); };
  if (options.json || !can_draw()) return plain;
  // Redraws in place as long as all lines fit.
  return [plain, redraw = std::make_shared<Redraw>()](const command::Reply& reply) {
    const BoardSize size = terminal_size();
    std::vector<BoardLine> lines;
    for (const auto& line : drawn_lines(reply)) {
      for (auto& part : text::wrapped(line.text, std::max<std::size_t>(size.columns, 1)))
        lines.push_back({std::move(part), line.urgent});
    }
    const bool fits = reply.error.empty() && lines.size() < size.rows;
    if (!fits) redraw->keep();
    if (!fits || lines.size() < 2) return plain(reply);
    redraw->draw({}, std::move(lines), size);
  };
}

}  // namespace

int run_single(const Options& given, command::Request request) {
  Options options = given;
  const auto known = complete(options, request);
  if (!known) return tell(known.error(), options.json);
  if (options.dry_run)
    return options.sim.plant.empty() ? dry_outside(options, request) : dry_in_own_world(options, request);
  auto reply = carry_out_again(options, request, watching(options));
  if (reply && wants_yes(*reply) && may_ask(options)) {
    print_lines(reply->lines);
    print_text(reply->error);
    if (Interrupt interrupt; !ask_yes("Do it?", interrupt)) return Exit::no;
    request.arguments["yes"] = "1";
    Options sure = options;
    sure.yes = true;
    reply = carry_out_again(sure, request, watching(options));
  }
  return reply ? show(*reply, options) : tell(reply.error(), options.json);
}

// As in `reply_outside`, a running `berth up` comes first.
tl::expected<int, Failure> converse(const Options& given, const command::Request& kind, const Talk& talk) {
  Options options = given;
  command::Request request = kind;
  if (const auto known = complete(options, request); !known) return tl::unexpected(known.error());
  if (!options.sim.plant.empty()) return converse_in_own_world(options, request, talk);
  const bool bus_alone = options.machine.empty() && !options.ports.empty();
  if (options.machine.empty() && !bus_alone) return converse_by_control(options, options.control, talk);
  auto machine = machine_of(options);
  if (!machine) return tl::unexpected(machine.error());
  const auto path = bus_alone ? std::string() : running_control(options, *machine);
  if (!path.empty()) return converse_by_control(options, path, talk);
  if (auto good = override_ports(*machine, options); !good) return tl::unexpected(good.error());
  if (!options.bus.empty()) restrict_to(*machine, options.bus);
  if (options.control.empty() && all_elsewhere(*machine)) return converse_in_own_world(options, request, talk);
  return converse_by_control(options, control_paths(options, *machine).front(), talk);
}

tl::expected<command::Reply, Failure> carry_out(const Options& given, command::Request request) {
  Options options = given;
  const auto known = complete(options, request);
  if (!known) return tl::unexpected(known.error());
  return carry_out_again(options, request, {});
}

}  // namespace berth::cli
