/// A bus, a test's own port on it, and whole devices as a plant has them: what the tests of `device` run on.
#pragma once

#include <algorithm>
#include <chrono>
#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "berth/can/dispatcher.hpp"
#include "berth/device/device.hpp"
#include "berth/sim/world.hpp"

namespace berth::device::test {

using std::chrono::microseconds;
using std::chrono::milliseconds;
using std::chrono::seconds;

inline constexpr LssAddress address_of(std::uint32_t serial) { return {0x01000001, 0x00000001, 0x00000000, serial}; }

/// Records every frame of a bus as candump text.
class Record final : public can::Tap {
 public:
  explicit Record(sim::Bus& bus) : bus_(bus) { bus.add_tap(*this); }
  ~Record() { bus_.remove_tap(*this); }
  void frame(const can::Frame& frame, rt::Time at, int) noexcept override {
    text.push_back(can::to_string(frame));
    times.push_back(at);
  }
  [[nodiscard]] std::size_t count(std::string_view frame) const {
    return static_cast<std::size_t>(std::count(text.begin(), text.end(), frame));
  }
  /// When it was on the bus first; empty: never.
  [[nodiscard]] std::optional<rt::Time> first(std::string_view frame) const {
    const auto it = std::find(text.begin(), text.end(), frame);
    if (it == text.end()) return std::nullopt;
    return times[static_cast<std::size_t>(it - text.begin())];
  }
  void clear() {
    text.clear();
    times.clear();
  }
  std::vector<std::string> text;
  std::vector<rt::Time> times;

 private:
  sim::Bus& bus_;
};

/// One device with its host, controller and memory.
struct Node {
  Node(sim::World& world, sim::Bus& bus, Options options, const Timing& how = {},
       rt::Duration store_time = milliseconds(0),
       std::shared_ptr<const od::Description> description = minimal_description(),
       sim::TxOrder queue = sim::TxOrder::in_order)
      : timing(how),
        flash(world.executor(), memory_size(*description), store_time),
        controller(bus.attach({.queue = queue, .queue_depth = 16, .rx_depth = 16})),
        port(world.executor(), *controller, timing, Random(options.address.serial + 1)),
        dispatcher(world.executor(), port),
        device(dispatcher, std::move(description), &flash, std::move(options), &port, timing) {}
  void off() {
    device.power_off();
    controller->power(false);
  }
  void on() {
    controller->power(true);
    device.power_on();
  }

  Timing timing;
  SimFlash flash;
  std::unique_ptr<sim::Controller> controller;
  TimedPort port;
  can::Dispatcher dispatcher;
  Device device;
};

/// World, bus and a node of the test's own, which acknowledges and sends what the test says.
struct Rig {
  explicit Rig(std::uint32_t bit_rate = 500'000) : bus(world.add_bus("bus", bit_rate)), me(bus.attach()), record(bus) {}
  /// "7E5#0400000000000000": queues it.
  void send(std::string_view frame) { me->send(*can::parse_frame(frame), 0); }
  void run(rt::Duration time) { world.run_for(time); }
  /// Sends and lets the devices answer.
  void ask(std::string_view frame, rt::Duration time = milliseconds(5)) {
    send(frame);
    run(time);
  }
  /// SDO of node 9: writes a value of up to 4 bytes; the answer, or "" when none came.
  std::string write(std::uint16_t index, std::uint8_t sub, unsigned bytes, std::uint32_t value,
                    rt::Duration time = milliseconds(5)) {
    return answer("609#" + hex8(0x23 | (4 - bytes) << 2) + object(index, sub) + le32(value), time);
  }
  std::string read(std::uint16_t index, std::uint8_t sub) {
    return answer("609#40" + object(index, sub) + "00000000", milliseconds(5));
  }
  /// What the answers look like.
  static std::string done(std::uint16_t index, std::uint8_t sub) { return "589#60" + object(index, sub) + "00000000"; }
  static std::string refused(std::uint16_t index, std::uint8_t sub, od::AbortCode code) {
    return "589#80" + object(index, sub) + le32(static_cast<std::uint32_t>(code));
  }
  static std::string value(std::uint16_t index, std::uint8_t sub, unsigned bytes, std::uint32_t v) {
    return "589#" + hex8(0x43 | (4 - bytes) << 2) + object(index, sub) + le32(v);
  }
  static std::string object(std::uint16_t index, std::uint8_t sub) {
    return hex8(index & 255) + hex8(index >> 8) + hex8(sub);
  }
  std::string answer(const std::string& request, rt::Duration time) {
    const auto before = record.text.size();
    ask(request, time);
    std::string found;
    for (auto i = before; i < record.text.size(); ++i) {
      if (record.text[i].starts_with("589#")) found = record.text[i];
    }
    return found;
  }
  /// Selects one device and gives it a node-ID, as a master does; without store and activation.
  void give_id(const LssAddress& a, std::uint8_t id) {
    select(a);
    ask("7E5#11" + hex8(id) + "000000000000");
  }
  void select(const LssAddress& a) {
    ask("7E5#0400000000000000");
    for (unsigned i = 0; i < 4; ++i) ask("7E5#" + hex8(0x40 + i) + le32(a.part(i)) + "000000");
  }
  static std::string hex8(unsigned value) {
    constexpr std::string_view digits = "0123456789ABCDEF";
    return {digits[value >> 4 & 15], digits[value & 15]};
  }
  static std::string le32(std::uint32_t v) {
    return hex8(v & 255) + hex8(v >> 8 & 255) + hex8(v >> 16 & 255) + hex8(v >> 24);
  }

  sim::World world;
  sim::Bus& bus;
  std::unique_ptr<sim::Controller> me;
  Record record;
};

}  // namespace berth::device::test
