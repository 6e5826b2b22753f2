/// A bus with one LSS master and LSS slaves that answer after a latency of their own: what the tests of `lss` run on.
#pragma once

#include <gtest/gtest.h>
#include <chrono>
#include <cstdint>
#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "berth/can/dispatcher.hpp"
#include "berth/lss/answer_queue.hpp"
#include "berth/lss/master.hpp"
#include "berth/lss/slave.hpp"
#include "berth/sim/world.hpp"

namespace berth::lss::test {

using std::chrono::microseconds;
using std::chrono::milliseconds;
using std::chrono::seconds;

/// Records every frame of a bus as candump text.
class Record final : public can::Tap {
 public:
  explicit Record(sim::Bus& bus) : bus_(bus) { bus.add_tap(*this); }
  ~Record() { bus_.remove_tap(*this); }
  void frame(const can::Frame& frame, rt::Time at, int) noexcept override {
    text.push_back(can::to_string(frame));
    times.push_back(at);
  }
  std::vector<std::string> text;
  std::vector<rt::Time> times;

 private:
  sim::Bus& bus_;
};

/// A device that is nothing but an LSS slave.
class Node final : private can::Handler, public SlaveOwner {
 public:
  Node(sim::World& world, sim::Bus& bus, const SlaveOptions& options, Settings stored = {},
       rt::Duration answers_after = milliseconds(1), const sim::ControllerOptions& controller = {})
      : memory(stored),
        latency(answers_after),
        world_(world),
        port_(bus.attach(controller)),
        dispatcher_(world.executor(), *port_),
        queue_(dispatcher_),
        slave(world.executor(), *this, options, stored) {
    dispatcher_.add(can::only(master_cob_id), *this);
    slave.reset_communication();
  }

  Settings memory;  // its non-volatile memory
  rt::Duration latency;
  rt::Duration store_time{0};  // 0: stores at once
  StoreResult store_result{};
  bool deaf_while_storing = false;
  bool boots_at_once = true;  // does what wants_reset_communication asks
  bool dead = false;
  unsigned resets_wanted = 0;
  unsigned stores = 0;
  std::vector<BitRateIndex> switches;
  unsigned silences_over = 0;
  bool repeats = false;                              // sends each answer twice
  std::function<rt::Duration()> own_latency;         // in place of `latency`, drawn for each answer
  std::function<bool(const can::Frame&)> overhears;  // true: it does not hear this request
  std::function<void(const can::Frame&)> hears;      // sees each request that it hears

  std::optional<StoreResult> store(const Settings& settings) noexcept override {
    ++stores;
    if (store_time.count() == 0) {
      if (store_result.code == error::ok) memory = settings;
      return store_result;
    }
    world_.after(store_time, [this, settings] {
      if (store_result.code == error::ok) memory = settings;
      if (const auto frame = slave.stored(store_result)) dispatcher_.send(*frame);
    });
    return std::nullopt;
  }
  void wants_reset_communication() noexcept override {
    ++resets_wanted;
    if (boots_at_once) slave.reset_communication();
  }
  void switch_bit_rate(BitRateIndex index) noexcept override {
    switches.push_back(index);
    port_->restart(*bit_rate(index));
  }
  void silence_over() noexcept override { ++silences_over; }

 private:
  void received(const can::Frame& frame, rt::Time) noexcept override {
    if (dead || (slave.storing() && deaf_while_storing)) return;
    if (overhears && overhears(frame)) return;
    if (hears) hears(frame);
    const auto answers = slave.handle(frame);
    if (!answers) return;
    const auto after = own_latency ? own_latency() : latency;
    world_.after(after, [this, answers] { queue_.send(answers); });
    if (repeats) world_.after(after + milliseconds(1), [this, answers] { queue_.send(answers); });
  }
  sim::World& world_;
  std::unique_ptr<sim::Controller> port_;
  can::Dispatcher dispatcher_;
  AnswerQueue queue_;

 public:
  void say(const can::Frame& frame) { dispatcher_.send(frame); }
  Slave slave;
};

/// The world of one test. `run` drives an operation or a task to its end.
struct World {
  explicit World(std::uint32_t bit_rate = 125'000, std::uint64_t seed = 1)
      : world(seed),
        bus(world.add_bus("bus", bit_rate)),
        port(bus.attach()),
        dispatcher(world.executor(), *port),
        master(std::make_unique<Master>(dispatcher)) {}

  Node& add(const LssAddress& address, Settings stored = {}, rt::Duration latency = milliseconds(1)) {
    nodes.push_back(std::make_unique<Node>(world, bus, SlaveOptions{.address = address}, stored, latency));
    return *nodes.back();
  }
  Node& add_slave(const SlaveOptions& options, rt::Duration latency = milliseconds(1),
                  const sim::ControllerOptions& controller = {}) {
    nodes.push_back(std::make_unique<Node>(world, bus, options, Settings{}, latency, controller));
    return *nodes.back();
  }

  class Done final : public rt::Job {
   public:
    void run() noexcept override { done = true; }
    bool done = false;
  };
  template <class O>
  auto run(O&& operation, rt::Duration limit = seconds(30)) -> decltype(operation.await_resume()) {
    Done done;
    done.done = operation.begin(world.executor(), done);
    if (!world.run_until([&] { return done.done; }, limit)) ADD_FAILURE() << "the operation hangs";
    return operation.await_resume();
  }
  template <class T>
  T run(rt::Task<T> task, rt::Duration limit = seconds(30)) {
    Done done;
    done.done = task.start(world.executor(), done);
    if (!world.run_until([&] { return done.done; }, limit)) ADD_FAILURE() << "the task hangs";
    return task.take();
  }
  void settle(rt::Duration time = milliseconds(50)) { world.run_for(time); }

  sim::World world;
  sim::Bus& bus;
  std::unique_ptr<sim::Controller> port;
  can::Dispatcher dispatcher;
  std::unique_ptr<Master> master;
  std::vector<std::unique_ptr<Node>> nodes;
};

}  // namespace berth::lss::test
