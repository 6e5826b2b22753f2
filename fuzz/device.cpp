// Any frames at a whole device, with pauses between them: it never crashes, and whatever happened to it, after a power
// cycle it boots and answers 1000h.
//
// Input: the first byte chooses the kind of device; then entries of a kind byte and up to 13 bytes: a frame on one of
// the device's identifiers or on any, a pause, power off and on, a cut write.
#include <algorithm>
#include <cstdio>
#include <cstdlib>
#include <string>

#include "berth/device/device.hpp"
#include "berth/sim/world.hpp"

namespace {

using namespace berth;
using std::chrono::microseconds;
using std::chrono::milliseconds;

class Input {
 public:
  Input(const std::uint8_t* data, std::size_t size) : data_(data), size_(size) {}
  [[nodiscard]] bool empty() const { return size_ == 0; }
  std::uint8_t byte() {
    if (size_ == 0) return 0;
    --size_;
    return *data_++;
  }
  std::uint32_t word() {
    std::uint32_t value = 0;
    for (int i = 0; i < 4; ++i) value = value << 8 | byte();
    return value;
  }

 private:
  const std::uint8_t* data_;
  std::size_t size_;
};

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
  device::SimFlash flash(world.executor(), 64, milliseconds(kind & 32U ? 4 : 0));
  device::TimedPort port(world.executor(), *controller, timing, Random(kind));
  can::Dispatcher dispatcher(world.executor(), port);
  device::Options options{.address = {1, 2, 3, 4}, .node_id = NodeId(kind & 64U ? 0xFF : 9), .bit_rate = 500'000};
  options.bus_off_recovery = milliseconds(10);
  device::Device device(dispatcher, device::minimal_description(), &flash, options, &port, timing);
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
          flash.cut_after(in.byte() % 16U, in.byte());
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
