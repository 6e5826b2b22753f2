// scan, bind, replace, sdo, nmt, lss, status: one request, carried out in a world of its own (`--sim`) or by a running
// `berth up`.
#include <fmt/format.h>

#include <nlohmann/json.hpp>

#include "ask.hpp"
#include "berth/rt/scope.hpp"
#include "drive.hpp"
#include "ports.hpp"
#include "single.hpp"
#include "up.hpp"

namespace berth::cli {
namespace {

using namespace std::chrono_literals;
using Json = nlohmann::ordered_json;
using operate::CommandReply;
using operate::CommandRequest;

// A reply that asks for a person's confirmation.
bool wants_yes(const CommandReply& reply) {
  const auto json = Json::parse(reply.json, nullptr, false);
  return reply.status == Exit::no && json.is_object() && json.value("result", "") == "unconfirmed";
}

bool may_ask(const Options& options) { return !options.json && !options.yes && someone_types(); }

int show(const CommandReply& reply, bool json) {
  if (json) {
    print_line(Json::parse(reply.json).dump(2));
    return reply.status;
  }
  print_lines(reply.lines);
  if (!reply.error.empty()) print_error(reply.error);
  return reply.status;
}

// What a dry run says: the frames, and what came of the command in the throw-away world.
int show_dry(const std::vector<Recorded>& frames, const CommandReply& reply, bool json) {
  if (json) {
    Json all;
    all["dry_run"] = true;
    all["frames"] = Json::array();
    for (const auto& f : frames) all["frames"].push_back({{"at_s", f.at_s}, {"bus", f.bus}, {"frame", f.frame}});
    all["reply"] = Json::parse(reply.json);
    print_line(all.dump(2));
    return reply.status;
  }
  for (const auto& f : frames) print_line(candump_line(f));
  if (!reply.error.empty()) print_error(reply.error);
  return reply.status;
}

rt::Task<void> run(operate::Session& session, const CommandRequest& request, CommandReply& reply, bool& over) {
  co_await operate::execute(session, request, reply);
  over = true;
}

// The simulated devices need their time to boot; with --up the main job gets the time it needs.
tl::expected<void, Failure> prepare(Rig& rig, const Options& options) {
  if (options.bring_up) {
    Options fast = options;
    fast.timeout.reset();
    Screen screen(rig.session(), false, true);
    Ending ending(rig, "operational");
    DriveOptions how;
    how.paced = rig.loop() != nullptr;
    if (how.paced) fast.timeout = options.timeout.value_or(5min);
    const auto ended = drive(rig, ending, screen, fast, how);
    rig.session().on_event({});
    rig.session().on_milestone({});
    if (!ended) return tl::unexpected(ended.error());
    return {};
  }
  rig.world().start();
  if (rig.loop() != nullptr) return {};
  rt::Duration boot{0};
  for (const auto& device : rig.plant().devices) boot = std::max(boot, device.boot);
  rig.world().sim().run_for(boot + 100ms);
  return {};
}

// Until it is over, `limit` of the bus's time went by, or a person ended it.
void pass_until(Rig& rig, const bool& over, rt::Duration limit) {
  Interrupt& interrupt = rig.interrupt();
  if (rig.loop() == nullptr) {
    unsigned looks = 0;
    rig.world().sim().run_until([&] { return over || (++looks % 256 == 0 && interrupt.came()); }, limit);
    return;
  }
  const auto end = rig.world().executor().now() + limit;
  while (!over && rig.world().executor().now() < end && !rig.dry_run_over() && !interrupt.came()) {
    rig.loop()->turn(50ms);
  }
}

using Replied = tl::expected<CommandReply, Failure>;

// A slot table is made where one is written for the first time.
Options own_options(const Options& options, const CommandRequest& request) {
  Options own = options;
  own.makes_store = request.verb == "bind" || request.verb == "replace";
  // It sends nothing: a port that it held would be missing to a `berth up` that starts just now.
  if (request.verb == "report" && options.sim.empty()) own.observe = true;
  return own;
}

// It looks for devices by LSS and RAND, which is a master's right alone.
bool takes_bus(const CommandRequest& request) {
  return request.verb == "scan" || request.verb == "bind" || request.verb == "replace";
}

Replied reply_of_own_world(const Options& options, const CommandRequest& request, std::vector<Recorded>& sent) {
  auto made = Rig::make(own_options(options, request), {options.machine, options.sim, {}, {}});
  if (!made) return tl::unexpected(made.error());
  Rig& rig = **made;
  if (const auto clear = rig.listen_first(); !clear) return tl::unexpected(clear.error());
  if (options.bring_up) {
    if (const auto alone = rig.ask_strangers(); !alone) return tl::unexpected(alone.error());
  }
  const auto ready = prepare(rig, options);
  if (!ready) return tl::unexpected(ready.error());
  if (request.verb == "bind" && !options.dry_run && !options.yes && rig.first_start()) {
    auto reply = operate::refusal(Exit::no,
                                  "no slot of this machine has a device yet: binding searches for devices by LSS and "
                                  "RAND, gives them node-IDs and lets them store these; nothing was sent; confirm it "
                                  "with --yes");
    reply.json = R"({"result": "unconfirmed"})";
    return reply;
  }
  if (options.dry_run) rig.record_sent(sent);
  if (takes_bus(request)) {
    if (const auto alone = rig.ask_strangers(); !alone) return tl::unexpected(alone.error());
  }
  CommandReply reply;
  bool over = false;
  const auto limit = options.timeout.value_or(5min);
  {
    rt::Scope scope(rig.world().executor());
    scope.spawn(run(rig.session(), request, reply, over));
    pass_until(rig, over, limit);
  }
  if (over && request.verb == "bind" && rig.loop() == nullptr && !options.json && !options.dry_run && on_terminal() &&
      someone_types()) {
    print_lines(reply.lines);
    ask_here(rig, limit);
    const auto now = rig.session().report();
    reply.lines = operate::to_table(now.slots);
    if (now.questions.empty() && reply.status == Exit::no) {
      const bool all = std::ranges::none_of(now.slots, [&](const auto& s) {
        const design::Slot* const slot = rig.machine().slot(s.bus, s.id);
        const bool needed = slot == nullptr || !slot->spec.optional;
        return needed && s.state != places::SlotState::present && s.state != places::SlotState::operational;
      });
      if (all) reply.status = Exit::done;
      if (all) reply.error.clear();
    }
  }
  if (over) return reply;
  if (options.dry_run && rig.loop() != nullptr) {
    reply = {};
    reply.json = R"({"result": "what comes next depends on the answer"})";
    return reply;
  }
  if (rig.interrupt().came()) return operate::refusal(Exit::failed, request.verb + ": ended before it was done");
  const double s = std::chrono::duration<double>(limit).count();
  return operate::refusal(
      Exit::failed, fmt::format("{}: not done within {} s of bus time; give a longer --timeout", request.verb, s));
}

// Nothing leaves this world, so the user is not asked.
int dry_in_own_world(const Options& options, CommandRequest request) {
  request.arguments["yes"] = "1";
  std::vector<Recorded> sent;
  const auto reply = reply_of_own_world(options, request, sent);
  return reply ? show_dry(sent, *reply, options.json) : tell(reply.error(), options.json);
}

int foreseen(const Options& options, const CommandRequest& request) {
  std::string problem;
  const auto frames = operate::foreseeable_frames(request, problem);
  if (!problem.empty()) {
    return tell(failure(Exit::usage, problem + "; a dry run of it needs a world to throw away: give --sim PLANT"),
                options.json);
  }
  if (options.json) {
    Json all;
    all["dry_run"] = true;
    all["frames"] = Json::array();
    for (const auto& f : frames)
      all["frames"].push_back({{"at_s", nullptr}, {"bus", options.bus}, {"frame", can::to_string(f)}});
    print_line(all.dump(2));
    return Exit::done;
  }
  for (const auto& f : frames) print_line(can::to_string(f));
  return Exit::done;
}

// The processes that run the machine, or this bus of it, at the control socket.
std::vector<std::string> control_paths(const Options& options, const design::Machine& machine) {
  if (!options.control.empty()) return {options.control};
  std::vector<std::string> paths{operate::control_path(machine.name)};
  const bool only = options.bus.empty() && machine.buses.size() == 1;
  const std::string bus = only ? machine.buses.front().name : options.bus;
  if (!bus.empty()) paths.push_back(operate::control_path(bus_process(machine.name, bus)));
  return paths;
}

Replied ask_running_up(const Options& options, const CommandRequest& request, const std::string& path) {
  const auto patience = std::chrono::duration_cast<std::chrono::milliseconds>(options.timeout.value_or(2min)).count();
  const auto reply =
      operate::control_call(path, request, static_cast<int>(std::min<std::int64_t>(patience, 24 * 3'600'000)));
  if (reply) return *reply;
  const std::string machine = options.machine.empty() ? "MACHINE" : options.machine;
  return tl::unexpected(failure(
      Exit::failed, fmt::format("no running `berth up` does this for {}: {}\nstart one (berth up {} --sim PLANT "
                                "--pace), or give --sim PLANT to do it in a simulated world of its own",
                                machine, reply.error(), machine)));
}

// What does it: a running `berth up` before all, since one process owns a port; else this process on the machine's
// ports; else none, which the failure of asking says.
Replied reply_outside(const Options& options, const CommandRequest& request, std::vector<Recorded>& sent) {
  if (options.machine.empty()) return ask_running_up(options, request, options.control);
  auto loaded = design::load_machine(options.machine);
  if (!loaded.machine) return tl::unexpected(failure(loaded.findings));
  design::Machine machine = std::move(*loaded.machine);
  const auto paths = control_paths(options, machine);
  for (const auto& path : paths) {
    if (operate::control_answers(path)) return ask_running_up(options, request, path);
  }
  if (auto good = override_ports(machine, options); !good) return tl::unexpected(good.error());
  if (!options.bus.empty()) restrict_to(machine, options.bus);
  if (options.control.empty() && all_elsewhere(machine)) return reply_of_own_world(options, request, sent);
  return ask_running_up(options, request, paths.front());
}

// Without a world to throw away: the frames that go out whatever is answered; or, on the machine's own ports, what
// goes out up to the first question.
int dry_outside(const Options& options, const CommandRequest& request) {
  std::string problem;
  static_cast<void>(operate::foreseeable_frames(request, problem));
  if (options.machine.empty()) return foreseen(options, request);
  auto loaded = design::load_machine(options.machine);
  if (!loaded.machine) return tell(failure(loaded.findings), options.json);
  if (problem.empty() || !options.control.empty()) return foreseen(options, request);
  if (auto good = override_ports(*loaded.machine, options); !good) return tell(good.error(), options.json);
  if (!options.bus.empty()) restrict_to(*loaded.machine, options.bus);
  return all_elsewhere(*loaded.machine) ? dry_in_own_world(options, request) : foreseen(options, request);
}

tl::expected<void, Failure> complete(const Options& options, CommandRequest& request) {
  if (!options.bus.empty()) request.arguments["bus"] = options.bus;
  if (!options.machine.empty() || (!options.control.empty() && options.sim.empty())) return {};
  return tl::unexpected(failure(Exit::usage, "name the machine file: --machine FILE"));
}

}  // namespace

int run_single(const Options& options, CommandRequest request) {
  const auto known = complete(options, request);
  if (!known) return tell(known.error(), options.json);
  if (options.dry_run) return options.sim.empty() ? dry_outside(options, request) : dry_in_own_world(options, request);
  auto reply = carry_out(options, request);
  if (reply && wants_yes(*reply) && may_ask(options)) {
    print_lines(reply->lines);
    print_line(reply->error);
    if (Interrupt interrupt; !ask_yes("Do it?", interrupt)) return Exit::no;
    request.arguments["yes"] = "1";
    Options sure = options;
    sure.yes = true;
    reply = carry_out(sure, request);
  }
  return reply ? show(*reply, options.json) : tell(reply.error(), options.json);
}

tl::expected<CommandReply, Failure> carry_out(const Options& options, CommandRequest request) {
  const auto known = complete(options, request);
  if (!known) return tl::unexpected(known.error());
  std::vector<Recorded> sent;
  return options.sim.empty() ? reply_outside(options, request, sent) : reply_of_own_world(options, request, sent);
}

}  // namespace berth::cli
