#include "berth/plant/sim_gateway.hpp"

#include <algorithm>

#include "berth/device/dictionary.hpp"
#include "berth/plant/world.hpp"

namespace berth::plant {

std::shared_ptr<const od::Description> gateway_description(unsigned ports) {
  od::DescriptionBuilder builder;
  device::add_device(builder, {.name = "Berth simulated gateway"});
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
      client(of.dispatcher_),
      sdo(owner.above_->device().values(), client, *owner.executor_, options),
      bus(*owner.executor_, owner.emcy_, [&owner](co::NmtCommand command) { owner.above_->device().apply(command); }) {
  owner.emcy_.hear_all(of.dispatcher_);
  of.device().on().heartbeat = [this](const co::HeartbeatEvent& event) { bus.heartbeat(event); };
  const auto error_class = multilevel::heartbeat_error_class(options.port);
  bus.on_heartbeat_lost([&owner, error_class] {
    auto& upper = owner.above_->device();
    if (upper.values().get<std::uint8_t>({0x1029, error_class})) upper.error_behaviour(error_class);
  });
}

SimGateway::SimGateway(rt::Executor& executor, SimDevice& above, std::vector<SimDevice*> beneath,
                       const PlantGateway& plan, unsigned levels_beneath)
    : executor_(&executor), above_(&above), emcy_(above.device().emcy(), emcy_options(plan)), look_(*this, executor) {
  for (SimDevice* const device : beneath) {
    multilevel::SdoGatewayOptions options;
    options.port = static_cast<unsigned>(ports_.size() + 1);
    options.levels_beneath = levels_beneath;
    options.literal = plan.literal;
    ports_.push_back(std::make_unique<Port>(*this, *device, options));
  }
}

void SimGateway::changed(const SimDevice& device) noexcept {
  const bool mine = std::ranges::any_of(ports_, [&](const auto& port) { return port->device == &device; });
  if (&device != above_ && !mine) return;
  was_reset_ |= &device == above_ && device.device().state() == NmtState::initialising;
  look_.post();
}

// One device: the ports beneath have power while the one above has.
void SimGateway::look() noexcept {
  const bool reset = std::exchange(was_reset_, false);
  for (auto& port : ports_) {
    auto& device = *port->device;
    if (above_->plugged() != device.plugged()) above_->plugged() ? device.plug() : device.unplug();
    if (above_->powered() != device.powered()) device.power(above_->powered());
    if (reset) port->sdo.reset();
    port->sdo.set_own(device.device().node_id(), device.device().values());
  }
}

}  // namespace berth::plant
