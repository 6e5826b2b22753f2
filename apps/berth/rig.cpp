#include "rig.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <cstring>
#include <filesystem>
#include <thread>
#include <utility>

#include "berth/io/open_port.hpp"
#include "berth/live/reopening_port.hpp"
#include "berth/rt/scope.hpp"
#include "berth/store/database.hpp"
#include "berth/text/file.hpp"
#include "drive.hpp"
#include "ports.hpp"
#include "up.hpp"

namespace berth::cli {

namespace fs = std::filesystem;

/// Sees every frame of one bus.
class Rig::BusTap final : public can::Tap {
 public:
  BusTap(Rig& rig, sim::Bus& bus, int master) : rig_(&rig), bus_(&bus), master_(master) { bus_->add_tap(*this); }
  ~BusTap() { bus_->remove_tap(*this); }
  BusTap(const BusTap&) = delete;
  BusTap& operator=(const BusTap&) = delete;
  void frame(const can::Frame& frame, rt::Time at, int sender) noexcept override {
    rig_->recorded({operate::seconds(at), bus_->name(), can::to_string(frame), sender == master_});
  }

 private:
  Rig* rig_;
  sim::Bus* bus_;
  int master_;
};

Rig::Made Rig::make(const Options& options, const Sources& sources) {
  std::unique_ptr<Rig> rig(new Rig);
  if (auto good = rig->read(options, sources); !good) return tl::unexpected(good.error());
  if (auto good = rig->build_world(options); !good) return tl::unexpected(good.error());
  rig->interrupt_.emplace();
  if (auto good = rig->open_store(options); !good) return tl::unexpected(good.error());
  if (auto good = rig->open_session(options); !good) return tl::unexpected(good.error());
  return rig;
}

Rig::~Rig() {
  heard_.clear();
  session_.reset();
  ports_.clear();  // gates before what they guard
  raw_.clear();
  store_.reset();
  if (log_ != nullptr) std::fclose(log_);
  std::error_code ignored;
  if (!throw_away_.empty()) fs::remove_all(throw_away_, ignored);
}

tl::expected<void, Failure> Rig::read(const Options& options, const Sources& sources) {
  auto machine = sources.machine_text.empty()
                     ? design::load_machine(sources.machine_name)
                     : design::read_machine(sources.machine_text, sources.machine_name, design::eds_loader());
  const bool simulate = !sources.plant_name.empty() || !sources.plant_text.empty();
  auto plant = !simulate                    ? plant::PlantResult{plant::PlantFile{}, {}}
               : sources.plant_text.empty() ? plant::load_plant(sources.plant_name)
                                            : plant::read_plant(sources.plant_text, sources.plant_name);
  Findings findings = machine.findings;
  findings.insert(findings.end(), plant.findings.begin(), plant.findings.end());
  if (!machine.machine || !plant.plant) return tl::unexpected(failure(findings));
  warn(findings, options.json);
  machine_ = std::move(*machine.machine);
  plant_ = std::move(*plant.plant);
  if (options.seed) plant_.seed = *options.seed;
  return settle_ports(options, simulate);
}

// --sim is stronger than what the file says, --port stronger than --sim.
tl::expected<void, Failure> Rig::settle_ports(const Options& options, bool simulate) {
  if (!options.bus.empty() && machine_.bus(options.bus) == nullptr) {
    std::string names;
    for (const auto& bus : machine_.buses) names += (names.empty() ? "" : ", ") + bus.name;
    return tl::unexpected(
        failure(Exit::usage, fmt::format("{}: there is no bus \"{}\"; use {}", machine_.file, options.bus, names)));
  }
  for (auto& bus : machine_.buses) {
    if (simulate) bus.port = {};
  }
  if (auto good = override_ports(machine_, options); !good) return good;
  if (!simulate && !options.bus.empty()) restrict_to(machine_, options.bus);
  if (!simulate && !all_elsewhere(machine_)) return tl::unexpected(needs_plant(machine_));
  const auto is_outside = [](const auto& b) { return b.port.kind != can::PortKind::sim; };
  outside_ = std::ranges::any_of(machine_.buses, is_outside);
  if (!outside_ || !options.fast) return {};
  return tl::unexpected(failure(Exit::usage, "--fast needs a world of this process: give --sim PLANT"));
}

tl::expected<void, Failure> Rig::build_world(const Options& options) {
  std::vector<plant::BusRate> rates;
  for (const auto& bus : machine_.buses) {
    if (bus.port.kind == can::PortKind::sim) rates.push_back({bus.name, bus.bitrate});
  }
  Findings findings;
  world_ = plant::World::make(plant_, rates, findings);
  for (auto& finding : findings) {
    if (finding.file.empty()) finding.file = options.sim;
  }
  if (!world_) return tl::unexpected(failure(findings));
  warn(findings, options.json);
  if (outside_) loop_ = std::make_unique<io::Loop>(world_->executor());
  if (options.state.empty()) return {};
  Result<void> kept;
  if (!options.dry_run) {
    kept = world_->keep_state(options.state);
  } else if (fs::exists(options.state)) {
    Findings unreadable;
    const auto text = text::read_file(options.state, unreadable);
    if (!text) return tl::unexpected(failure(unreadable));
    kept = world_->restore(*text);
  }
  if (kept) return {};
  return tl::unexpected(failure(Exit::failed, fmt::format("{}: {}", options.state, describe(kept.error()))));
}

namespace {

// Of the store and of what is written beside it.
std::array<fs::file_time_type, 2> written_at(const std::string& path) {
  std::error_code none;
  return {fs::last_write_time(path, none), fs::last_write_time(path + "-wal", none)};
}

}  // namespace

// Into a folder that goes with the rig. The store may be in use: a copy during which it changed is made anew.
tl::expected<std::string, Failure> Rig::copied_store(const std::string& path) {
  std::string pattern = (fs::temp_directory_path() / "berth-copy-XXXXXX").string();
  if (::mkdtemp(pattern.data()) == nullptr)
    return tl::unexpected(failure(Exit::failed, pattern + ": " + std::strerror(errno)));
  throw_away_ = pattern;
  const std::string copy = (fs::path(throw_away_) / "store.db").string();
  constexpr int tries = 50;
  std::error_code error;
  for (int i = 0; i < tries; ++i) {
    const auto before = written_at(path);
    fs::copy_file(path, copy, fs::copy_options::overwrite_existing, error);
    if (!error && fs::exists(path + "-wal")) {
      fs::copy_file(path + "-wal", copy + "-wal", fs::copy_options::overwrite_existing, error);
    } else {
      fs::remove(copy + "-wal");
    }
    if (written_at(path) == before) break;
    std::this_thread::sleep_for(std::chrono::milliseconds(20));
  }
  if (error) return tl::unexpected(failure(Exit::failed, path + ": " + error.message()));
  return copy;
}

// A dry run works on a copy of the store, so that it sends what the real one would; a command that only looks does,
// because the store belongs to the process that runs the machine, or is about to.
tl::expected<void, Failure> Rig::open_store(const Options& options) {
  std::string path = options.store;
  const bool real = std::ranges::any_of(machine_.buses, [](const auto& b) { return is_real(b.port); });
  if (path.empty() && real && options.slot_table) {
    path = default_store(machine_.file);
    if (!options.makes_store && !fs::exists(path)) path.clear();
  }
  if ((options.dry_run || options.observe) && !path.empty()) {
    if (!fs::exists(path)) {
      path.clear();
    } else {
      auto copy = copied_store(path);
      if (!copy) return tl::unexpected(copy.error());
      path = std::move(*copy);
    }
  }
  if (path.empty()) {
    store_ = std::make_unique<places::MemoryStore>();
    return {};
  }
  auto opened = store::Database::open(path, {.ended = ended_by(options.timeout)});
  if (!opened) return tl::unexpected(failure(Exit::failed, opened.error().message));
  store_ = std::move(*opened);
  return {};
}

tl::expected<std::unique_ptr<can::Port>, Failure> Rig::open_port(const design::Bus& bus) {
  io::PortOptions wanted;
  wanted.bit_rate = bus.bitrate;
  wanted.listen_only = bus.role == design::Role::observer;
  wanted.bus = bus.name;
  auto port = io::open_port(*loop_, bus.port, wanted);
  if (!port) return tl::unexpected(failure(Exit::failed, fmt::format("bus {}: {}", bus.name, port.error())));
  const auto rate = (*port)->status().bit_rate;
  if (rate == bus.bitrate || rate == 0) return std::move(*port);
  return tl::unexpected(
      failure(Exit::failed, fmt::format("{}:{}: bus {} is told to run at {} bit/s, and {} runs at {}", machine_.file,
                                        bus.place.line, bus.name, bus.bitrate, can::to_string(bus.port), rate)));
}

namespace {

live::Role role_of(design::Role role) noexcept {
  switch (role) {
    case design::Role::master: return live::Role::master;
    case design::Role::commissioner: return live::Role::commissioner;
    case design::Role::observer: break;
  }
  return live::Role::observer;
}

}  // namespace

std::unique_ptr<can::Port> Rig::guard(const design::Bus& bus, can::Port& port, const Options& options) {
  live::GateOptions wanted;
  wanted.role = options.observe ? live::Role::observer : options.read_only ? live::Role::reader : role_of(bus.role);
  wanted.listen = bus.timing.listen;
  wanted.watch.own = bus.master;
  wanted.watch.tolerated = bus.tolerate;
  wanted.dry_run = options.dry_run;
  for (const auto& spec : machine_.specs(bus.name)) wanted.slots.push_back(spec.id);
  auto gate = std::make_unique<live::Gate>(world_->executor(), port, std::move(wanted));
  gates_.emplace_back(bus.name, gate.get());
  gate->on_change([this, name = bus.name, raw = gate.get()] { gate_changed(name, *raw); });
  const auto note = [this, name = bus.name](const can::Frame& frame, rt::Time at, bool own) {
    recorded({operate::seconds(at), name, can::to_string(frame), own});
  };
  if (options.dry_run) {
    gate->on_held([this, note](const can::Frame& frame, rt::Time at) {
      note(frame, at, true);
      if (live::expects_answer(frame)) question_at_ = std::min(question_at_, at);
    });
  } else if (!options.record.empty()) {
    gate->on_frame(note);
  }
  return gate;
}

void Rig::gate_changed(const std::string& bus, const live::Gate& gate) {
  if (session_ == nullptr || gate.state() != live::GateState::foreign) return;
  std::string text;
  for (const auto& line : gate.report()) text += (text.empty() ? "" : "; ") + line;
  session_->tell(bus, "error", text + ". Berth writes nothing more on this bus; end that master, then start anew");
}

// Other kinds come back by themselves.
std::unique_ptr<can::Port> Rig::reopening(const design::Bus& bus, std::unique_ptr<can::Port> port) {
  const auto open = [this, &bus]() -> std::unique_ptr<can::Port> {
    auto again = open_port(bus);
    return again ? std::move(*again) : nullptr;
  };
  return std::make_unique<live::ReopeningPort>(world_->executor(), std::move(port), open);
}

// Berth's own node on one bus.
tl::expected<can::Port*, Failure> Rig::attach(const design::Bus& bus, const Options& options) {
  if (bus.port.kind != can::PortKind::sim) {
    if (is_real(bus.port) && bus.role != design::Role::observer && !options.observe) {
      auto lock = PortLock::take(bus.port);
      if (!lock) return tl::unexpected(lock.error());
      locks_.push_back(std::move(*lock));
    }
    auto port = open_port(bus);
    if (!port) return tl::unexpected(port.error());
    raw_.push_back(bus.port.kind == can::PortKind::plant ? reopening(bus, std::move(*port)) : std::move(*port));
    ports_.push_back(guard(bus, *raw_.back(), options));
    return ports_.back().get();
  }
  auto port = world_->attach_master(bus.name);
  if (!port)
    return tl::unexpected(failure(Exit::failed, fmt::format("the simulated world has no bus \"{}\"", bus.name)));
  if (options.dry_run || !options.record.empty()) {
    taps_.push_back(std::make_unique<BusTap>(*this, *world_->bus(bus.name), port->number()));
  }
  ports_.push_back(std::move(port));
  return ports_.back().get();
}

tl::expected<void, Failure> Rig::open_session(const Options& options) {
  session_ = std::make_unique<operate::Session>(world_->executor(), machine_, *store_);
  session_->set_careful(std::ranges::any_of(machine_.buses, [](const auto& b) { return is_real(b.port); }));
  for (const auto& bus : machine_.buses) {
    auto port = attach(bus, options);
    if (!port) return tl::unexpected(port.error());
    const auto connected = session_->connect(bus.name, **port);
    if (!connected) return tl::unexpected(failure(Exit::failed, describe(connected.error())));
  }
  if (!options.record.empty()) {
    log_ = std::fopen(options.record.c_str(), "we");
    if (log_ == nullptr) return tl::unexpected(failure(Exit::failed, options.record + ": " + std::strerror(errno)));
  }
  const auto opened = session_->open();
  if (opened) return {};
  return tl::unexpected(failure(Exit::failed, "the slot table cannot be read: " + describe(opened.error())));
}

// ---- real ports ----

tl::expected<void, Failure> Rig::listen_first() {
  if (!loop_) return {};
  for (const auto& bus : machine_.buses) {
    if (bus.role != design::Role::master || gate(bus.name) == nullptr) continue;
    heard_[bus.name] = std::make_unique<live::Census>(session_->network(bus.name)->dispatcher());
  }
  rt::Duration longest{0};
  for (const auto& bus : machine_.buses) longest = std::max(longest, bus.timing.listen);
  constexpr rt::Duration slack = std::chrono::seconds(1);  // a port that was just opened comes up
  const rt::Time end = world_->executor().now() + longest + slack;
  const auto undecided = [](const auto& entry) { return !entry.second->decided(); };
  while (std::ranges::any_of(gates_, undecided) && world_->executor().now() < end && !interrupt_->came()) {
    loop_->turn(std::chrono::milliseconds(50));
  }
  if (auto goes_on = not_ended(); !goes_on) return goes_on;
  return no_foreign_frames();
}

tl::expected<void, Failure> Rig::not_ended() {
  if (!interrupt_->came()) return {};
  return tl::unexpected(failure(Exit::no, "ended before its work on a bus began"));
}

tl::expected<void, Failure> Rig::no_foreign_frames() const {
  std::string problem;
  for (const auto& [bus, gate] : gates_) {
    if (gate->state() != live::GateState::foreign) continue;
    const auto report = gate->report();
    problem += fmt::format("{}bus {}: {}", problem.empty() ? "" : "\n", bus, report.front());
    for (auto line = report.begin() + 1; line != report.end(); ++line) problem += "\n    " + *line;
  }
  if (problem.empty()) return {};
  return tl::unexpected(failure(
      Exit::no, problem +
                    "\nBerth sends nothing there. End that master; or use the bus as role = \"commissioner\" or "
                    "\"observer\"; or, when the machine's own devices send these frames, say so by tolerate = […]"));
}

namespace {

rt::Task<void> ask_whether_masters(live::Census& census, live::CensusOptions options, bool& over) {
  const auto asked = co_await census.ask(options);
  static_cast<void>(asked);  // a port that takes no frame is the session's to report
  over = true;
}

}  // namespace

// "another master: node 100, its 1F80h bit 0 is set": one line for each; empty when there is none.
std::string Rig::quiet_masters(const design::Bus& bus, live::Census& census) {
  live::CensusOptions ask;
  ask.masters_only = true;
  ask.own = bus.master;
  for (const auto& spec : machine_.specs(bus.name)) ask.known.push_back(spec.id);
  bool over = false;
  {
    rt::Scope scope(world_->executor());
    scope.spawn(ask_whether_masters(census, ask, over));
    const auto shut = [&] { return gate(bus.name)->state() != live::GateState::open; };
    while (!over && !shut() && !dry_run_over() && !interrupt_->came()) loop_->turn(std::chrono::milliseconds(50));
  }
  std::string text;
  for (const auto& node : census.nodes()) {
    if (!node.nmt_master) continue;
    text += fmt::format(
        "{}bus {}: another master: node {}, its 1F80h bit 0 is set{}{}; it commanded nobody while Berth "
        "listened",
        text.empty() ? "" : "\n", bus.name, node.id.value(), node.network_list ? ", it has a network list (1F81h)" : "",
        node.device_type ? fmt::format(", its device type is {:08X}h", *node.device_type) : "");
  }
  return text;
}

tl::expected<void, Failure> Rig::ask_strangers() {
  std::string problem;
  const auto heard = std::exchange(heard_, {});
  for (const auto& bus : machine_.buses) {
    const auto census = heard.find(bus.name);
    if (census == heard.end() || gate(bus.name)->state() != live::GateState::open) continue;
    const std::string masters = quiet_masters(bus, *census->second);
    if (!masters.empty()) problem += (problem.empty() ? "" : "\n") + masters;
  }
  if (auto goes_on = not_ended(); !goes_on) return goes_on;
  if (problem.empty()) return no_foreign_frames();
  return tl::unexpected(failure(
      Exit::no, problem + "\nBerth does not take its bus. End that master; or use the bus as role = "
                          "\"commissioner\" or \"observer\"; or, when it is a device of this machine, give it a slot"));
}

const live::Gate* Rig::gate(std::string_view bus) const noexcept {
  const auto gate = std::ranges::find(gates_, bus, [](const auto& g) { return std::string_view(g.first); });
  return gate == gates_.end() ? nullptr : gate->second;
}

can::Port* Rig::outside(std::string_view bus) noexcept {
  const auto gate = std::ranges::find(gates_, bus, [](const auto& g) { return std::string_view(g.first); });
  return gate == gates_.end() ? nullptr : gate->second;
}

bool Rig::first_start() {
  const bool real = std::ranges::any_of(
      machine_.buses, [](const auto& b) { return is_real(b.port) && b.role != design::Role::observer; });
  if (!real) return false;
  const auto records = store_->load(machine_.name);
  return !records || std::ranges::none_of(*records, [](const auto& r) { return r.confirmed || r.asked; });
}

bool Rig::dry_run_over() const noexcept {
  constexpr rt::Duration patience = std::chrono::milliseconds(900);  // what goes out beside the first question
  return question_at_ != rt::never && world_->executor().now() >= question_at_ + patience;
}

bool Rig::shut_out() const noexcept {
  return !gates_.empty() && gates_.size() == machine_.buses.size() &&
         std::ranges::all_of(gates_, [](const auto& g) { return g.second->state() == live::GateState::foreign; });
}

void Rig::leave(const Options& options) {
  bool any = false;
  for (const auto& bus : machine_.buses) {
    auto wish = bus.on_exit;
    if (!options.on_exit.empty()) {
      wish = options.on_exit == "stop"    ? design::OnExit::stop
             : options.on_exit == "preop" ? design::OnExit::pre_operational
                                          : design::OnExit::leave;
    }
    auto* const network = session_->network(bus.name);
    if (wish == design::OnExit::leave || bus.role != design::Role::master || network == nullptr) continue;
    const auto command = wish == design::OnExit::stop ? co::NmtCommand::stop : co::NmtCommand::enter_pre_operational;
    session_->stop();  // the main job would start again what it sees pre-operational
    any = network->dispatcher().send(co::to_frame({command, co::NmtTarget::all()})) == can::Queued::yes || any;
  }
  if (!any) return;
  constexpr rt::Duration time_to_send = std::chrono::milliseconds(100);
  if (!loop_) return world_->sim().run_for(time_to_send);
  const auto end = world_->executor().now() + time_to_send;
  while (world_->executor().now() < end) loop_->turn(end - world_->executor().now());
}

// candump's log format.
void Rig::recorded(const Recorded& frame) {
  if (log_ != nullptr) {
    const std::string line = candump_line(frame) + '\n';
    log_failed_ = log_failed_ || std::fwrite(line.data(), 1, line.size(), log_) != line.size();
  }
  if (sent_ != nullptr && frame.by_master) sent_->push_back(frame);
}

}  // namespace berth::cli
