/// A simulated machine of sensors on one bus, each with one published value, and what its reporter says of it: what an
/// edge node gets from a real machine.
#pragma once

#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "berth/fleet/reporter.hpp"
#include "berth/places/slot_store.hpp"
#include "berth/plant/world.hpp"
#include "berth/tree/session.hpp"

namespace berth::bench {

/// The executor's time, as if the world had begun in 2026.
class WorldClock final : public fleet::Clock {
 public:
  explicit WorldClock(rt::Executor& executor) : executor_(&executor) {}
  [[nodiscard]] sparkplug::Now now() const noexcept override;

 private:
  rt::Executor* executor_;
};

class Line : private can::Tap {
 public:
  static constexpr const char* signal = "Signals/Position value";  ///< of each device

  /// 1 to 127 slots, "sensor 1" to "sensor 127"; the bus runs at 500 kbit/s. Ends the program when it cannot be made.
  explicit Line(unsigned slots);
  ~Line();
  Line(const Line&) = delete;
  Line& operator=(const Line&) = delete;

  [[nodiscard]] const design::Machine& machine() const noexcept { return machine_; }
  [[nodiscard]] bool operational() const { return session_->operational(); }
  /// Turns the world.
  void run(rt::Duration time) { world_->sim().run_for(time); }
  /// The encoders turn: each device sends its PDO.
  void set_positions(std::uint32_t value);
  /// What the reporter has said and nobody has taken; empty: nothing.
  [[nodiscard]] std::optional<fleet::News> take() { return link_.news.take(); }
  [[nodiscard]] fleet::Reporter& reporter() noexcept { return *reporter_; }
  [[nodiscard]] const fleet::Clock& clock() const noexcept { return *clock_; }
  /// On the bus, since the beginning.
  [[nodiscard]] std::uint64_t frames() const noexcept { return frames_; }

 private:
  void frame(const can::Frame& frame, rt::Time at, int) noexcept override {
    ++frames_;
    table_->frame(0, frame, at);
  }
  void error(const can::BusError&, rt::Time) noexcept override {}

  unsigned slots_;
  std::uint64_t frames_ = 0;
  design::Machine machine_;
  places::MemoryStore store_;
  std::unique_ptr<plant::World> world_;
  std::unique_ptr<sim::Controller> port_;
  std::unique_ptr<tree::Session> session_;
  std::unique_ptr<WorldClock> clock_;
  fleet::Link link_;
  std::vector<fleet::Signal> signals_;
  std::unique_ptr<fleet::SignalTable> table_;
  std::unique_ptr<fleet::Reporter> reporter_;
};

/// A machine that begins to publish and is operational.
struct FirstWords {
  design::Machine machine;
  std::vector<fleet::News> news;  ///< what it says: itself, then each device
};
[[nodiscard]] FirstWords first_words(unsigned slots);

}  // namespace berth::bench
