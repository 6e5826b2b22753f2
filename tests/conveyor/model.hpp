/// The coal conveyor as a person would calculate it: ten belts with ramps, coal that lies on them, a chute that blocks.
/// It shares no code with the scripts, the linker or the network; what travels over the bus is a delay here.
#pragma once

#include <array>
#include <deque>
#include <vector>

namespace berth::test {

class CoalModel {
 public:
  static constexpr unsigned belts = 10;
  static constexpr double length = 5.0;           ///< m
  static constexpr double full_speed = 2.5;       ///< m/s
  static constexpr double ramp = 1.0;             ///< m/s in a second
  static constexpr double grab = 200.0;           ///< kg/s onto the first belt while it runs
  static constexpr unsigned blocks = 6;           ///< belt whose chute blocks, from 0
  static constexpr double blocks_after = 2000.0;  ///< kg
  static constexpr double stands = 3.0;           ///< s that the belt must stand until its chute is free
  static constexpr double cleared = 8.0;          ///< s from the blockage until the belt may start again
  /// On average, in s. A controller has a cycle of 100 ms and hears what another told in its next one; a module has one
  /// of 50 ms. An analogue value waits for half its inhibit time of 250 ms on each way; coal goes from a module to its
  /// controller, to the next one and to a module there.
  static constexpr double told = 0.10;
  static constexpr double module = 0.05;
  static constexpr double speed_late = 0.125 + 0.05 + 0.125 + 0.025;
  static constexpr double coal_late = 0.125 + 0.05 + 0.025 + 0.05 + 0.125 + 0.025;

  /// The start button was pressed at time 0; nothing ran before.
  void step() {
    constexpr double dt = step_s;
    time_ += dt;
    for (unsigned k = belts; k-- > 0;) {
      Belt& belt = belts_[k];
      const bool ahead = k + 1 == belts || delayed(belts_[k + 1].running, told);
      if (belt.blocked_since < 0 && belt.blocked) belt.blocked_since = time_;
      bool waits = false;
      if (belt.blocked_since >= 0) {
        waits = belt.blocked || time_ - belt.blocked_since < cleared;
        if (!waits) belt.blocked_since = -1;
      }
      belt.on = ahead && !waits && time_ > told;
      const double wanted = delayed(belt.turns, module) ? full_speed : 0;
      if (belt.speed < wanted) belt.speed = std::min(wanted, belt.speed + ramp * dt);
      if (belt.speed > wanted) belt.speed = std::max(wanted, belt.speed - ramp * dt);
      belt.at_speed.push_front(belt.speed >= full_speed);
      belt.turns.push_front(belt.on);
      belt.running.push_front(belt.on && delayed(belt.at_speed, module));
      if (belt.running.front() && belt.started < 0) belt.started = time_;
      trim(belt);
      belt.stood = belt.speed == 0 ? belt.stood + dt : 0;
      if (belt.blocked && belt.stood > stands) belt.blocked = false;
    }
    for (unsigned k = 0; k < belts; ++k) carry(k);
  }
  [[nodiscard]] double time() const noexcept { return time_; }
  [[nodiscard]] double started(unsigned belt) const noexcept { return belts_[belt].started; }
  [[nodiscard]] bool running(unsigned belt) const noexcept { return belts_[belt].running.front(); }
  [[nodiscard]] double left(unsigned belt) const noexcept { return belts_[belt].left; }
  [[nodiscard]] double blocked_at() const noexcept { return blocked_at_; }
  static constexpr double step_s = 0.01;

 private:
  struct Parcel {
    double kg;
    double way;  ///< of the belt when it came
  };
  struct Belt {
    bool on = false;
    bool blocked = false;
    bool was_blocked = false;
    double blocked_since = -1;
    double speed = 0;
    double way = 0;
    double stood = 0;
    double left = 0;
    double started = -1;
    std::deque<bool> running{false}, at_speed{false}, turns{false};  ///< newest first, for the delays
    std::deque<double> ways{0.0}, lefts{0.0};
    std::deque<Parcel> coal;
  };

  static bool delayed(const std::deque<bool>& history, double by) {
    const auto at = static_cast<std::size_t>(by / step_s);
    return at < history.size() && history[at];
  }
  static double delayed(const std::deque<double>& history, double by) {
    const auto at = static_cast<std::size_t>(by / step_s);
    return at < history.size() ? history[at] : 0.0;
  }
  static void trim(Belt& belt) {
    constexpr std::size_t kept = 200;
    for (auto* each : {&belt.running, &belt.at_speed, &belt.turns}) {
      if (each->size() > kept) each->pop_back();
    }
    for (auto* each : {&belt.ways, &belt.lefts}) {
      if (each->size() > kept) each->pop_back();
    }
  }

  void carry(unsigned k) {
    Belt& belt = belts_[k];
    // The belt's own module hears its speed a while later, and the coal that comes as well.
    belt.way += belt.speed * step_s;
    belt.ways.push_front(belt.way);
    const double way = delayed(belt.ways, speed_late);
    double came = 0;
    if (k == 0) {
      grabbed_ += belt.running.front() ? grab * step_s : 0;
      came = grabbed_;
    } else {
      came = delayed(belts_[k - 1].lefts, coal_late);
    }
    if (came > belt_came_[k]) belt.coal.push_back({came - belt_came_[k], way});
    belt_came_[k] = came;
    while (!belt.blocked && !belt.coal.empty() && way - belt.coal.front().way >= length) {
      belt.left += belt.coal.front().kg;
      belt.coal.pop_front();
      if (k == blocks && !belt.was_blocked && belt.left >= blocks_after) {
        belt.blocked = belt.was_blocked = true;
        blocked_at_ = time_;
      }
    }
    belt.lefts.push_front(belt.left);
  }

  double time_ = 0;
  double grabbed_ = 0;
  double blocked_at_ = -1;
  std::array<Belt, belts> belts_{};
  std::array<double, belts> belt_came_{};
};

}  // namespace berth::test
