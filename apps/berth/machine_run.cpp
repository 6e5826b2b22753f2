#include "machine_run.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <utility>

#include "berth/traffic/link_network.hpp"
#include "contradictions.hpp"
#include "machine_file.hpp"
#include "node_words.hpp"
#include "simulated.hpp"

namespace berth::cli {

MachineRun::Made MachineRun::make(const Options& options, const Sources& sources) {
  std::unique_ptr<MachineRun> run(new MachineRun);
  if (auto good = run->read(options, sources); !good) return tl::unexpected(good.error());
  if (auto good = run->build_world(options); !good) return tl::unexpected(good.error());
  run->interrupt_.emplace(run->loop_);
  const auto ports = run->attach_all(options);
  if (!ports) return tl::unexpected(ports.error());
  // After the ports: if one cannot be opened, no slot table is made.
  auto table = SlotTable::open(run->machine_, options);
  if (!table) return tl::unexpected(table.error());
  run->slot_table_ = std::move(*table);
  if (auto good = run->open_session(options, sources.links, *ports); !good) return tl::unexpected(good.error());
  return run;
}

namespace {

bool simulated(const design::Bus& bus) noexcept { return bus.port.kind == can::PortKind::sim; }

}  // namespace

design::MachineResult MachineRun::read_machine(const Options& options, const Sources& sources,
                                               std::optional<Failure>& problem) const {
  if (!sources.machine_text.empty()) {
    return design::read_machine(sources.machine_text, sources.machine_name, design::eds_loader());
  }
  if (!sources.machine_name.empty()) return design::load_machine(sources.machine_name, options.files.allow_outside);
  const auto text = ad_hoc_machine(options);
  if (!text) {
    problem = text.error();
    return {};
  }
  return design::read_machine(*text, no_machine_file, {});
}

namespace {

// Sets Berth's own node-ID and its priority as flying master.
tl::expected<void, Failure> settle_masters(design::Machine& machine, const Options& options) {
  for (auto& bus : machine.buses) {
    if (options.master.id) bus.master = NodeId(static_cast<std::uint8_t>(*options.master.id));
    if (options.master.priority && bus.flying)
      bus.flying->priority = static_cast<std::uint8_t>(*options.master.priority);
    const auto slots = machine.specs(bus.name);
    const auto taken = std::ranges::find(slots, bus.master, &places::SlotSpec::id);
    if (!options.master.id || taken == slots.end()) continue;
    return tl::unexpected(failure(Exit::usage, fmt::format("--master-id {}: slot '{}' has this node-ID; use another",
                                                           *options.master.id, taken->name.name)));
  }
  const bool several = std::ranges::any_of(machine.buses, [](const auto& bus) { return bus.flying.has_value(); });
  if (!options.master.priority || several) return {};
  return tl::unexpected(
      failure(Exit::usage, "--priority is for a bus with several masters: give it a table [bus.NAME.flying_master]"));
}

}  // namespace

tl::expected<void, Failure> MachineRun::read(const Options& options, const Sources& sources) {
  std::optional<Failure> problem;
  auto machine = read_machine(options, sources, problem);
  if (problem) return tl::unexpected(std::move(*problem));
  const bool simulate = !sources.plant_name.empty() || !sources.plant_text.empty();
  auto plant = !simulate ? plant::PlantResult{plant::PlantFile{}, {}}
               : sources.plant_text.empty()
                   ? read_plant_file(sources.plant_name, sources.machine_name, options.files.allow_outside)
                   : plant::read_plant(sources.plant_text, sources.plant_name);
  Findings findings = machine.findings;
  findings.insert(findings.end(), plant.findings.begin(), plant.findings.end());
  if (!machine.machine || !plant.plant) return tl::unexpected(failure(findings));
  warn(findings, options.json);
  machine_ = std::move(*machine.machine);
  plant_ = std::move(*plant.plant);
  rate_as_it_stands_ = is_ad_hoc(machine_) && !options.bit_rate;
  if (auto good = describe_nodes(machine_, options); !good) return good;
  if (auto good = settle_masters(machine_, options); !good) return good;
  if (options.sim.seed) plant_.seed = *options.sim.seed;
  return settle_ports(options, simulate);
}

// --sim overrides the file's ports, and --port overrides --sim.
tl::expected<void, Failure> MachineRun::settle_ports(const Options& options, bool simulate) {
  if (!options.bus.empty() && machine_.bus(options.bus) == nullptr) {
    return tl::unexpected(no_such_bus(machine_, options.bus));
  }
  for (auto& bus : machine_.buses) {
    if (simulate) bus.port = {};
  }
  if (auto good = override_ports(machine_, options); !good) return good;
  if (!simulate && !options.bus.empty()) restrict_to(machine_, options.bus);
  if (!simulate && !all_elsewhere(machine_)) return tl::unexpected(needs_plant(machine_));
  const auto needs_world = [](const char* option) {
    return tl::unexpected(
        failure(Exit::usage, fmt::format("{} needs a world of this process: give --sim PLANT", option)));
  };
  if (options.sim.fast && !std::ranges::all_of(machine_.buses, simulated)) return needs_world("--fast");
  if (!options.sim.state.empty() && all_elsewhere(machine_)) return needs_world("--sim-state");
  return {};
}

void MachineRun::run_by_loop(rt::Executor& executor) {
  auto driver = std::make_unique<io::LoopDriver>(executor);
  loop_ = &driver->loop();
  driver_ = std::move(driver);
}

tl::expected<void, Failure> MachineRun::build_world(const Options& options) {
  if (all_elsewhere(machine_)) {
    run_by_loop(executor_);
    return {};
  }
  std::vector<plant::BusRate> rates;
  for (const auto& bus : machine_.buses) {
    if (simulated(bus)) rates.push_back({bus.name, bus.bitrate});
  }
  for (const auto& bus : machine_.beneath) rates.push_back({bus.name, bus.bitrate});
  warn(contradictions(machine_, plant_, options.sim.plant), options.json);
  auto world = make_world(plant_, rates, options.sim.plant, options);
  if (!world) return tl::unexpected(world.error());
  world_ = std::move(*world);
  scripts_.emplace(*world_);
  if (options.sim.pace || !std::ranges::all_of(machine_.buses, simulated)) {
    run_by_loop(world_->executor());
  } else {
    driver_ = std::make_unique<sim::WorldDriver>(world_->sim());
  }
  return {};
}

// Attaches Berth's own node to one bus.
tl::expected<can::Port*, Failure> MachineRun::attach(const design::Bus& bus, const Options& options) {
  if (!simulated(bus)) {
    const auto outside = outside_->open(bus, options);
    if (!outside) return tl::unexpected(outside.error());
    return &guards_.add(driver_->executor(), bus, **outside, options);
  }
  auto port = world_->attach_master(bus.name);
  if (!port)
    return tl::unexpected(failure(Exit::failed, fmt::format("the simulated world has no bus \"{}\"", bus.name)));
  if (options.dry_run || !options.files.record.empty() || loop_ != nullptr) {
    taps_.push_back(std::make_unique<BusTap>(record_, *world_->bus(bus.name), port->number()));
  }
  ours_.push_back(std::move(port));
  return ours_.back().get();
}

tl::expected<std::vector<can::Port*>, Failure> MachineRun::attach_all(const Options& options) {
  std::vector<can::Port*> ports;
  if (loop_ != nullptr) outside_.emplace(machine_.file, *loop_, driver_->executor(), rate_as_it_stands_);
  for (auto& bus : machine_.buses) {
    const auto port = attach(bus, options);
    if (!port) return tl::unexpected(port.error());
    const auto rate = rate_as_it_stands_ ? (*port)->status().bit_rate : 0;
    if (rate != 0) bus.bitrate = rate;
    ports.push_back(*port);
  }
  return ports;
}

tl::expected<void, Failure> MachineRun::open_session(const Options& options, bool links,
                                                     const std::vector<can::Port*>& ports) {
  session_ = std::make_unique<tree::Session>(driver_->executor(), machine_, slot_table_->store());
  tree::keep_written(*session_, slot_table_->written(machine_.file));
  session_->set_careful(std::ranges::any_of(machine_.buses, [](const auto& b) { return is_real(b.port); }));
  remote_commands_.emplace(*session_);
  guards_.on_foreign([this](const std::string& bus, const std::string& verdict, const std::string& text) {
    if (auto* const network = session_->network(bus)) network->services().shut_by = verdict;
    session_->tell(bus, operate::EventKind::error, text);
  });
  guards_.on_client(
      [this](const std::string& bus, const std::string& text) { session_->tell(bus, operate::EventKind::step, text); });
  for (std::size_t i = 0; i < ports.size(); ++i) {
    const auto connected = session_->connect(machine_.buses[i].name, *ports[i]);
    if (!connected) return tl::unexpected(failure(Exit::failed, describe(connected.error())));
  }
  strangers_ = std::make_unique<Strangers>(*driver_, *interrupt_, *session_, guards_);
  record_.on_sent([this](const std::string& bus, const can::Frame& frame, rt::Time at, bool) {
    if (session_) own_frames(*session_).sent(bus, frame, at);
  });
  if (!options.files.record.empty()) {
    if (auto good = record_.write_to(options.files.record, options.files.force); !good) return good;
  }
  if (links && !machine_.links.empty()) {
    const auto planned = traffic::plan_links(machine_);
    if (has_errors(planned.findings)) return tl::unexpected(failure(planned.findings));
    session_->configure_with(traffic::settings_of(planned));
  }
  const auto opened = session_->open();
  if (opened) return {};
  const char* const what =
      opened.error().code == Errc::invalid ? "the buses cannot be opened: " : "the slot table cannot be read: ";
  return tl::unexpected(failure(Exit::failed, what + describe(opened.error())));
}

void MachineRun::power_on() {
  if (world_ != nullptr) world_->start();
}

void MachineRun::power_on_and_boot(rt::Duration more) {
  power_on();
  if (loop_ != nullptr) return;
  rt::Duration boot{0};
  for (const auto& device : plant_.devices) boot = std::max(boot, device.boot);
  driver_->run_for(boot + more);
}

void MachineRun::milestone(operate::Milestone milestone) {
  if (world_ != nullptr) world_->milestone(after(milestone));
}

plant::After after(operate::Milestone milestone) noexcept {
  switch (milestone) {
    case operate::Milestone::discovered: return plant::After::discovered;
    case operate::Milestone::bound: return plant::After::bound;
    case operate::Milestone::operational: break;
  }
  return plant::After::operational;
}

bool MachineRun::first_start() {
  const bool real = std::ranges::any_of(
      machine_.buses, [](const auto& b) { return is_real(b.port) && b.role != design::Role::observer; });
  if (!real) return false;
  const auto records = slot_table_->store().load(machine_.name);
  return !records || std::ranges::none_of(*records, [](const auto& r) { return r.confirmed || r.intended; });
}

namespace {

design::OnExit wish_of(const design::Bus& bus, const Options& options) {
  if (options.master.on_exit.empty()) return bus.on_exit;
  return options.master.on_exit == "stop"    ? design::OnExit::stop
         : options.master.on_exit == "preop" ? design::OnExit::pre_operational
                                             : design::OnExit::leave;
}

}  // namespace

std::vector<std::string> MachineRun::take_over(const design::Machine& machine) {
  std::vector<std::string> left;
  for (auto& slot : machine_.slots) {
    const design::Slot* const now = machine.slot(slot.spec.name.bus, slot.spec.id);
    if (now == nullptr || now->spec.name.name != slot.spec.name.name) continue;
    operate::Network* const network = session_->network(slot.spec.name.bus);
    if (network == nullptr || !network->take_over(now->spec)) {
      left.push_back(slot.spec.name.name);
      continue;
    }
    slot.spec.spares = now->spec.spares;
    slot.spec.also = now->spec.also;
    slot.spec.replacement = now->spec.replacement;
    slot.spec.when_ambiguous = now->spec.when_ambiguous;
  }
  return left;
}

void MachineRun::leave(const Options& options) {
  bool any = false;
  for (const auto& bus : machine_.buses) {
    const auto wish = wish_of(bus, options);
    auto* const network = session_->network(bus.name);
    if (wish == design::OnExit::leave || bus.role != design::Role::master || network == nullptr) continue;
    const auto command = wish == design::OnExit::stop ? co::NmtCommand::stop : co::NmtCommand::enter_pre_operational;
    session_->stop();  // else the main job would restart the pre-operational devices
    const bool goes =
        network->services().dispatcher.send(co::to_frame({command, co::NmtTarget::all()})) == can::Queued::yes;
    if (goes) network->commanded(command, co::NmtTarget::all());
    any = any || goes;
  }
  constexpr rt::Duration time_to_send = std::chrono::milliseconds(100);
  if (any) driver_->run_for(time_to_send);
}

bool leaves_running(MachineRun& run, const Options& options) {
  return !run.guards().empty() && std::ranges::all_of(run.machine().buses, [&](const auto& bus) {
    return bus.role != design::Role::master || wish_of(bus, options) == design::OnExit::leave;
  });
}

}  // namespace berth::cli
