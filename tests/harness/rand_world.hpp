/// A bus with one RAND master and RAND slaves that answer after a latency of their own, for the tests of `nodeid`.
#pragma once

#include <gtest/gtest.h>
#include <chrono>
#include <cstdint>
#include <functional>
#include <memory>
#include <string>
#include <vector>

#include "berth/base/random.hpp"
#include "berth/can/dispatcher.hpp"
#include "berth/nodeid/rand_master.hpp"
#include "berth/nodeid/rand_slave.hpp"
#include "berth/sim/world.hpp"

namespace berth::nodeid::test {

using std::chrono::microseconds;
using std::chrono::milliseconds;
using std::chrono::nanoseconds;
using std::chrono::seconds;

/// Records every frame of a bus as candump text.
class Record final : public can::Tap {
 public:
  explicit Record(sim::Bus& bus) : bus_(bus) { bus.add_tap(*this); }
  ~Record() { bus_.remove_tap(*this); }
  void frame(const can::Frame& frame, rt::Time, int) noexcept override { text.push_back(can::to_string(frame)); }
  std::vector<std::string> text;

 private:
  sim::Bus& bus_;
};

/// A device with only a RAND slave.
class Node final : private can::Handler {
 public:
  Node(sim::World& world, sim::Bus& bus, const RandSlaveOptions& options, std::function<rt::Duration()> latency)
      : slave(options),
        port(bus.attach({.queue_depth = 16})),
        world_(world),
        latency_(std::move(latency)),
        dispatcher_(world.executor(), *port) {
    dispatcher_.add(rand_requests, *this);
  }

  RandSlave slave;
  std::unique_ptr<sim::Controller> port;
  bool in_lss_configuration = false;
  bool forgets = false;  // never becomes identified: a broken device
  int mute_at = -1;      // does not answer this phase (8: DIRS) ...
  int mute_times = 0;    // ... this many times
  int dies_at = -1;      // loses power when this phase comes
  bool dead = false;
  unsigned heard = 0;

 private:
  void received(const can::Frame& frame, rt::Time) noexcept override {
    if (dead) return;
    ++heard;
    const int phase = frame.data[0] == 0x80 ? frame.data[1] : -1;
    if (phase >= 0 && phase == dies_at) {
      dead = true;
      port->power(false);
      return;
    }
    const auto answer = slave.handle(frame, in_lss_configuration);
    if (forgets && slave.state() == Identification::identified) slave.power_on();
    if (!answer) return;
    if (phase == mute_at && mute_times > 0) {
      --mute_times;
      return;
    }
    world_.after(latency_(), [this, f = *answer] {
      if (!dead) dispatcher_.send(f);
    });
  }
  sim::World& world_;
  std::function<rt::Duration()> latency_;
  can::Dispatcher dispatcher_;
};

/// Records the events for an observer.
struct Watch final : DiscoveryObserver {
  struct Step {
    PhaseEvent::Kind kind;
    unsigned phase;
    std::uint16_t mask;
    std::vector<std::uint16_t> chunks;
    bool answered;
    std::uint16_t chosen;
    friend bool operator==(const Step&, const Step&) = default;
  };
  void phase(const PhaseEvent& e) noexcept override {
    std::vector<std::uint16_t> chunks;
    for (const auto& h : e.heard) chunks.push_back(h.chunk);
    steps.push_back({e.kind, e.phase, e.mask, chunks, e.answered, e.chosen});
    windows.push_back(e.ended - e.sent);
    if (on_phase) on_phase();
  }
  void found(const Discovered& device) noexcept override { devices.push_back(device); }
  void restarted(unsigned phase, rt::Time) noexcept override { restarts.push_back(phase); }
  std::vector<Step> steps;
  std::vector<rt::Duration> windows;
  std::vector<Discovered> devices;
  std::vector<unsigned> restarts;
  std::function<void()> on_phase;
};

struct World {
  explicit World(std::uint32_t bit_rate = 250'000, std::uint64_t seed = 1)
      : world(seed),
        bus(world.add_bus("bus", bit_rate)),
        port(bus.attach()),
        dispatcher(world.executor(), *port),
        master(dispatcher) {}

  Node& add(const LssAddress& address, std::function<rt::Duration()> latency) {
    nodes.push_back(std::make_unique<Node>(world, bus, RandSlaveOptions{.address = address}, std::move(latency)));
    return *nodes.back();
  }
  Node& add(const LssAddress& address, rt::Duration latency = milliseconds(1)) {
    return add(address, [latency] { return latency; });
  }

  class Done final : public rt::Job {
   public:
    void run() noexcept override { done = true; }
    bool done = false;
  };
  template <class T>
  T run(rt::Task<T> task, rt::Duration limit = seconds(600)) {
    Done done;
    done.done = task.start(world.executor(), done);
    if (!world.run_until([&] { return done.done; }, limit)) ADD_FAILURE() << "the task hangs";
    return task.take();
  }
  Result<DiscoveryReport> discover(DiscoveryObserver* observer = nullptr) {
    return run(master.discover(options, observer));
  }
  /// A node that only acknowledges the frames of a lone master.
  void add_witness() { witness = bus.attach(); }

  sim::World world;
  sim::Bus& bus;
  std::unique_ptr<sim::Controller> port;
  std::unique_ptr<sim::Controller> witness;
  can::Dispatcher dispatcher;
  RandMaster master;
  DiscoveryOptions options;
  std::vector<std::unique_ptr<Node>> nodes;
};

inline std::vector<LssAddress> addresses(const DiscoveryReport& report) {
  std::vector<LssAddress> list;
  for (const auto& d : report.found) list.push_back(d.address);
  return list;
}

}  // namespace berth::nodeid::test
