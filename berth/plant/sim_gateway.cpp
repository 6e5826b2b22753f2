#include "berth/plant/sim_gateway.hpp"

#include <algorithm>

#include "berth/device/dictionary.hpp"
#include "berth/multilevel/hardware_version.hpp"
#include "berth/multilevel/objects.hpp"
#include "berth/multilevel/routing_objects.hpp"

namespace berth::plant {

namespace {

// Levels of gateways beneath this one. `left`: at most the number of gateways, so that the recursion ends in a ring.
unsigned levels_beneath(const PlantFile& plant, const PlantGateway& gateway, std::size_t left) {
  unsigned deepest = 0;
  for (const auto& name : gateway.beneath) {
    const auto* const port = plant.device(name);
    for (const auto& other : plant.gateways) {
      const auto* const above = plant.device(other.above);
      if (port == nullptr || above == nullptr || above->bus != port->bus || left == 0) continue;
      deepest = std::max(deepest, 1 + levels_beneath(plant, other, left - 1));
    }
  }
  return deepest;
}

// A gateway beneath this one uses the EMCY layout.
PlantGateway with_gateways_beneath(const PlantGateway& plan, const PlantFile& plant) {
  PlantGateway whole = plan;
  for (const auto& other : plant.gateways) {
    const auto* const node = plant.device(other.above);
    const auto under = [&](const std::string& port) { return plant.device(port)->bus == node->bus; };
    if (std::ranges::any_of(plan.beneath, under) && node->node_id.configured()) {
      whole.speaks_layout.push_back(node->node_id.value());
    }
  }
  return whole;
}

}  // namespace

std::shared_ptr<const od::Description> gateway_description(unsigned ports, unsigned signals, std::uint32_t hardware) {
  od::DescriptionBuilder builder;
  device::add_device(builder, {.name = "Berth simulated gateway"});
  device::add_storage(builder);
  multilevel::add_gateway_objects(builder, ports);
  if (hardware != 0) multilevel::add_hardware_version(builder, hardware);
  if (signals != 0) multilevel::add_routing_objects(builder, static_cast<std::uint8_t>(signals));
  add_signals(builder, signals);
  return builder.build();
}

void add_signals(od::DescriptionBuilder& builder, unsigned signals) {
  constexpr unsigned pdos = 4;
  if (signals != 0) multilevel::add_signal_places(builder, static_cast<std::uint8_t>(signals), pdos);
}

bool check_gateway(const PlantGateway& plan, const device::Device& above, Findings& findings) {
  const auto objects = multilevel::SdoGatewayObjects::of(static_cast<unsigned>(plan.beneath.size()));
  if (above.values().description().find(objects.data) != nullptr) return true;
  Finding finding;
  finding.key = plan.above;
  finding.message = "its description has no objects of a gateway (5F30h.., 5F00h)";
  finding.fix = "leave out eds, or add them";
  findings.push_back(std::move(finding));
  return false;
}

multilevel::EmcyGatewayOptions SimGateway::emcy_options(const PlantGateway& plan) {
  multilevel::EmcyGatewayOptions options;
  options.layout = static_cast<multilevel::EmcyLayout>(plan.layout);
  for (const auto node : plan.speaks_layout) options.speaks_layout.set(node);
  return options;
}

SimGateway::Port::Port(SimGateway& owner, GatewaySide& of, multilevel::SdoGatewayOptions options)
    : side(&of),
      number(options.port),
      client(of.inside().manager != nullptr ? nullptr : std::make_unique<co::SdoClient>(*of.inside().dispatcher)),
      sdo(owner.above_->device().values(), client ? *client : of.inside().manager->bus().sdo(), *owner.executor_,
          options),
      bus(*owner.executor_, owner.emcy_, [&owner](co::NmtCommand command) { owner.above_->device().apply(command); }) {
  owner.emcy_.hear_all(*of.inside().dispatcher);
  of.device().on().heartbeat = [this](const co::HeartbeatEvent& event) { bus.heartbeat(event); };
  const auto error_class = multilevel::heartbeat_error_class(options.port);
  bus.on_heartbeat_lost([&owner, error_class] {
    auto& upper = owner.above_->device();
    if (upper.values().get<std::uint8_t>({0x1029, error_class})) upper.errors().behave(error_class);
  });
  if (!boots_first()) return;
  bus.on_settled([&owner] { owner.look_.post(); });
  of.inside().manager->network().observe([this](const network::NetworkEvent& event) {
    using Kind = network::NetworkEvent::Kind;
    if (event.kind == Kind::operational) bus.booted();
    if (event.kind == Kind::halted) bus.failed(event.node);
  });
}

bool SimGateway::Port::boots_first() const noexcept { return side->inside().manager != nullptr; }

SimGateway::SimGateway(rt::Executor& executor, GatewaySide& above, std::vector<GatewaySide*> beneath,
                       const PlantGateway& plan, const PlantFile& plant)
    : executor_(&executor),
      above_(&above),
      emcy_(above.device().errors().emcy(), emcy_options(with_gateways_beneath(plan, plant))),
      layout_(emcy_.layout()),
      look_(*this, executor) {
  for (GatewaySide* const side : beneath) {
    multilevel::SdoGatewayOptions options;
    options.port = static_cast<unsigned>(ports_.size() + 1);
    options.levels_beneath = levels_beneath(plant, plan, plant.gateways.size());
    options.literal = plan.literal;
    ports_.push_back(std::make_unique<Port>(*this, *side, options));
  }
  if (above.device().values().description().find({multilevel::RoutingObjects::routes, 1}) != nullptr) {
    std::vector<multilevel::DeviceSignals::Side> sides{{&above.device(), above.inside().meter}};
    for (GatewaySide* const side : beneath) sides.push_back({&side->device(), side->inside().meter});
    signals_.emplace(executor, std::move(sides), emcy_);
    signals_->follow_objects();
  }
  above.set_boots_last(std::ranges::any_of(ports_, [](const auto& port) { return port->boots_first(); }));
}

void SimGateway::changed(const device::Device& device) noexcept {
  const bool is_above = &device == &above_->device();
  const bool mine =
      is_above || std::ranges::any_of(ports_, [&](const auto& port) { return &port->side->device() == &device; });
  if (!mine) return;
  was_reset_ |= is_above && device.state() == NmtState::initialising;
  look_.post();
}

bool SimGateway::settled() const noexcept {
  return std::ranges::all_of(ports_, [](const auto& port) { return !port->boots_first() || port->bus.settled(); });
}

// A gateway is one device: its ports beneath have power while the one above has, and it boots after them.
void SimGateway::look() noexcept {
  const bool reset = std::exchange(was_reset_, false);
  for (auto& port : ports_) {
    auto& side = *port->side;
    if (above_->powered() && !side.powered()) port->bus.begin();
    side.follow(*above_);
    if (reset) port->sdo.reset();
    port->sdo.set_own(side.device().node_id(), side.device().values());
    port->bus.set_mandatory(multilevel::is_mandatory(above_->device().values(), port->number));
    if (reset) port->bus.own_state(NmtState::initialising);
  }
  const auto& upper = above_->device().values();
  emcy_.set_layout(multilevel::emcy_layout_of(upper, layout_), multilevel::layout_speakers_of(upper));
  if (reset) state_ = NmtState::initialising;
  look_above();
  if (signals_) signals_->look();
  if (settled() && above_->powered() && above_->end_wait()) above_->device().power_on();
}

void SimGateway::look_above() noexcept {
  const NmtState now = above_->device().state();
  if (std::exchange(state_, now) == now) return;
  for (auto& port : ports_) port->bus.own_state(now);
}

}  // namespace berth::plant
