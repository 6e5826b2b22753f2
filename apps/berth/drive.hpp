/// Runs the main job of a machine run until it is to end.
#pragma once

#include <map>
#include <string>

#include "interrupt.hpp"
#include "machine_run.hpp"
#include "screen.hpp"

namespace berth::cli {

/// When a run is over. Watches the session's events and the plant's plan.
class Ending {
 public:
  Ending(MachineRun& run, std::string until);
  void event(const operate::Event& event);
  void milestone(operate::Milestone milestone);
  /// What `--until` names was reached.
  [[nodiscard]] bool reached();
  /// It never will be: other masters are on every bus.
  [[nodiscard]] bool hopeless();
  /// Nothing has changed for a while, nothing is under way, and nothing is planned any more.
  [[nodiscard]] bool settled();
  /// Bus time after which a run that does not settle is given up.
  [[nodiscard]] rt::Duration limit() const noexcept { return limit_; }

 private:
  using Slots = std::vector<operate::Network::Occupancy>;  // of one bus
  void plan_behind(plant::After after);
  [[nodiscard]] bool plan_over() const;
  [[nodiscard]] bool replaced() const;
  MachineRun* run_;
  std::string until_;
  rt::Time changed_{};                // when a slot's state or device changed last
  std::map<std::string, Slots> now_;  // by bus
  bool look_ = true;  // an event came since `reached` looked: nothing else can change its answer, but the plan's end
  rt::Time due_{};    // of the last planned event known
  rt::Duration quiet_{};     // how long nothing may change
  rt::Duration patience_{};  // the same while the machine is not operational
  // Since `since_` Berth has had nothing to do for so long: a search may take longer than the patience.
  rt::Time since_{};
  rt::Time looked_{};
  rt::Duration idle_{};
  rt::Duration limit_{};
  std::map<std::string, Slots> first_;  // which device sat in each slot when all were operational first, by bus
};

enum class Ended : std::uint8_t { reached, settled, timeout, interrupted };
/// Runs the session of a machine run. In real time beside a control socket at `control` (empty: none), and it ends by `--until` or
/// a signal; in simulated time it also ends when it is settled.
[[nodiscard]] tl::expected<Ended, Failure> drive(MachineRun& run, Ending& ending, Screen& screen,
                                                 const Options& options, const std::string& control);
/// Studio's server for a run whose main job does not run, until a signal comes; it prints its address and the events.
[[nodiscard]] tl::expected<void, Failure> serve_bench(MachineRun& run, const Options& options);

}  // namespace berth::cli
