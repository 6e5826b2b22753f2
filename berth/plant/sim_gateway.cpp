#include "berth/plant/sim_gateway.hpp"

#include <algorithm>

#include "berth/device/dictionary.hpp"
#include "berth/plant/world.hpp"

namespace berth::plant {

std::shared_ptr<const od::Description> gateway_description(unsigned ports) {
  od::DescriptionBuilder builder;
  device::add_device(builder, {.name = "Berth simulated gateway"});
  device::add_storage(builder);
  multilevel::add_gateway_objects(builder, ports);
  return builder.build();
}

multilevel::EmcyGatewayOptions SimGateway::emcy_options(const PlantGateway& plan) {
  multilevel::EmcyGatewayOptions options;
  options.layout = static_cast<multilevel::EmcyLayout>(plan.layout);
  for (const auto node : plan.speaks_layout) options.speaks_layout.set(node);
  return options;
}

SimGateway::Port::Port(SimGateway& owner, SimDevice& of, multilevel::SdoGatewayOptions options)
    : device(&of),
      number(options.port),
      client(of.manager_ ? nullptr : std::make_unique<co::SdoClient>(of.dispatcher_)),
      sdo(owner.above_->device().values(), of.manager_ ? of.manager_->bus().sdo() : *client, *owner.executor_, options),
      bus(*owner.executor_, owner.emcy_, [&owner](co::NmtCommand command) { owner.above_->device().apply(command); }) {
  owner.emcy_.hear_all(of.dispatcher_);
  of.device().on().heartbeat = [this](const co::HeartbeatEvent& event) { bus.heartbeat(event); };
  const auto error_class = multilevel::heartbeat_error_class(options.port);
  bus.on_heartbeat_lost([&owner, error_class] {
    auto& upper = owner.above_->device();
    if (upper.values().get<std::uint8_t>({0x1029, error_class})) upper.errors().behave(error_class);
  });
  if (!of.manager_) return;
  bus.on_settled([&owner] { owner.look_.post(); });
  of.manager_->network().observe([this](const manager::NetworkEvent& event) {
    using Kind = manager::NetworkEvent::Kind;
    if (event.kind == Kind::operational) bus.booted();
    if (event.kind == Kind::halted) bus.failed(event.node);
  });
}

bool SimGateway::Port::boots_first() const noexcept { return device->manager_ != nullptr; }

SimGateway::SimGateway(rt::Executor& executor, SimDevice& above, std::vector<SimDevice*> beneath,
                       const PlantGateway& plan, unsigned levels_beneath)
    : executor_(&executor),
      above_(&above),
      emcy_(above.device().errors().emcy(), emcy_options(plan)),
      look_(*this, executor) {
  for (SimDevice* const device : beneath) {
    multilevel::SdoGatewayOptions options;
    options.port = static_cast<unsigned>(ports_.size() + 1);
    options.levels_beneath = levels_beneath;
    options.literal = plan.literal;
    ports_.push_back(std::make_unique<Port>(*this, *device, options));
  }
  above.boots_last_ = std::ranges::any_of(ports_, [](const auto& port) { return port->boots_first(); });
}

void SimGateway::changed(const SimDevice& device) noexcept {
  const bool mine = std::ranges::any_of(ports_, [&](const auto& port) { return port->device == &device; });
  if (&device != above_ && !mine) return;
  was_reset_ |= &device == above_ && device.device().state() == NmtState::initialising;
  look_.post();
}

bool SimGateway::settled() const noexcept {
  return std::ranges::all_of(ports_, [](const auto& port) { return !port->boots_first() || port->bus.settled(); });
}

// One device: the ports beneath have power while the one above has, and it boots when they are done.
void SimGateway::look() noexcept {
  const bool reset = std::exchange(was_reset_, false);
  for (auto& port : ports_) {
    auto& device = *port->device;
    if (above_->powered() && !device.powered()) port->bus.begin();
    if (above_->plugged() != device.plugged()) above_->plugged() ? device.plug() : device.unplug();
    if (above_->powered() != device.powered()) device.power(above_->powered());
    if (reset) port->sdo.reset();
    port->sdo.set_own(device.device().node_id(), device.device().values());
    port->bus.set_mandatory(multilevel::is_mandatory(above_->device().values(), port->number));
    if (reset) port->bus.own_state(NmtState::initialising);
  }
  if (reset) state_ = NmtState::initialising;
  look_above();
  if (settled() && above_->powered() && std::exchange(above_->waits_, false)) above_->device_.power_on();
}

void SimGateway::look_above() noexcept {
  const NmtState now = above_->device().state();
  if (std::exchange(state_, now) == now) return;
  for (auto& port : ports_) port->bus.own_state(now);
}

}  // namespace berth::plant
