#include "drive.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <nlohmann/json.hpp>

#include "ask.hpp"
#include "berth/command/audit.hpp"
#include "berth/command/control.hpp"
#include "berth/command/execute.hpp"
#include "berth/command/verbs.hpp"
#include "gateway.hpp"
#include "live_values.hpp"
#include "plant_commands.hpp"
#include "studio_host.hpp"
#include "world_time.hpp"

namespace berth::cli {

using namespace std::chrono_literals;

// ---- Ending ----

Ending::Ending(Rig& rig, std::string until) : rig_(&rig), until_(std::move(until)) {
  for (const auto& bus : rig.machine().buses) {
    quiet_ = std::max(quiet_, bus.timing.heartbeat_timeout + 2 * bus.timing.probe_period);
  }
  rt::Duration boot{0};
  for (const auto& device : rig.plant().devices) boot = std::max(boot, device.boot);
  quiet_ += boot;
  // A failed step is tried again when the whole bus is asked anew: every 8 looks, and asking takes time.
  patience_ = quiet_;
  for (const auto& bus : rig.machine().buses) patience_ = std::max(patience_, quiet_ + 10 * bus.timing.probe_period);
  // A bus beneath that does not come up in time is left to its gateway's master, and tried again after that time.
  for (const auto& bus : rig.machine().beneath) {
    const rt::Duration time = std::max<rt::Duration>(bus.startup.boot_time, tree::Beneath::patience);
    patience_ = std::max(patience_, quiet_ + 2 * time);
  }
  limit_ = 10min;
  for (const auto& event : rig.plant().events) limit_ += event.delay + event.duration;
  plan_behind(plant::After::start);
}

// A device without a place is found again and again; that is no change. Only the event's own bus is checked: a machine
// of a hundred buses has a hundred times the events.
void Ending::event(const operate::Event& event) {
  look_ = true;
  const auto* const network = rig_->session().network(event.bus);
  const bool of_a_slot = event.kind == operate::EventKind::state || event.kind == operate::EventKind::bound;
  if (network == nullptr && of_a_slot) changed_ = rig_->now();  // beneath a gateway
  if (network == nullptr) return;
  auto slots = network->occupancy();
  auto& known = now_[event.bus];
  if (slots == known) return;
  known = std::move(slots);
  changed_ = rig_->now();
}

void Ending::plan_behind(plant::After after) {
  const rt::Time now = rig_->now();
  changed_ = now;
  for (const auto& event : rig_->plant().events) {
    if (event.after == after) due_ = std::max(due_, now + event.delay + event.duration);
  }
}

void Ending::milestone(operate::Milestone milestone) {
  plan_behind(after(milestone));
  if (milestone != operate::Milestone::operational) return;
  first_.clear();
  for (const auto& network : rig_->session().networks()) first_[network->bus().name] = network->occupancy();
}

bool Ending::plan_over() const { return rig_->now() >= due_; }

bool Ending::replaced() const {
  if (first_.empty() || !rig_->session().operational()) return false;
  return std::ranges::any_of(rig_->session().networks(), [this](const auto& network) {
    const auto stays = [](const auto& now, const auto& first) { return !now.device || now.device == first.device; };
    return !std::ranges::equal(network->occupancy(), first_.at(network->bus().name), stays);
  });
}

bool Ending::reached() {
  if (until_.empty() || !look_) return false;
  const bool replacing = until_ == "replaced";
  if (replacing && !plan_over()) return false;
  look_ = false;
  return replacing ? replaced() : rig_->session().operational();
}

bool Ending::hopeless() { return !until_.empty() && rig_->guards().shut_out(); }

bool Ending::settled() {
  const rt::Time now = rig_->now();
  const rt::Time still_since = std::max(changed_, due_);
  const bool idle = rig_->session().idle();
  const bool anew = since_ != still_since || now < still_since;
  if (anew) idle_ = {};
  if (!anew && idle) idle_ += now - looked_;
  since_ = still_since;
  looked_ = now;
  if (!idle || idle_ < quiet_) return false;
  if (idle_ < patience_ && !rig_->session().operational()) return false;
  const auto slots = rig_->session().slots();
  return std::ranges::none_of(slots, [](const auto& s) {
    return s.state == places::SlotState::binding || s.state == places::SlotState::configuring ||
           s.state == places::SlotState::unknown;
  });
}

// ---- driving ----

namespace {

/// What is served beside the main job, in real time. A dry run has none of it.
struct Beside {
  std::unique_ptr<const StudioHost*> ring = std::make_unique<const StudioHost*>();  // before who asks for it
  std::unique_ptr<WorldTime> time;                                                  // before who asks for it
  std::unique_ptr<command::ControlServer> server;
  std::unique_ptr<GatewayHost> gateway;
  std::unique_ptr<StudioHost> studio;
  std::unique_ptr<FirstSaves> saves;  // before who asks about them
  std::unique_ptr<Asker> asker;
  std::unique_ptr<LiveValues> values;
};

// Shows the values of the machine file's `watch =` in the live table.
void show_values(Rig& rig, Screen& screen, Beside& beside) {
  const auto words = watch_words(rig.machine());
  if (!screen.live() || words.empty()) return;
  auto watched = Watched::of(rig.machine(), {}, words);
  if (!watched) return screen.line("watch of the machine file: " + watched.error());
  beside.values = std::make_unique<LiveValues>(rig.session(), std::move(*watched));
  screen.show_values([&rig, values = beside.values.get(), utf8 = terminal_has_utf8()](std::size_t columns) {
    return watch_lines(values->rows(), columns, rig.now(), utf8);
  });
}

// Nobody can distinguish a paused world from a bus on which nobody answers.
void tell_standing(const WorldTime& time, const command::Request& request, command::Reply& reply) {
  const std::string standing = time.standing();
  if (standing.empty()) return;
  const std::string words = "the world is " + standing;
  if (reply.progress) reply.progress(words);
  if (request.verb != "report") return;
  reply.lines.push_back(words);
  auto json = nlohmann::ordered_json::parse(reply.json, nullptr, false);
  if (!json.is_object()) return;
  json["paused"] = true;
  reply.json = json.dump();
}

rt::Task<void> answer(Rig& rig, WorldTime* time, const command::Request& request, command::Reply& reply) {
  if (time != nullptr && WorldTime::is_its(request)) co_return co_await time->carry_out(request, reply);
  if (request.verb != plant_verb) {
    if (time != nullptr && request.verb != "report") tell_standing(*time, request, reply);
    const WorldTime::Waiting waiting(time, reply);
    co_await command::execute(rig.session(), request, reply);
    if (time != nullptr && request.verb == "report") tell_standing(*time, request, reply);
    co_return;
  }
  reply = do_in_plant({rig.world(), &rig.plant(), &rig.session()}, request);
}

command::Reply ring_of(const StudioHost* studio, const command::Request& request) {
  if (studio != nullptr) return studio->ring(request);
  return command::refusal(Exit::no,
                          "the running process keeps no frames: start it with --studio, or let it write them to a "
                          "file (berth up --record FILE)");
}

// By the control socket: this account, or root.
rt::Task<void> audited(Rig& rig, WorldTime* time, const StudioHost* const* studio, const command::Request& asked,
                       command::Reply& reply) {
  command::Request request = asked;
  if (auto other = other_machine(request, rig.session().machine().file)) {
    reply = std::move(*other);
    co_return;
  }
  if (request.verb == ring_verb) {
    reply = ring_of(*studio, request);
    co_return;
  }
  command::Audit audit(rig.session(), "control socket", request);
  co_await answer(rig, time, request, reply);
  audit.answered(reply);
}

tl::expected<Beside, Failure> serve_beside(Rig& rig, Screen& screen, const Options& options,
                                           const std::string& control) {
  Beside beside;
  const auto say = [&screen](const std::string& line) { screen.line(line); };
  const bool types = rig.loop() != nullptr && !options.json && someone_types();
  if (!options.dry_run && (options.yes || types)) {
    beside.saves = std::make_unique<FirstSaves>(rig.session(), say, options.yes);
  }
  if (rig.loop() == nullptr) return beside;
  beside.time = std::make_unique<WorldTime>(rig);
  screen.show_time([time = beside.time.get()] { return time->standing(); });
  const auto carry = [&rig, time = beside.time.get()](const command::Request& request, command::Reply& reply) {
    return answer(rig, time, request, reply);
  };
  if (!control.empty()) {
    auto listening = command::ControlServer::listen(control, *rig.loop(),
                                                    [&rig, time = beside.time.get(), ring = beside.ring.get()](
                                                        const command::Request& request, command::Reply& reply) {
                                                      return audited(rig, time, ring, request, reply);
                                                    });
    if (!listening) return tl::unexpected(failure(Exit::failed, listening.error()));
    beside.server = std::move(*listening);
    auto* const server = beside.server.get();
    rig.record().follow([server] { return server->followed(); },
                        [server](const std::string& line) { server->frame(line); });
  }
  if (!options.offers.gateway.where.empty()) {
    const auto rights = gateway_rights(options);
    const auto where = gateway_endpoint("--gateway", options.offers.gateway.where, rights);
    if (!where) return tl::unexpected(where.error());
    auto host = GatewayHost::listen(rig, *where, rights, say);
    if (!host) return tl::unexpected(host.error());
    beside.gateway = std::move(*host);
    screen.line("CiA 309-3 gateway at " + beside.gateway->where());
  }
  if (options.offers.studio.offered() && !options.dry_run) {
    auto host = StudioHost::start(rig, options, control, carry);
    if (!host) return tl::unexpected(host.error());
    beside.studio = std::move(*host);
    *beside.ring = beside.studio.get();
    for (const auto& line : beside.studio->lines()) {
      if (options.json || options.events.none) print_error(line);
      screen.line(line);
    }
  }
  if (types && beside.saves) {
    beside.asker = std::make_unique<Asker>(rig.session(), *rig.loop(), *beside.saves, say, screen.live());
    if (beside.studio) beside.asker->also_helps(beside.studio->lines());
    auto* const asker = beside.asker.get();
    screen.listen(
        *rig.loop(), [asker](const std::string& line) { asker->take(line); },
        [asker](char key) { return asker->take(key); });
  }
  return beside;
}

/// Bus time that a run may take.
rt::Duration allowed(const Ending& ending, const Options& options, bool real_time) {
  constexpr rt::Duration longest_dry_run = 10s;
  if (options.timeout) return *options.timeout;
  if (!real_time) return ending.limit();
  return options.dry_run ? longest_dry_run : rt::Duration::max();
}

}  // namespace

tl::expected<Ended, Failure> drive(Rig& rig, Ending& ending, Screen& screen, const Options& options,
                                   const std::string& control) {
  const bool real_time = rig.loop() != nullptr;
  Interrupt& interrupt = rig.interrupt();
  auto beside = serve_beside(rig, screen, options, control);
  if (!beside) return tl::unexpected(beside.error());
  rig.session().on_event([&](const operate::Event& event) {
    ending.event(event);
    screen.event(event);
    if (beside->studio) beside->studio->event(event);
    if (beside->saves) beside->saves->event(event);
    if (beside->asker) beside->asker->event(event);
  });
  rig.session().on_milestone([&](operate::Milestone milestone) {
    ending.milestone(milestone);
    rig.milestone(milestone);
  });
  if (screen.live()) rig.record().on_trouble([&screen](const std::string& line) { screen.line(line); });
  rig.power_on();
  rig.session().start();
  show_values(rig, screen, *beside);
  Ended how = Ended::timeout;
  const auto over = [&] {
    screen.refresh();
    rig.record().settle();
    if (beside->time) beside->time->between();
    if (beside->studio) beside->studio->look();
    if (interrupt.noticed()) {
      how = Ended::interrupted;
    } else if (ending.reached() || rig.guards().dry_run_over()) {
      how = Ended::reached;
    } else if (!real_time && ending.settled()) {
      how = Ended::settled;
    }
    return how != Ended::timeout || ending.hopeless();
  };
  rig.driver().run_until(over, rig.driver().later(allowed(ending, options, real_time)));
  if (beside->time) beside->time->let_go();
  screen.refresh(true);
  screen.show_values({});
  screen.show_time({});
  rig.record().follow({}, {});
  rig.record().on_trouble({});
  rig.session().on_event({});
  rig.session().on_milestone({});
  return how;
}

tl::expected<void, Failure> serve_bench(Rig& rig, const Options& options) {
  auto host = StudioHost::start(
      rig, options, options.control,
      [&rig](const command::Request& request, command::Reply& reply) { return answer(rig, nullptr, request, reply); });
  if (!host) return tl::unexpected(host.error());
  rig.session().on_event([&](const operate::Event& event) {
    (*host)->event(event);
    print_line(options.json ? operate::to_json(event) : operate::to_line(event));
  });
  for (const auto& line : (*host)->lines()) {
    if (options.json) print_error(line);
    if (!options.json) print_line(line);
  }
  const auto records = [&rig] {
    rig.record().settle();
    return false;
  };
  wait_until(rig.driver(), rig.interrupt(), records, rt::Duration::max());
  rig.session().on_event({});
  return {};
}

}  // namespace berth::cli
