#include "berth/multilevel/gateway_device.hpp"

#include <algorithm>

#include "berth/device/dictionary.hpp"
#include "berth/multilevel/objects.hpp"

namespace berth::multilevel {
namespace {

std::shared_ptr<const od::Description> plain_gateway(unsigned ports) {
  od::DescriptionBuilder builder;
  device::add_device(builder, {.name = "Gateway"});
  add_gateway_objects(builder, ports);
  return builder.build();
}

}  // namespace

void add_gateway_objects(od::DescriptionBuilder& builder, unsigned ports) {
  add_sub_buses(builder, ports);
  add_emcy_layout(builder);
  for (unsigned port = 1; port <= ports; ++port) add_sdo_gateway(builder, port);
}

// ---- one bus beneath ----

GatewayDevice::Bus::Bus(GatewayDevice& owner, can::Port& port, unsigned number, const BusOptions& options)
    : port_(*owner.executor_, port),
      dispatcher_(*owner.executor_, port_),
      device_(dispatcher_, options.description ? options.description : device::minimal_description(), options.memory,
              options.device, options.host),
      sub_bus_(*owner.executor_, owner.emcy_, [&owner](co::NmtCommand command) { owner.upper_.apply(command); }),
      client_(std::in_place, dispatcher_, options.sdo.sdo),
      number_(number),
      boots_first_(options.boots_first) {
  SdoGatewayOptions sdo = options.sdo;
  sdo.port = number;
  gateway_.emplace(owner.upper_.values(), *client_, *owner.executor_, sdo);
  owner.emcy_.hear_all(dispatcher_);
  device_.on().heartbeat = [this](const co::HeartbeatEvent& event) { sub_bus_.heartbeat(event); };
  sub_bus_.on_settled([&owner] { owner.come_up(); });
  sub_bus_.on_heartbeat_lost([&owner, number] {
    if (owner.upper_.values().get<std::uint8_t>({0x1029, heartbeat_error_class(number)})) {
      owner.upper_.errors().behave(heartbeat_error_class(number));
    }
  });
}

GatewayDevice::Bus::~Bus() { device_.observe(nullptr); }

void GatewayDevice::Bus::use(co::SdoClient& client) noexcept {
  gateway_->set_client(client);
  client_.reset();
}

// ---- the whole gateway ----

GatewayDevice::GatewayDevice(rt::Executor& executor, can::Port& above, const GatewayOptions& options)
    : executor_(&executor),
      port_(executor, above),
      dispatcher_(executor, port_),
      upper_(dispatcher_, options.description ? options.description : plain_gateway(options.ports), options.memory,
             options.upper, options.host),
      emcy_(upper_.errors().emcy(), options.emcy),
      layout_(options.emcy.layout),
      look_(*this, executor) {
  upper_.observe(this);
}

GatewayDevice::~GatewayDevice() {
  upper_.observe(nullptr);
  signals_.reset();
  buses_.clear();
}

GatewayDevice::Bus& GatewayDevice::add_bus(can::Port& port, const BusOptions& options) {
  const auto number = static_cast<unsigned>(buses_.size() + 1);
  auto& made = *buses_.emplace_back(std::make_unique<Bus>(*this, port, number, options));
  made.device_.observe(this);
  return made;
}

void GatewayDevice::power_on() {
  waits_ = std::ranges::any_of(buses_, [](const auto& bus) { return bus->boots_first_; });
  for (auto& bus : buses_) bus->sub_bus_.begin();
  for (auto& bus : buses_) bus->device_.power_on();
  if (!waits_) upper_.power_on();
}

void GatewayDevice::power_off() {
  waits_ = false;
  upper_.power_off();
  for (auto& bus : buses_) bus->device_.power_off();
  for (auto& bus : buses_) bus->gateway_->reset();
}

void GatewayDevice::come_up() noexcept {
  const auto settled = [](const auto& bus) { return !bus->boots_first_ || bus->sub_bus_.settled(); };
  if (waits_ && std::ranges::all_of(buses_, settled)) look_.post();
}

void GatewayDevice::device_changed(const device::Device& device) noexcept {
  was_reset_ |= &device == &upper_ && device.state() == NmtState::initialising;
  look_.post();
}

void GatewayDevice::look() noexcept {
  const auto settled = [](const auto& bus) { return !bus->boots_first_ || bus->sub_bus_.settled(); };
  if (waits_ && std::ranges::all_of(buses_, settled)) {
    waits_ = false;
    upper_.power_on();
    return look_.post();
  }
  for (auto& bus : buses_) {
    const auto own = bus->device_.node_id();
    bus->gateway_->set_own(own, bus->device_.values());
    bus->sub_bus_.set_mandatory(is_mandatory(upper_.values(), bus->number_));
  }
  emcy_.set_layout(emcy_layout_of(upper_.values(), layout_), layout_speakers_of(upper_.values()));
  if (std::exchange(was_reset_, false)) {
    upper_state_ = NmtState::initialising;
    for (auto& bus : buses_) bus->gateway_->reset();
    for (auto& bus : buses_) bus->sub_bus_.own_state(NmtState::initialising);
  }
  if (upper_state_ != upper_.state()) {
    upper_state_ = upper_.state();
    for (auto& bus : buses_) bus->sub_bus_.own_state(upper_state_);
  }
  if (signals_) signals_->look();
}

// ---- signals ----

void GatewayDevice::make_signals() {
  std::vector<DeviceSignals::Side> sides{{&upper_, &port_}};
  for (auto& bus : buses_) sides.push_back({&bus->device_, &bus->port_});
  signals_.emplace(*executor_, std::move(sides), emcy_);
}

std::vector<SignalProblem> GatewayDevice::set_signals(std::vector<Signal> table) {
  make_signals();
  return signals_->set_table(std::move(table));
}

void GatewayDevice::signals_from_objects() {
  make_signals();
  signals_->follow_objects();
}

}  // namespace berth::multilevel
