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
#include "mqtt_host.hpp"
#include "plant_commands.hpp"
#include "studio_host.hpp"
#include "world_time.hpp"

namespace berth::cli {

using namespace std::chrono_literals;

// ---- Ending ----

Ending::Ending(MachineRun& run, std::string until) : run_(&run), until_(std::move(until)) {
  for (const auto& bus : run.machine().buses) {
    quiet_ = std::max(quiet_, bus.timing.heartbeat_timeout + 2 * bus.timing.probe_period);
  }
  rt::Duration boot{0};
  for (const auto& device : run.plant().devices) boot = std::max(boot, device.boot);
  quiet_ += boot;
  // A failed step is tried again at the next look at the whole bus: every 8th look, and asking takes time.
  patience_ = quiet_;
  for (const auto& bus : run.machine().buses) patience_ = std::max(patience_, quiet_ + 10 * bus.timing.probe_period);
  // If a bus beneath does not come up in time, Berth leaves it to its gateway's master and tries again after that time.
  for (const auto& bus : run.machine().beneath) {
    const rt::Duration time = std::max<rt::Duration>(bus.startup.boot_time, tree::Beneath::patience);
    patience_ = std::max(patience_, quiet_ + 2 * time);
  }
  limit_ = 10min;
  for (const auto& event : run.plant().events) limit_ += event.delay + event.duration;
  plan_behind(plant::After::start);
}

// A device without a slot is found again and again, which is no change. Only the event's own bus is checked: a machine
// of a hundred buses has a hundred times the events.
void Ending::event(const operate::Event& event) {
  look_ = true;
  const auto* const network = run_->session().network(event.bus);
  const bool of_a_slot = event.kind == operate::EventKind::state || event.kind == operate::EventKind::bound;
  if (network == nullptr && of_a_slot) changed_ = run_->now();  // beneath a gateway
  if (network == nullptr) return;
  auto slots = network->occupancy();
  auto& known = now_[event.bus];
  if (slots == known) return;
  known = std::move(slots);
  changed_ = run_->now();
}

void Ending::plan_behind(plant::After after) {
  const rt::Time now = run_->now();
  changed_ = now;
  for (const auto& event : run_->plant().events) {
    if (event.after == after) due_ = std::max(due_, now + event.delay + event.duration);
  }
}

void Ending::milestone(operate::Milestone milestone) {
  plan_behind(after(milestone));
  if (milestone != operate::Milestone::operational) return;
  first_.clear();
  for (const auto& network : run_->session().networks()) first_[network->bus().name] = network->occupancy();
}

bool Ending::plan_over() const { return run_->now() >= due_; }

bool Ending::replaced() const {
  if (first_.empty() || !run_->session().operational()) return false;
  return std::ranges::any_of(run_->session().networks(), [this](const auto& network) {
    const auto stays = [](const auto& now, const auto& first) { return !now.device || now.device == first.device; };
    return !std::ranges::equal(network->occupancy(), first_.at(network->bus().name), stays);
  });
}

bool Ending::reached() {
  if (until_.empty() || !look_) return false;
  const bool replacing = until_ == "replaced";
  if (replacing && !plan_over()) return false;
  look_ = false;
  return replacing ? replaced() : run_->session().operational();
}

bool Ending::hopeless() { return !until_.empty() && run_->guards().shut_out(); }

bool Ending::settled() {
  const rt::Time now = run_->now();
  const rt::Time still_since = std::max(changed_, due_);
  const bool idle = run_->session().idle();
  const bool anew = since_ != still_since || now < still_since;
  if (anew) idle_ = {};
  if (!anew && idle) idle_ += now - looked_;
  since_ = still_since;
  looked_ = now;
  if (!idle || idle_ < quiet_) return false;
  if (idle_ < patience_ && !run_->session().operational()) return false;
  const auto slots = run_->session().slots();
  return std::ranges::none_of(slots, [](const auto& s) {
    return s.state == places::SlotState::binding || s.state == places::SlotState::configuring ||
           s.state == places::SlotState::unknown;
  });
}

// ---- driving ----

namespace {

/// Those of the services below that answer requests themselves; null: not there.
struct Answering {
  WorldTime* time = nullptr;
  const StudioHost* studio = nullptr;
  MqttHost* mqtt = nullptr;
};

/// The services that run beside the main job, in real time. A dry run has none.
struct Beside {
  std::unique_ptr<Answering> answering = std::make_unique<Answering>();  // before those who use it
  std::unique_ptr<WorldTime> time;                                       // the same
  std::unique_ptr<command::ControlServer> server;
  std::unique_ptr<GatewayHost> gateway;
  std::unique_ptr<StudioHost> studio;
  std::unique_ptr<MqttHost> mqtt;
  std::unique_ptr<FirstSaves> saves;  // before `asker`, which uses it
  std::unique_ptr<Asker> asker;
  std::unique_ptr<LiveValues> values;
};

// Shows the values of the machine file's `watch =` in the live table.
void show_values(MachineRun& run, Screen& screen, Beside& beside) {
  const auto words = watch_words(run.machine());
  if (!screen.live() || words.empty()) return;
  auto watched = Watched::of(run.machine(), {}, words);
  if (!watched) return screen.line("watch of the machine file: " + watched.error());
  beside.values = std::make_unique<LiveValues>(run.session(), std::move(*watched));
  screen.show_values([&run, values = beside.values.get(), utf8 = terminal_has_utf8()](std::size_t columns) {
    return watch_lines(values->rows(), columns, run.now(), utf8);
  });
}

// Says that the world is paused: otherwise it looks like a bus on which no device answers.
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

command::Reply fleet_of(MqttHost* mqtt, const command::Request& request) {
  if (mqtt != nullptr) return mqtt->fleet(request);
  return command::refusal(Exit::no,
                          "this machine is at no MQTT broker, where it would see others: start it with --mqtt, or with "
                          "[mqtt] in its machine file");
}

rt::Task<void> answer(MachineRun& run, const Answering& own, const command::Request& request, command::Reply& reply) {
  WorldTime* const time = own.time;
  if (time != nullptr && WorldTime::is_its(request)) co_return co_await time->carry_out(request, reply);
  if (request.verb == command::fleet_verb) {
    reply = fleet_of(own.mqtt, request);
    co_return;
  }
  if (request.verb != plant_verb) {
    if (time != nullptr && request.verb != "report") tell_standing(*time, request, reply);
    const WorldTime::Waiting waiting(time, reply);
    co_await command::execute(run.session(), request, reply);
    if (time != nullptr && request.verb == "report") tell_standing(*time, request, reply);
    co_return;
  }
  reply = do_in_plant({run.world(), &run.plant(), &run.session()}, request);
}

command::Reply ring_of(const StudioHost* studio, const command::Request& request) {
  if (studio != nullptr) return studio->ring(request);
  return command::refusal(Exit::no,
                          "the running process keeps no frames: start it with --studio, or let it write them to a "
                          "file (berth up --record FILE)");
}

// Requests by the control socket come from this account, or from root.
rt::Task<void> audited(MachineRun& run, const Answering& own, const command::Request& asked, command::Reply& reply) {
  command::Request request = asked;
  if (auto other = other_machine(request, run.session().machine().file)) {
    reply = std::move(*other);
    co_return;
  }
  if (request.verb == ring_verb) {
    reply = ring_of(own.studio, request);
    co_return;
  }
  command::Audit audit(run.session(), "control socket", request);
  co_await answer(run, own, request, reply);
  audit.answered(reply);
}

tl::expected<void, Failure> publish_beside(MachineRun& run, Screen& screen, const Options& options,
                                           const MqttHost::Carry& carry, Beside& beside) {
  if (options.dry_run) return {};
  auto host = MqttHost::start(run, options, beside.studio ? beside.studio->page() : std::string(), carry);
  if (!host) return tl::unexpected(host.error());
  beside.mqtt = std::move(*host);
  beside.answering->mqtt = beside.mqtt.get();
  if (options.json || options.events.none) print_error(beside.mqtt->line());
  screen.line(beside.mqtt->line());
  return {};
}

tl::expected<Beside, Failure> serve_beside(MachineRun& run, Screen& screen, const Options& options,
                                           const std::string& control) {
  Beside beside;
  const auto say = [&screen](const std::string& line) { screen.line(line); };
  const bool types = run.loop() != nullptr && !options.json && someone_types();
  if (!options.dry_run && (options.yes || types)) {
    beside.saves = std::make_unique<FirstSaves>(run.session(), say, options.yes);
  }
  if (run.loop() == nullptr) return beside;
  beside.time = std::make_unique<WorldTime>(run);
  beside.answering->time = beside.time.get();
  screen.show_time([time = beside.time.get()] { return time->standing(); });
  const auto carry = [&run, &own = *beside.answering](const command::Request& request, command::Reply& reply) {
    return answer(run, own, request, reply);
  };
  if (!control.empty()) {
    auto listening = command::ControlServer::listen(
        control, *run.loop(), [&run, &own = *beside.answering](const command::Request& request, command::Reply& reply) {
          return audited(run, own, request, reply);
        });
    if (!listening) return tl::unexpected(failure(Exit::failed, listening.error()));
    beside.server = std::move(*listening);
    auto* const server = beside.server.get();
    run.record().follow([server] { return server->followed(); },
                        [server](const std::string& line) { server->frame(line); });
  }
  if (!options.offers.gateway.where.empty()) {
    const auto rights = gateway_rights(options);
    const auto where = gateway_endpoint("--gateway", options.offers.gateway.where, rights);
    if (!where) return tl::unexpected(where.error());
    auto host = GatewayHost::listen(run, *where, rights, say);
    if (!host) return tl::unexpected(host.error());
    beside.gateway = std::move(*host);
    screen.line("CiA 309-3 gateway at " + beside.gateway->where());
  }
  if (options.offers.studio.offered() && !options.dry_run) {
    auto host = StudioHost::start(run, options, control, mqtt_name(run.machine(), options), carry);
    if (!host) return tl::unexpected(host.error());
    beside.studio = std::move(*host);
    beside.answering->studio = beside.studio.get();
    for (const auto& line : beside.studio->lines()) {
      if (options.json || options.events.none) print_error(line);
      screen.line(line);
    }
  }
  if (mqtt_wanted(run.machine(), options)) {
    if (auto begun = publish_beside(run, screen, options, carry, beside); !begun) return tl::unexpected(begun.error());
  }
  if (types && beside.saves) {
    beside.asker = std::make_unique<Asker>(run.session(), *run.loop(), *beside.saves, say, screen.live());
    if (beside.studio) beside.asker->also_helps(beside.studio->lines());
    auto* const asker = beside.asker.get();
    screen.listen(
        *run.loop(), [asker](const std::string& line) { asker->take(line); },
        [asker](char key) { return asker->take(key); });
  }
  return beside;
}

/// The bus time that a run may take.
rt::Duration allowed(const Ending& ending, const Options& options, bool real_time) {
  constexpr rt::Duration longest_dry_run = 10s;
  if (options.timeout) return *options.timeout;
  if (!real_time) return ending.limit();
  return options.dry_run ? longest_dry_run : rt::Duration::max();
}

}  // namespace

tl::expected<Ended, Failure> drive(MachineRun& run, Ending& ending, Screen& screen, const Options& options,
                                   const std::string& control, Service* service) {
  const bool real_time = run.loop() != nullptr;
  Interrupt& interrupt = run.interrupt();
  auto beside = serve_beside(run, screen, options, control);
  if (!beside) return tl::unexpected(beside.error());
  run.session().on_event([&](const operate::Event& event) {
    ending.event(event);
    screen.event(event);
    if (service != nullptr) service->event();
    if (beside->studio) beside->studio->event(event);
    if (beside->mqtt) beside->mqtt->event();
    if (beside->saves) beside->saves->event(event);
    if (beside->asker) beside->asker->event(event);
  });
  run.session().on_milestone([&](operate::Milestone milestone) {
    ending.milestone(milestone);
    run.milestone(milestone);
  });
  if (screen.live()) run.record().on_trouble([&screen](const std::string& line) { screen.line(line); });
  run.power_on();
  run.session().start();
  show_values(run, screen, *beside);
  Ended how = Ended::timeout;
  const auto over = [&] {
    screen.refresh();
    run.record().settle();
    if (beside->time) beside->time->between();
    if (beside->studio) beside->studio->look();
    if (service != nullptr) service->look();
    if (interrupt.noticed()) {
      how = Ended::interrupted;
    } else if (ending.reached() || run.guards().dry_run_over()) {
      how = Ended::reached;
    } else if (!real_time && ending.settled()) {
      how = Ended::settled;
    }
    return how != Ended::timeout || ending.hopeless();
  };
  run.driver().run_until(over, run.driver().later(allowed(ending, options, real_time)));
  if (beside->time) beside->time->let_go();
  screen.refresh(true);
  screen.show_values({});
  screen.show_time({});
  run.record().follow({}, {});
  run.record().on_trouble({});
  run.session().on_event({});
  run.session().on_milestone({});
  return how;
}

tl::expected<void, Failure> serve_bench(MachineRun& run, const Options& options) {
  const Answering nobody;
  auto host = StudioHost::start(
      run, options, options.control, {},
      [&](const command::Request& request, command::Reply& reply) { return answer(run, nobody, request, reply); });
  if (!host) return tl::unexpected(host.error());
  run.session().on_event([&](const operate::Event& event) {
    (*host)->event(event);
    print_line(options.json ? operate::to_json(event) : operate::to_line(event));
  });
  for (const auto& line : (*host)->lines()) {
    if (options.json) print_error(line);
    if (!options.json) print_line(line);
  }
  const auto records = [&run] {
    run.record().settle();
    return false;
  };
  wait_until(run.driver(), run.interrupt(), records, rt::Duration::max());
  run.session().on_event({});
  return {};
}

}  // namespace berth::cli
