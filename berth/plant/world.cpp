#include "berth/plant/world.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <utility>

#include "berth/base/words.hpp"

namespace berth::plant {
namespace {

std::uint32_t bit_rate_of(const PlantDevice& plan, const sim::Bus& bus) noexcept {
  return plan.bitrate != 0 ? plan.bitrate : bus.bit_rate();
}

sim::ControllerOptions controller_of(const PlantDevice& plan, const sim::Bus& bus) {
  sim::ControllerOptions o;
  o.name = plan.name;
  o.queue = plan.controller.queue == QueueKind::priority ? sim::TxOrder::priority : sim::TxOrder::in_order;
  // Only the host's receive buffer (`device::TimedPort`) is simulated: this one passes the frames on.
  o.queue_depth = 8;
  o.rx_depth = 4;
  o.bit_rate = bit_rate_of(plan, bus);
  o.fd = bus.fd();
  o.powered = false;
  return o;
}

/// Null when no node of the bus has this name.
sim::Controller* controller_named(const sim::Bus& bus, std::string_view name) noexcept {
  const auto& all = bus.controllers();
  const auto it = std::ranges::find(all, name, [](const sim::Controller* c) { return std::string_view(c->name()); });
  return it == all.end() ? nullptr : *it;
}

void refuse(Findings& findings, std::string key, std::string message, std::string fix) {
  Finding finding;
  finding.key = std::move(key);
  finding.message = std::move(message);
  finding.fix = std::move(fix);
  findings.push_back(std::move(finding));
}

std::string names_of(std::span<const BusRate> rates) {
  std::vector<std::string> names;
  for (const auto& rate : rates) names.push_back(berth::quoted(rate.name));
  return some_of(names);
}

void warn(Findings& findings, const PlantBus& bus, std::string message, std::string fix) {
  refuse(findings, "bus." + bus.name, std::move(message), std::move(fix));
  findings.back().severity = Finding::Severity::warning;
}

/// Warns if a bus has another name or bit rate in the machine file: on a real bus no node would hear another.
void compare(const PlantBus& bus, std::span<const BusRate> rates, Findings& findings) {
  const auto same = std::ranges::find(rates, bus.name, &BusRate::name);
  if (same == rates.end()) {
    if (rates.empty() || bus.bitrate == 0) return;
    warn(findings, bus, fmt::format("the machine file has no bus of this name, but {}", names_of(rates)),
         "give both the same name, where they are one bus");
  } else if (bus.bitrate != 0 && same->bit_rate != 0 && bus.bitrate != same->bit_rate) {
    warn(findings, bus,
         fmt::format("{} bit/s here and {} bit/s in the machine file: the simulated bus has {} bit/s", bus.bitrate,
                     same->bit_rate, bus.bitrate),
         "give both the same: on a real bus no device would answer");
  }
}

/// The memory as the next power-on will find it.
std::vector<std::uint8_t> kept_image(const device::SimFlash& flash, const SimDevice::NextPowerOn& next) {
  std::vector<std::uint8_t> image(flash.image().begin(), flash.image().end());
  const auto record = std::min(image.size(), device::parameters_at);
  if (next.node_id) std::fill_n(image.begin(), record, std::uint8_t{0xFF});
  return image;
}

}  // namespace

// --- SimDevice -------------------------------------------------------------------------------------------------------

// A script's behaviour, and its messages to the world's observers.
class SimDevice::Scripted final : private script::Behaviour::Listener {
 public:
  Scripted(SimDevice& device, script::Script script, Random random)
      : device_(device), behaviour_(device.device_, device.bus_->executor(), std::move(script), random, *this) {}
  void stop() noexcept { behaviour_.stop(); }

 private:
  void script_told(const script::Message& told) noexcept override {
    for (auto* observer : device_.world_->observers_) observer->script_told(device_, told);
  }
  bool script_must_end() noexcept override {
    return std::ranges::any_of(device_.world_->observers_, [](auto* observer) { return observer->scripts_must_end(); });
  }
  SimDevice& device_;
  script::Behaviour behaviour_;
};

SimDevice::SimDevice(World& world, sim::Bus& bus, const PlantDevice& plan, const LssAddress& address,
                     std::shared_ptr<const od::Description> description, Random random,
                     std::optional<script::Script> script, bool metered)
    : world_(&world),
      bus_(&bus),
      plan_(plan),
      timing_(timing_of(plan)),
      flash_(bus.executor(), memory_of(plan, *description), timing_.in_world(plan.storing.time)),
      program_flash_(program_flash_of(plan, bus.executor())),
      controller_(bus.attach(controller_of(plan, bus))),
      port_(bus.executor(), *controller_, timing_, random),
      meter_(metered ? std::make_optional<multilevel::MeteredPort>(bus.executor(), port_) : std::nullopt),
      dispatcher_(bus.executor(), meter_ ? static_cast<can::Port&>(*meter_) : port_),
      device_(dispatcher_, std::move(description), &flash_,
              options_of(plan, address, bit_rate_of(plan, bus), Random(random).next()), &port_, timing_,
              programs_of(plan, program_flash_.get())),
      odd_(plan.does.odd, device_, bus.executor()) {
  if (!plan.controller.extended_frames) refuse_extended_frames();
  flash_.watch(this);
  device_.observe(this);
  if (script) scripted_ = std::make_unique<Scripted>(*this, *std::move(script), random.fork());
  master_ = master_of(plan_, dispatcher_, device_);
  if (master_.memory) master_.memory->on_write([this] { world_->save(); });
}

// Its controller takes the first 11 bits for a remote frame, and finds no CRC delimiter where that frame would have it:
// at bit 34 without stuff bits, of which there are at most 8. Here its error flag always comes after them.
void SimDevice::refuse_extended_frames() {
  constexpr int behind_that = 34 + 8 + 1;
  constexpr unsigned error_flag = 6;
  sim::Fault flag;
  flag.kind = sim::Fault::Kind::dominant;
  flag.trigger.times = 0;
  flag.trigger.when = [this](const sim::FrameStart& start) {
    return start.frame.extended && controller_->powered() && controller_->cable_in() && !controller_->status().bus_off;
  };
  flag.where = sim::from_start(behind_that);
  flag.bits = error_flag;
  error_flags_ = controller_->bus().faults().add(flag);
}

SimDevice::~SimDevice() {
  if (error_flags_) controller_->bus().faults().cancel(*error_flags_);
  flash_.watch(nullptr);
  device_.observe(nullptr);
}

void SimDevice::switch_on() noexcept {
  if (powered_) return;
  powered_ = true;
  if (next_.serial) {
    auto address = device_.options().address;
    address.serial = *std::exchange(next_.serial, std::nullopt);
    device_.set_address(address);
  }
  if (next_.node_id) {
    const auto rate = lss::bit_rate(device_.lss().persistent().bit_rate).value_or(0);
    // A bit rate outside CiA's table cannot be stored: the plan's stays.
    const bool stored = rate != 0 && lss::bit_rate_index(device_.options().bit_rate).has_value();
    device_.set_blank(*std::exchange(next_.node_id, std::nullopt), stored ? rate : device_.options().bit_rate);
    flash_.erase(device::parameters_at);  // what LSS stored; its parameters stay
  }
  controller_->power(true);
  if (begin_wait()) return world_->tell(*this);  // a gateway boots after the buses beneath it
  device_.power_on();
}

void SimDevice::switch_off() noexcept {
  if (!powered_) return;
  powered_ = false;
  if (master_.manager) master_.manager->power_off();
  device_.power_off();
  controller_->power(false);
  if (scripted_) scripted_->stop();
}

void SimDevice::plug() noexcept {
  if (plugged_) return;
  plugged_ = true;
  switch_on();
  world_->save();
}

void SimDevice::unplug() noexcept {
  if (!plugged_) return;
  plugged_ = false;
  // An unpowered controller does not exist for the others: pulling its cable too would change nothing.
  switch_off();
  world_->tell(*this);
  world_->save();
}

void SimDevice::power(bool on) noexcept {
  if (!plugged_) return;
  if (on) {
    switch_on();
  } else {
    switch_off();
  }
}

void SimDevice::follow(const GatewaySide& above) noexcept {
  const bool on_bus = static_cast<const SimDevice&>(above).plugged();
  if (on_bus != plugged_) on_bus ? plug() : unplug();
  if (above.powered() != powered_) power(above.powered());
}

void SimDevice::reset() noexcept {
  if (!powered_) return;
  if (master_.manager) master_.manager->power_off();
  // A microcontroller that restarts also sets up its CAN controller: queued frames are lost.
  device_.power_off();
  if (scripted_) scripted_->stop();
  controller_->restart(controller_->bit_rate());
  if (begin_wait()) return world_->tell(*this);
  device_.power_on();
}

void SimDevice::deaf(Duration duration) {
  port_.deaf(device::TimedPort::Deaf::fault, true);
  const auto mine = ++deafness_;
  if (duration <= Duration::zero()) return;
  world_->sim().after(duration, [this, mine] {
    if (deafness_ == mine) port_.deaf(device::TimedPort::Deaf::fault, false);
  });
}

void SimDevice::slow(Duration latency, Duration duration) {
  port_.slow(latency);
  const auto mine = ++slowness_;
  if (duration <= Duration::zero()) return;
  world_->sim().after(duration, [this, mine] {
    if (slowness_ == mine) port_.slow(Duration::zero());
  });
}

Truth SimDevice::truth() const {
  Truth t;
  t.name = plan_.name;
  t.bus = bus_->name();
  t.address = device_.lss().address();
  t.plugged = plugged_;
  t.powered = powered_;
  t.booting = device_.booting();
  t.deaf = port_.deaf(device::TimedPort::Deaf::fault);
  t.late = port_.slow();
  t.active = device_.node_id();
  t.pending = device_.lss().pending().node_id;
  t.persistent = device_.lss().persistent().node_id;
  t.bit_rate = controller_->bit_rate();
  t.state = device_.state();
  t.memory_writes = flash_.writes_begun();
  t.memory_written = flash_.writes_ended();
  if (master_.manager && plan_.does.master->flying) {
    t.leads = master_.manager->flying().is_master();
    t.active_master = master_.manager->flying().active().value_or(manager::MasterRank{}).node;
  }
  if (powered_) t.leds = device::leds(device_.led_inputs());
  return t;
}

std::size_t SimDevice::memory_use() const noexcept {
  return sizeof(SimDevice) - sizeof(device::Device) + device_.memory() + sizeof(sim::Controller) + flash_.memory() +
         port_.memory() + plan_.name.capacity() + plan_.bus.capacity();
}

void SimDevice::device_changed(const device::Device&) noexcept { world_->tell(*this); }

void SimDevice::write_ended() noexcept { world_->save(); }

void SimDevice::cut() noexcept {
  switch_off();
  world_->save();
}

// --- World -----------------------------------------------------------------------------------------------------------

World::~World() { gateways_.clear(); }

std::unique_ptr<World> World::make(const PlantFile& plant, std::span<const BusRate> rates, Findings& findings) {
  auto world = std::unique_ptr<World>(new World(plant.seed));
  bool good = world->make_buses(plant, rates, findings);
  for (const auto& plan : plant.devices) {
    const auto part = plant.gateway_part(plan.name);
    const Described* described = world->descriptions_.of(plan, findings, part);
    sim::Bus* bus = world->bus(plan.bus);
    if (bus == nullptr && good) {
      refuse(findings, plan.name, "bus \"" + plan.bus + "\" is neither in the plant nor in the machine file",
             "add [bus." + plan.bus + "] with its bitrate");
    }
    auto script = world->scripts_.of(plan, findings);
    const bool programs = described != nullptr && check_programs(plan, *described->description, findings);
    if (!programs || bus == nullptr || (!plan.does.script.file.empty() && !script)) {
      good = false;
      continue;
    }
    world->devices_.push_back(std::make_unique<SimDevice>(*world, *bus, plan, address_of(plan, *described),
                                                          described->description, world->sim_.random().fork(),
                                                          std::move(script), part.any));
  }
  good = good && world->make_gateways(plant, findings);
  world->events_ = plant.events;
  if (!good) world.reset();
  return world;
}

bool World::make_gateways(const PlantFile& plant, Findings& findings) {
  for (const auto& plan : plant.gateways) {
    SimDevice& above = *find(plan.above);
    if (!check_gateway(plan, above.device(), findings)) return false;
    std::vector<GatewaySide*> beneath;
    for (const auto& name : plan.beneath) beneath.push_back(find(name));
    gateways_.push_back(std::make_unique<SimGateway>(executor(), above, std::move(beneath), plan, plant));
  }
  return true;
}

bool World::make_buses(const PlantFile& plant, std::span<const BusRate> rates, Findings& findings) {
  bool good = true;
  const auto rate_of = [&](std::string_view name) {
    const auto it = std::ranges::find(rates, name, &BusRate::name);
    return it == rates.end() ? 0U : it->bit_rate;
  };
  for (const auto& bus : plant.buses) {
    const auto rate = bus.bitrate != 0 ? bus.bitrate : rate_of(bus.name);
    compare(bus, rates, findings);
    if (rate == 0) {
      refuse(findings, "bus." + bus.name,
             rates.empty() ? std::string("no bit rate, neither here nor in a machine file")
                           : fmt::format("no bit rate here, and the machine file has no bus of this name, but {}",
                                         names_of(rates)),
             rates.empty() ? "give it one, such as bitrate = 250_000, or name the machine file: --machine FILE"
                           : "give it that name, or a bit rate of its own");
      good = false;
    } else if (sim_.find_bus(bus.name) == nullptr) {
      sim_.add_bus(bus.name, rate, bus.fd_bitrate);
    }
  }
  for (const auto& bus : rates) {
    if (bus.bit_rate != 0 && sim_.find_bus(bus.name) == nullptr) sim_.add_bus(bus.name, bus.bit_rate);
  }
  return good;
}

void World::start() {
  if (std::exchange(started_, true)) return;
  for (const auto& device : devices_) {
    if (device->plan_.plugged) device->plug();
  }
  milestone(After::start);
}

void World::milestone(After after) {
  if (std::ranges::find(reached_, after) != reached_.end()) return;
  reached_.push_back(after);
  for (const auto& event : events_) {
    if (event.after == after) sim_.after(event.delay, [this, &event] { perform(event); });
  }
}

bool World::perform(const PlantEvent& event) {
  std::vector<sim::Controller*> controllers;
  switch (event.action) {
    case Action::cut_cable:
      if (bus(event.bus) == nullptr || !nodes(event, controllers)) return false;
      bus(event.bus)->split(controllers);
      return true;
    case Action::join:
      if (bus(event.bus) == nullptr) return false;
      bus(event.bus)->join();
      return true;
    case Action::disturb:
    case Action::overrun: return strike(event);
    default: break;
  }
  SimDevice* device = find(event.device);
  if (device == nullptr) return false;
  switch (event.action) {
    case Action::plug: device->plug(); break;
    case Action::unplug: device->unplug(); break;
    case Action::power_off: device->power(false); break;
    case Action::power_on: device->power(true); break;
    case Action::reset: device->reset(); break;
    case Action::deaf: device->deaf(event.duration); break;
    case Action::slow: device->slow(event.latency, event.duration); break;
    case Action::recover: recover(*device); break;
    case Action::set_serial: device->next_power_on().serial = event.value; break;
    case Action::set_node_id:
      if (!NodeId::make(event.value)) return false;
      device->next_power_on().node_id = NodeId::make(event.value);
      break;
    default: return false;
  }
  return true;
}

bool World::nodes(const PlantEvent& event, std::vector<sim::Controller*>& found) {
  for (const auto& name : event.nodes) {
    found.push_back(controller_named(*bus(event.bus), name));
    if (found.back() == nullptr) return false;
  }
  return true;
}

bool World::strike(const PlantEvent& event) {
  std::vector<sim::Controller*> victims;
  sim::Bus* on = bus(event.bus);
  if (on == nullptr || !nodes(event, victims)) return false;
  using Kind = sim::Fault::Kind;
  const auto& s = event.strike;
  const sim::Controller* const sender = controller_named(*on, s.sender);
  if (sender == nullptr && !s.sender.empty()) return false;
  sim::Fault fault;
  if (event.action == Action::overrun) {
    fault.kind = Kind::overrun;
  } else {
    fault.kind = std::array{Kind::flip, Kind::dominant, Kind::recessive}.at(static_cast<std::size_t>(s.kind));
  }
  fault.trigger.frame = s.frame;
  if (s.id || sender != nullptr) {
    fault.trigger.when = [id = s.id, of = sender != nullptr ? sender->number() : -1](const sim::FrameStart& start) {
      return (!id || start.frame.key() == *id) && (of < 0 || start.sender == of);
    };
  }
  fault.trigger.skip = s.skip;
  fault.trigger.times = s.times;
  fault.where = {s.bit, s.from_end};
  fault.bits = s.bits;
  fault.victims.assign(victims.begin(), victims.end());
  fault.spare_senders = s.spare_senders;
  on->inject(std::move(fault));
  return true;
}

std::unique_ptr<sim::Controller> World::attach_master(std::string_view name, sim::ControllerOptions options) {
  sim::Bus* on = bus(name);
  if (on == nullptr) return nullptr;
  options.name = master_name;
  options.fd = on->fd();
  return on->attach(options);
}

SimDevice* World::find(std::string_view name) noexcept {
  const auto it = std::ranges::find(devices_, name, [](const auto& d) { return std::string_view(d->name()); });
  return it == devices_.end() ? nullptr : it->get();
}

std::vector<Truth> World::truth() const {
  std::vector<Truth> all;
  for (const auto& device : devices_) all.push_back(device->truth());
  return all;
}

std::vector<std::pair<const SimDevice*, const SimDevice*>> World::duplicates() const {
  std::vector<std::pair<const SimDevice*, const SimDevice*>> pairs;
  std::map<std::pair<const sim::Bus*, NodeId>, const SimDevice*> holders;
  for (const auto& device : devices_) {
    const auto id = device->device_.node_id();
    if (!device->powered_ || !id.configured()) continue;
    const auto [it, fresh] = holders.try_emplace({device->bus_, id}, device.get());
    if (!fresh) pairs.emplace_back(it->second, device.get());
  }
  return pairs;
}

void World::tell(const SimDevice& device) noexcept {
  for (auto& gateway : gateways_) gateway->changed(device.device_);
  for (auto* observer : observers_) observer->plant_changed(device);
}

// --- State -----------------------------------------------------------------------------------------------------------

std::string World::state() const {
  std::vector<Kept> kept;
  for (const auto& d : devices_) {
    const auto& o = d->device_.options();
    kept.push_back({d->next_.serial.value_or(o.address.serial), d->next_.node_id.value_or(o.node_id), o.bit_rate,
                    d->plugged_, kept_image(d->flash_, d->next_), list_memory_of(d->master_), d->name()});
  }
  return write_state(kept);
}

Result<void> World::restore(std::string_view state) {
  const auto kept = parse_state(state);
  if (!kept) return tl::unexpected(kept.error());
  const bool ours = std::ranges::all_of(*kept, [this](const Kept& one) { return find(one.name) != nullptr; });
  if (!ours || kept->size() != devices_.size()) return fail(Errc::mismatch, "the state belongs to another plant");
  for (const auto& one : *kept) {
    auto& device = *find(one.name);
    auto address = device.device_.options().address;
    address.serial = one.serial;
    device.device_.set_address(address);
    device.device_.set_blank(one.node_id, one.bit_rate);
    device.flash_.restore(one.image);
    if (device.master_.memory) device.master_.memory->restore(one.list_memory);
    device.plan_.plugged = one.plugged;
  }
  return {};
}

Result<void> World::keep_state(const std::string& path) {
  const auto text = read_state_file(path);
  if (!text) return tl::unexpected(text.error());
  if (text->has_value()) {
    if (auto restored = restore(**text); !restored) return restored;
  }
  state_path_ = path;
  return {};
}

void World::save() noexcept {
  // A full disk must not end the simulation.
  if (!state_path_.empty()) write_state_file(state_path_, state());
}

}  // namespace berth::plant
