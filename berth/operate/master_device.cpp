#include "berth/operate/master_device.hpp"

#include "berth/manager/sdo_requests.hpp"
#include "berth/operate/error_control.hpp"
#include "berth/operate/manager_objects.hpp"

namespace berth::operate {
namespace {

using od::Access;
using od::DataType;
using od::Literal;

std::shared_ptr<const od::Description> description() {
  od::DescriptionBuilder b;
  b.variable(0x1000, {.name = "Device type", .access = Access::ro});
  b.variable(0x1001, {.name = "Error register", .type = DataType::unsigned8, .access = Access::ro});
  b.variable(0x1005, {.name = "COB-ID SYNC", .initial = Literal::number(0x80)});
  b.variable(0x1006, {.name = "Communication cycle period"});
  b.variable(0x1008,
             {.name = "Manufacturer device name", .type = DataType::visible_string, .access = Access::constant});
  b.variable(0x1014, {.name = "COB-ID EMCY", .initial = Literal::node_id_plus(0x80)});
  b.variable(0x1017, {.name = "Producer heartbeat time", .type = DataType::unsigned16});
  b.variable(0x1019, {.name = "Synchronous counter overflow value", .type = DataType::unsigned8});
  b.object(0x1018, od::ObjectCode::record, "Identity object");
  b.sub(0x1018, {.sub = 1, .name = "Vendor-ID", .access = Access::ro});
  b.sub(0x1018, {.sub = 2, .name = "Product code", .access = Access::ro});
  b.sub(0x1018, {.sub = 3, .name = "Revision number", .access = Access::ro});
  b.sub(0x1018, {.sub = 4, .name = "Serial number", .access = Access::ro});
  ManagerObjects::describe(b);
  manager::add_sdo_manager_objects(b, 127);
  return b.build();
}

void produce_sync(device::Options& options, const design::BusSync& sync) {
  constexpr std::uint64_t producer = 0x4000'0080;
  const auto us = std::chrono::duration_cast<std::chrono::microseconds>(sync.period).count();
  options.presets.push_back({{0x1019, 0}, sync.counter});
  options.presets.push_back({{0x1006, 0}, static_cast<std::uint64_t>(us)});
  options.presets.push_back({{0x1005, 0}, producer});
}

}  // namespace

MasterDevice::MasterDevice(can::Dispatcher& dispatcher, const design::Bus& bus) {
  static const auto shared = description();
  device::Options options;
  options.source = device::NodeIdSource::fixed;
  options.node_id = bus.master;
  options.lss.on = false;
  options.rand = device::RandMode::off;
  options.name = "Berth";
  options.presets.push_back({{0x1017, 0}, co::whole_ms(bus.timing.heartbeat_period)});
  if (bus.sync) produce_sync(options, *bus.sync);
  device_ = std::make_unique<device::Device>(dispatcher, shared, nullptr, std::move(options));
}

}  // namespace berth::operate
