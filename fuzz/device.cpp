// Any frames at a whole device, with pauses between them: it never crashes, and whatever happened to it, after a power
// cycle it boots and answers 1000h.
//
// Input: the first byte chooses the kind of device, its bit 7 one with PDOs, SYNC, TIME and stored parameters; then
// entries of a kind byte and up to 13 bytes: a frame on one of the device's identifiers or on any, a pause, power off
// and on, a cut write, the application's doings.
#include <algorithm>
#include <cstdio>
#include <cstdlib>
#include <string>

#include "berth/device/device.hpp"
#include "berth/sim/world.hpp"
#include "fuzz/bench_port.hpp"

namespace device_target {

namespace {

using namespace berth;
using fuzz::Input;
using std::chrono::microseconds;
using std::chrono::milliseconds;

class Ear final : public can::Listener {
 public:
  Ear(std::uint32_t id, std::uint8_t byte0) : id_(id), byte0_(byte0) {}
  void received(const can::Frame& frame, rt::Time) noexcept override {
    heard |= frame.key() == id_ && frame.data[0] == byte0_;
  }
  void sent(std::uint32_t, rt::Time) noexcept override {}
  void changed(const can::Status&, rt::Time) noexcept override {}
  bool heard = false;

 private:
  std::uint32_t id_;
  std::uint8_t byte0_;
};

/// Every service. Without 1006h, so that no input makes it flood the bus with SYNCs.
std::shared_ptr<const od::Description> everything() {
  using od::DataType;
  using od::Literal;
  od::DescriptionBuilder b;
  device::add_device(b);
  device::add_storage(b);
  b.variable(0x1005, {.initial = Literal::number(0x80)});
  b.variable(0x1007, {.initial = Literal::number(0)});
  b.variable(0x1012, {.initial = Literal::number(0x8000'0100)});
  b.variable(0x1013, {.mappable = true});
  b.variable(0x1019, {.type = DataType::unsigned8});
  b.object(0x1028, od::ObjectCode::array, "Emergency consumer");
  for (std::uint8_t i = 1; i <= 3; ++i) b.sub(0x1028, {.sub = i, .initial = Literal::number(0x80U + i)});
  b.variable(0x2000, {.type = DataType::unsigned32, .mappable = true});
  b.variable(0x2001, {.type = DataType::boolean, .access = od::Access::rww, .mappable = true});
  b.variable(0x2002, {.type = DataType::visible_string, .capacity = 300});
  b.variable(0x2003,
             {.type = DataType::unsigned24, .mappable = true, .low = Literal::number(3), .high = Literal::number(9)});
  b.dummies(0xFE);
  for (unsigned n = 1; n <= 3; ++n) {
    device::add_tpdo(
        b, n, {.map = {{{0x2000, 0}, 32}, {{0x2001, 0}, 1}}, .type = static_cast<std::uint8_t>(n == 3 ? 1 : 0xFF)});
    device::add_rpdo(
        b, n, {.map = {{{0x2001, 0}, 1}, {{0x2003, 0}, 24}}, .type = static_cast<std::uint8_t>(n == 3 ? 1 : 0xFF)});
  }
  for (const std::uint16_t list : {std::uint16_t{0x1FA0}, std::uint16_t{0x1FD0}}) {
    b.object(list, od::ObjectCode::array, "MPDO list");
    for (std::uint8_t i = 1; i <= 2; ++i) {
      b.sub(list, {.sub = i, .type = list == 0x1FA0 ? DataType::unsigned32 : DataType::unsigned64});
    }
  }
  return b.build();
}

/// A frame on an identifier of PDO, SYNC, TIME or EMCY.
std::uint32_t service_id(std::uint8_t which, std::uint32_t node) {
  switch (which & 15U) {
    case 0: return 0x080;
    case 1: return 0x100;
    case 2: return 0x081;
    case 3: return 0x080 + node;
    default: return 0x180 + 0x80 * (which & 7U) + node;
  }
}

can::Frame frame_of(Input& in, std::uint8_t kind, std::uint32_t node) {
  can::Frame f;
  switch (kind & 7U) {
    case 0: f.id = 0x000; break;
    case 1:
    case 2: f.id = 0x600 + node; break;
    case 3:
    case 4: f.id = 0x7E5; break;
    case 5:
      f.id = 0x1F940000;
      f.extended = true;
      break;
    case 6:
      f.id = 0x700 + node;
      f.remote = (kind & 0x40U) != 0;
      break;
    default:
      f.extended = (kind & 0x20U) != 0;
      f.remote = (kind & 0x40U) != 0;
      f.id = in.word() & (f.extended ? can::extended_mask : can::base_mask);
  }
  const auto length = in.byte();
  f.size = (length & 0x10U) != 0 ? length % 9 : 8;  // mostly 8 bytes
  if ((kind & 7U) == 0 && (length & 0x20U) == 0) f.size = 2;
  if ((kind & 7U) == 5 && (length & 0x20U) == 0) f.size = 4;
  if (!f.remote) {
    for (unsigned i = 0; i < f.size; ++i) f.data[i] = in.byte();
  }
  return f;
}

[[noreturn]] void broken(const char* what) {
  std::fprintf(stderr, "fuzz device: %s\n", what);
  std::abort();
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  Input in(data, size);
  const auto kind = in.byte();
  sim::World world(1);
  sim::Bus& bus = world.add_bus("bus", 500'000);
  auto me = bus.attach();
  auto controller = bus.attach();
  const device::Timing timing{.response_min = microseconds(kind & 1U ? 200 : 0),
                              .response_max = microseconds(kind & 1U ? 900 : 0),
                              .rx_depth = static_cast<std::uint16_t>(kind & 2U ? 1 : 4),
                              .reset = milliseconds(kind & 4U ? 3 : 0),
                              .deaf_while_storing = (kind & 8U) != 0,
                              .power_cycle_after_store = (kind & 16U) != 0};
  const bool full = (kind & 128U) != 0;
  static const auto whole = everything();
  const auto& description = full ? whole : device::minimal_description();
  device::SimFlash flash(world.executor(), device::memory_size(*description), milliseconds(kind & 32U ? 4 : 0));
  device::TimedPort port(world.executor(), *controller, timing, Random(kind));
  can::Dispatcher dispatcher(world.executor(), port);
  device::Options options{.address = {1, 2, 3, 4}, .node_id = NodeId(kind & 64U ? 0xFF : 9), .bit_rate = 500'000};
  options.bus_off_recovery = milliseconds(10);
  device::Device device(dispatcher, description, &flash, options, &port, timing);
  device.power_on();
  world.run_for(milliseconds(1));

  while (!in.empty()) {
    const auto what = in.byte();
    const auto node = device.node_id().configured() ? device.node_id().value() : 9U;
    switch (what >> 3U & 3U) {
      case 0:
      case 1: me->send(frame_of(in, what, node), 0); break;
      case 2: world.run_for(microseconds(50) * in.byte()); break;
      default:
        if ((what & 7U) == 0) {
          device.power_off();
          controller->power(false);
          world.run_for(milliseconds(1));
          controller->power(true);
          device.power_on();
        } else if ((what & 7U) == 1) {
          flash.cut_after(in.byte() % (full ? 128U : 16U), in.byte());
        } else if (full && (what & 7U) == 2) {
          const auto doing = in.byte();
          device.variable<std::uint32_t>({0x2000, 0}).set(doing);
          device.services().event(doing & 3U);
          if ((doing & 4U) != 0) device.errors().raise(static_cast<std::uint16_t>(0xFF00U + doing), 0x80);
          if ((doing & 8U) != 0) device.errors().clear(static_cast<std::uint16_t>(0xFF00U + doing - 8U));
          device.errors().behave(doing >> 6U);
        } else if (full && (what & 7U) == 3) {
          auto frame = can::Frame::base(service_id(in.byte(), node), {0, 0, 0, 0, 0, 0, 0, 0});
          frame.size = in.byte() % 9;
          for (unsigned i = 0; i < frame.size; ++i) frame.data[i] = in.byte();
          me->send(frame, 0);
        } else {
          me->send(frame_of(in, what, node), 0);
          world.run_for(milliseconds(2));
        }
    }
  }

  // Whatever was stored, a device of any node-ID and bit rate must start from it and answer.
  flash.never_cut();
  device.power_off();
  controller->power(false);
  me->restart(controller->bit_rate());  // forgets what it could not send meanwhile
  world.run_for(milliseconds(20));
  controller->power(true);
  device.power_on();
  world.run_for(milliseconds(1));
  if (me->bit_rate() != controller->bit_rate()) me->restart(controller->bit_rate());
  world.run_for(milliseconds(50));
  const auto id = device.node_id();
  if (id.configured() && device.state() != NmtState::pre_operational) broken("has a node-ID and did not boot");
  Ear ear(id.configured() ? 0x580U + id.value() : 0x7E4U, id.configured() ? 0x43 : 0x50);
  const can::IdRange all[]{can::all_base};
  me->listen(&ear, all);
  if (id.configured()) {
    me->send(can::Frame::base(0x600U + id.value(), {0x40, 0, 0x10, 0, 0, 0, 0, 0}), 0);
  } else {
    me->send(can::Frame::base(0x7E5, {0x4C, 0, 0, 0, 0, 0, 0, 0}), 0);
  }
  world.run_for(milliseconds(50));
  if (!ear.heard) broken(id.configured() ? "does not answer 1000h" : "unconfigured, and does not say so");
  me->listen(nullptr, {});
  return 0;
}

}  // namespace device_target
