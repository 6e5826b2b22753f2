/// A simulated world: its time, its buses, its one seed. Two worlds with one seed and the same use are identical to the
/// bit; `trace_hash` shows this.
///
///     sim::World world(42);
///     sim::Bus& bus = world.add_bus("backbone", 50'000);
///     auto port = bus.attach({.name = "master"});       // a can::Port; destroy it before the world
///     can::Dispatcher dispatcher(world.executor(), *port);
///     world.run_for(10ms);
#pragma once

#include <cstdint>
#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "berth/base/random.hpp"
#include "berth/rt/executor.hpp"
#include "berth/sim/bus.hpp"
#include "berth/sim/controller.hpp"

namespace berth::sim {

class World {
 public:
  explicit World(std::uint64_t seed = 1);
  ~World();
  World(const World&) = delete;
  World& operator=(const World&) = delete;

  /// `bit_rate` in bit/s. The bus exists as long as the world. With a `data_bit_rate` it is an FD bus.
  Bus& add_bus(std::string name, std::uint32_t bit_rate, std::uint32_t data_bit_rate = 0);
  /// Null when there is none of that name.
  [[nodiscard]] Bus* find_bus(std::string_view name) noexcept;
  [[nodiscard]] const std::vector<std::unique_ptr<Bus>>& buses() const noexcept { return buses_; }

  [[nodiscard]] rt::Executor& executor() noexcept { return executor_; }
  [[nodiscard]] rt::Time now() const noexcept { return executor_.now(); }
  [[nodiscard]] std::uint64_t seed() const noexcept { return seed_; }
  /// Draws advance one common sequence: fork one per device if its use may vary.
  [[nodiscard]] Random& random() noexcept { return random_; }

  // As fast as possible. Never from inside a job.
  void run_until(rt::Time until) noexcept { executor_.advance(until); }
  void run_for(rt::Duration duration) noexcept { executor_.advance(executor_.now() + duration); }
  /// Runs instant by instant until `done()` is true, checked after each instant, or for at most `limit` from now; true
  /// when it is done. Otherwise `now()` is at the limit.
  template <class Predicate>
  bool run_until(Predicate done, rt::Duration limit) {
    const rt::Time end = executor_.now() + limit;
    while (!done()) {
      if (executor_.step(end)) continue;
      executor_.advance(end);
      return done();
    }
    return true;
  }
  /// Runs while `go_on()` is true, at most `limit` from now; true when it became false.
  template <class Predicate>
  bool run_while(Predicate go_on, rt::Duration limit) {
    return run_until([&] { return !go_on(); }, limit);
  }

  // One instant after another; `io::LoopDriver` on the executor paces a world to real time.
  /// The earliest instant with work; empty when there is none.
  [[nodiscard]] std::optional<rt::Time> next() const noexcept { return executor_.next(); }
  /// Runs the work of one instant, the earliest, if it is not after `until`.
  bool step(rt::Time until) noexcept { return executor_.step(until); }

  /// Calls `action` once at `when`, in a job of its own. For plans of tests and plants, not for processing frames.
  void at(rt::Time when, std::function<void()> action);
  void after(rt::Duration delay, std::function<void()> action) { at(now() + delay, std::move(action)); }

  /// Hash of every good frame on every bus so far: bus, content, sender, time.
  [[nodiscard]] std::uint64_t trace_hash() const noexcept { return hash_; }

 private:
  friend class Bus;
  class Action;
  void mix(std::uint64_t word) noexcept {
    hash_ = (hash_ ^ word) * 0x9E37'79B9'7F4A'7C15ULL;
    hash_ ^= hash_ >> 29;
  }
  /// Adds what an FD frame has beyond a classic one.
  [[gnu::cold]] void mix_fd(const can::Frame& frame) noexcept;

  rt::Executor executor_;
  std::uint64_t seed_;
  Random random_;
  std::uint64_t hash_ = 0;
  Action* actions_ = nullptr;  // list of the waiting ones
  std::vector<std::unique_ptr<Bus>> buses_;
};

}  // namespace berth::sim
