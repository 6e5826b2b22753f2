// scan, bind, replace, sdo, nmt, lss, status: one request, carried out in a world of its own (`--sim`) or by a running
// `berth up`.
#include <fmt/format.h>

#include <nlohmann/json.hpp>

#include "ask.hpp"
#include "berth/rt/scope.hpp"
#include "drive.hpp"
#include "single.hpp"
#include "up.hpp"

namespace berth::cli {
namespace {

using namespace std::chrono_literals;
using Json = nlohmann::ordered_json;
using operate::CommandReply;
using operate::CommandRequest;

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
    const auto ended = drive(rig, ending, screen, fast, {});
    rig.session().on_event({});
    rig.session().on_milestone({});
    if (!ended) return tl::unexpected(ended.error());
    return {};
  }
  rig.world().start();
  rt::Duration boot{0};
  for (const auto& device : rig.plant().devices) boot = std::max(boot, device.boot);
  rig.world().sim().run_for(boot + 100ms);
  return {};
}

using Replied = tl::expected<CommandReply, Failure>;

Replied reply_of_own_world(const Options& options, const CommandRequest& request, std::vector<Recorded>& sent) {
  auto made = Rig::make(options, {options.machine, options.sim, {}, {}});
  if (!made) return tl::unexpected(made.error());
  Rig& rig = **made;
  const auto ready = prepare(rig, options);
  if (!ready) return tl::unexpected(ready.error());
  if (options.dry_run) rig.record_sent(sent);
  CommandReply reply;
  bool over = false;
  const auto limit = options.timeout.value_or(5min);
  {
    rt::Scope scope(rig.world().executor());
    scope.spawn(run(rig.session(), request, reply, over));
    rig.world().sim().run_until([&] { return over; }, limit);
  }
  if (over && request.verb == "bind" && !options.json && !options.dry_run && on_terminal() && someone_types()) {
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
  const double s = std::chrono::duration<double>(limit).count();
  return operate::refusal(
      Exit::failed, fmt::format("{}: not done within {} s of bus time; give a longer --timeout", request.verb, s));
}

int in_own_world(const Options& options, const CommandRequest& request) {
  std::vector<Recorded> sent;
  const auto reply = reply_of_own_world(options, request, sent);
  if (!reply) return tell(reply.error(), options.json);
  return options.dry_run ? show_dry(sent, *reply, options.json) : show(*reply, options.json);
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

Replied reply_of_running_up(const Options& options, const CommandRequest& request) {
  std::string path = options.control;
  if (path.empty()) {
    const auto machine = design::load_machine(options.machine);
    if (!machine.machine) return tl::unexpected(failure(machine.findings));
    path = operate::control_path(machine.machine->name);
  }
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

int by_running_up(const Options& options, const CommandRequest& request) {
  if (options.dry_run) {
    if (options.control.empty()) {
      const auto machine = design::load_machine(options.machine);
      if (!machine.machine) return tell(failure(machine.findings), options.json);
    }
    return foreseen(options, request);
  }
  const auto reply = reply_of_running_up(options, request);
  return reply ? show(*reply, options.json) : tell(reply.error(), options.json);
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
  return options.sim.empty() ? by_running_up(options, request) : in_own_world(options, request);
}

tl::expected<CommandReply, Failure> carry_out(const Options& options, CommandRequest request) {
  const auto known = complete(options, request);
  if (!known) return tl::unexpected(known.error());
  std::vector<Recorded> sent;
  return options.sim.empty() ? reply_of_running_up(options, request) : reply_of_own_world(options, request, sent);
}

}  // namespace berth::cli
