/// A bus with a master's services and slaves with a slow host each: what the tests of `discovery` run on.
#pragma once

#include <gtest/gtest.h>
#include <chrono>
#include <cstdint>
#include <optional>

#include <algorithm>
#include <functional>
#include <map>
#include <memory>
#include <string>
#include <vector>

#include "berth/base/random.hpp"
#include "berth/can/dispatcher.hpp"
#include "berth/device/lss_habits.hpp"
#include "berth/device/timed_port.hpp"
#include "berth/discovery/auto.hpp"
#include "berth/lss/answer_queue.hpp"
#include "berth/lss/master.hpp"
#include "berth/lss/slave.hpp"
#include "berth/nodeid/rand_slave.hpp"
#include "berth/sim/world.hpp"

namespace berth::discovery::test {

using namespace std::chrono_literals;

struct NodeOptions {
  LssAddress address{};
  bool fastscan = true;
  lss::Feedback feedback = lss::Feedback::none;
  bool lss = true;
  bool rand = false;
  NodeId node_id{};  // it has one
  device::LssHabit habit = device::LssHabit::none;
  device::Timing timing{.response_min = 200us, .response_max = 2ms};
};

/// A device that is nothing but an LSS and a RAND slave behind a slow host.
class Node final : private can::Handler, private lss::SlaveOwner {
 public:
  Node(sim::World& world, sim::Bus& bus, const NodeOptions& how, Random random)
      : options(how),
        world_(world),
        timing_(how.timing),
        controller_(bus.attach({.queue_depth = 16})),
        port_(world.executor(), *controller_, timing_, random),
        dispatcher_(world.executor(), port_),
        queue_(dispatcher_),
        habits_(how.habit, world.executor(), queue_, how.habit == device::LssHabit::none ? 0 : random.next()),
        slave(world.executor(), *this, {.address = how.address, .fastscan = how.fastscan, .feedback = how.feedback},
              {.node_id = how.node_id}),
        rand({.address = how.address}) {
    if (how.lss) dispatcher_.add(can::only(lss::master_cob_id), *this);
    if (how.rand) dispatcher_.add(nodeid::rand_requests, *this);
    slave.reset_communication();
  }
  /// Power off and on: it has forgotten everything that was not stored.
  void restart() {
    slave.power_on(slave.persistent());
    rand.power_on();
  }
  void power(bool on) {
    dead = !on;
    controller_->power(on);
  }
  [[nodiscard]] NodeId id() const { return slave.active().node_id; }

  const NodeOptions options;
  bool dead = false;
  unsigned resets = 0;
  std::function<bool(const can::Frame&)> overhears;  // true: this request is lost
  std::function<bool(const can::Frame&)> swallows;   // true: this answer is lost
  std::function<void()> after_reset;

 private:
  void received(const can::Frame& frame, rt::Time) noexcept override {
    if (dead || (overhears && overhears(frame))) return;
    if (frame.extended) {
      const auto answer = rand.handle(frame, false);
      if (answer) dispatcher_.send(*answer);
      return;
    }
    const bool strict = options.habit == device::LssHabit::none;
    const auto answers = strict ? slave.handle(frame) : habits_.handle(frame, slave);
    if (answers && swallows && swallows(frame)) return;
    queue_.send(answers);
  }
  std::optional<lss::StoreResult> store(const lss::Settings&) noexcept override { return lss::StoreResult{}; }
  void wants_reset_communication() noexcept override {
    if (habits_.boots_by_nmt()) return;
    ++resets;
    slave.reset_communication();
    if (after_reset) after_reset();
  }
  void switch_bit_rate(lss::BitRateIndex) noexcept override {}
  void silence_over() noexcept override {}

  sim::World& world_;
  device::Timing timing_;
  std::unique_ptr<sim::Controller> controller_;
  device::TimedPort port_;
  can::Dispatcher dispatcher_;
  lss::AnswerQueue queue_;
  device::LssHabits habits_;

 public:
  lss::Slave slave;
  nodeid::RandSlave rand;
};

/// Gives node-IDs 1, 2, ... in the order of finding, except to whom it refuses.
struct Giver final : Assigner {
  NodeId assign(const LssAddress& device, bool) noexcept override {
    asked.push_back(device);
    if (refuses && refuses(device)) return {};
    return given[device] = NodeId(next++);
  }
  std::uint8_t next = 1;
  std::vector<LssAddress> asked;
  std::map<LssAddress, NodeId> given;
  std::function<bool(const LssAddress&)> refuses;
};

/// Every frame of the bus.
class Record final : public can::Tap {
 public:
  explicit Record(sim::Bus& bus) : bus_(bus) { bus.add_tap(*this); }
  ~Record() { bus_.remove_tap(*this); }
  void frame(const can::Frame& frame, rt::Time at, int) noexcept override {
    frames.push_back(frame);
    times.push_back(at);
    if (on_frame) on_frame(frame);
  }
  std::vector<can::Frame> frames;
  std::vector<rt::Time> times;
  std::function<void(const can::Frame&)> on_frame;

 private:
  sim::Bus& bus_;
};

struct World {
  explicit World(std::uint64_t seed = 1, std::uint32_t bit_rate = 125'000)
      : random(seed),
        world(seed),
        bus(world.add_bus("bus", bit_rate)),
        witness(bus.attach()),
        port(bus.attach()),
        dispatcher(world.executor(), *port),
        lss(dispatcher) {}

  Node& add(const NodeOptions& how) {
    nodes.push_back(std::make_unique<Node>(world, bus, how, random.fork()));
    return *nodes.back();
  }
  class Done final : public rt::Job {
   public:
    void run() noexcept override { done = true; }
    bool done = false;
  };
  template <class T>
  T run(rt::Task<T> task, rt::Duration limit = 600s) {
    Done done;
    done.done = task.start(world.executor(), done);
    if (!world.run_until([&] { return done.done; }, limit)) ADD_FAILURE() << "the task hangs";
    return task.take();
  }
  /// One method's search on this bus.
  Result<Report> find(Method method) {
    const auto discovery = make(method, services());
    return run(discovery->find(known, options));
  }
  [[nodiscard]] Services services() { return {dispatcher, lss}; }
  /// Nobody may share a node-ID, and who has one was given it under its own address.
  void expect_right(const Giver& giver) const {
    std::map<unsigned, unsigned> users;
    for (const auto& n : nodes) {
      if (!n->id().configured() || n->options.node_id.configured()) continue;
      EXPECT_EQ(++users[n->id().value()], 1U) << "two devices with node-ID " << unsigned{n->id().value()};
      const auto it = giver.given.find(n->options.address);
      ASSERT_NE(it, giver.given.end()) << to_string(n->options.address);
      EXPECT_EQ(it->second, n->id()) << to_string(n->options.address);
    }
  }

  Random random;
  sim::World world;
  sim::Bus& bus;
  std::unique_ptr<sim::Controller> witness;  // so that a lone master's frames are acknowledged
  std::unique_ptr<sim::Controller> port;
  can::Dispatcher dispatcher;
  lss::Master lss;
  Known known;
  Options options;
  std::vector<std::unique_ptr<Node>> nodes;
};

inline std::vector<LssAddress> addresses(const Report& report) {
  std::vector<LssAddress> list;
  for (const auto& d : report.found) list.push_back(d.address);
  std::ranges::sort(list);
  return list;
}
inline std::vector<LssAddress> addresses(const World& w) {
  std::vector<LssAddress> list;
  for (const auto& n : w.nodes) list.push_back(n->options.address);
  std::ranges::sort(list);
  return list;
}

}  // namespace berth::discovery::test
