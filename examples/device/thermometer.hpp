// A CANopen device as its maker writes it: a thermometer with a fan. It measures a temperature and sends it in a PDO
// when it changes, takes the fan's speed from a PDO, and reports an emergency when it gets too hot. Everything else
// (NMT, heartbeat, SDO, LSS, stored parameters) comes with `device::Device`.
#pragma once

#include "berth/device/device.hpp"

class Thermometer {
 public:
  Thermometer(berth::rt::Executor& executor, berth::can::Port& port, berth::NodeId id)
      : dispatcher_(executor, port),
        flash_(executor, 4096, std::chrono::milliseconds(10)),
        device_(dispatcher_, dictionary(), &flash_, {.address = {0x0000'0123, 7, 0x0001'0000, 42}, .node_id = id}) {
    device_.on_write({0x2002, 0}, [this] { fan_moved = true; });  // by PDO or by SDO
    device_.power_on();
  }

  /// The sensor has measured, in tenths of a degree.
  void measured(std::int16_t temperature) {
    temperature_.set(temperature);  // sends the PDO when it is another value
    if (temperature > limit_.get()) {
      device_.errors().raise(0x4210, berth::co::error_register::temperature);  // once, until cleared
    } else {
      device_.errors().clear(0x4210);
    }
  }
  [[nodiscard]] unsigned fan() const { return fan_.get(); }
  bool fan_moved = false;

 private:
  // From a description file instead: `eds::read_file("thermometer.eds").file.description`.
  static std::shared_ptr<const berth::od::Description> dictionary() {
    using berth::od::Access, berth::od::DataType, berth::od::Literal;
    berth::od::DescriptionBuilder b;
    berth::device::add_device(b, {.name = "Thermometer", .heartbeat_ms = 500});
    berth::device::add_storage(b);
    b.variable(0x2000, {.name = "Temperature", .type = DataType::integer16, .access = Access::ro, .mappable = true});
    b.variable(0x2001, {.name = "Limit", .type = DataType::integer16, .initial = Literal::number(800)});
    b.variable(0x2002, {.name = "Fan", .type = DataType::unsigned8, .access = Access::rww, .mappable = true});
    berth::device::add_tpdo(b, 1, {.map = {{{0x2000, 0}, 16}}, .inhibit_100us = 100});  // at most every 10 ms
    berth::device::add_rpdo(b, 1, {.map = {{{0x2002, 0}, 8}}});
    return b.build();
  }

  berth::can::Dispatcher dispatcher_;
  berth::device::SimFlash flash_;
  berth::device::Device device_;
  berth::device::Variable<std::int16_t> temperature_ = device_.variable<std::int16_t>({0x2000, 0});
  berth::device::Variable<std::int16_t> limit_ = device_.variable<std::int16_t>({0x2001, 0});
  berth::device::Variable<std::uint8_t> fan_ = device_.variable<std::uint8_t>({0x2002, 0});
};
