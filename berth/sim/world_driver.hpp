/// Drives a simulated world as fast as it can be computed, instant by instant.
#pragma once

#include "berth/rt/driver.hpp"
#include "berth/sim/world.hpp"

namespace berth::sim {

class WorldDriver final : public rt::Driver {
 public:
  /// The world must stay.
  explicit WorldDriver(World& world) noexcept : Driver(world.executor()), world_(&world) {}

  /// Calls `over` after each instant. If it stays false, the world is at `end`.
  bool run_until(const Predicate& over, rt::Time end) override { return world_->run_until(over, end - now()); }

 private:
  World* world_;
};

}  // namespace berth::sim
