/// A stage for a procedure on a simulated bus: the devices, one master, and a recorder.
///
///     Stage stage(plant_of({.devices = 30, .bit_rate = 50'000, .speaks = {Speaks::rand}}), 50'000);
///     stage.settle();                                   // booted, and quiet
///     stage.record();
///     auto task = procedure(stage.master());
///     const bool ended = stage.run(std::move(task), 10min);
///     stage.trace();                                    // what was on the bus since `record`
#pragma once

#include <cstdint>
#include <memory>
#include <string_view>

#include "berth/can/dispatcher.hpp"
#include "berth/plant/world.hpp"
#include "berth/rt/scope.hpp"
#include "berth/trace/trace.hpp"

namespace berth::study {

/// The one bus of every stage, named so that can-utils can play its traces.
inline constexpr std::string_view bus_name = "can0";

/// The kind of serial numbers of the devices.
enum class Serials : std::uint8_t {
  consecutive,  ///< one type, 1, 2, 3, ...
  random,       ///< one type, any 32 bits
  mixed,        ///< five types of three vendors in two revisions each, any 32 bits
};
[[nodiscard]] const char* name(Serials serials) noexcept;

/// The devices of a stage.
struct Cast {
  unsigned devices = 1;  ///< 1..127 when `configured`
  Serials serials = Serials::consecutive;
  plant::SpeaksSet speaks{plant::Speaks::lss};
  plant::Latency response{};
  bool configured = false;  ///< with node-IDs 1, 2, ..., hard-coded
  std::uint64_t seed = 1;   ///< of the serial numbers and of the world
};
/// Devices with distinct LSS addresses, "d1", "d2", ...; boot 50 ms, reset and store 5 ms.
[[nodiscard]] plant::PlantFile plant_of(const Cast& cast);

class Stage final : private can::Tap {
 public:
  /// `plant` must be from `plant_of` or similar: every device on `bus_name`. `bit_rate` in bit/s. A plant that cannot
  /// be made is a programming error and ends the program.
  Stage(const plant::PlantFile& plant, std::uint32_t bit_rate);
  ~Stage();
  Stage(const Stage&) = delete;
  Stage& operator=(const Stage&) = delete;

  [[nodiscard]] plant::World& world() noexcept { return *world_; }
  [[nodiscard]] sim::Bus& bus() noexcept { return *bus_; }
  [[nodiscard]] can::Dispatcher& master() noexcept { return dispatcher_; }
  [[nodiscard]] std::uint32_t bit_rate() const noexcept { return bus_->bit_rate(); }
  [[nodiscard]] rt::Time now() noexcept { return world_->sim().now(); }

  /// Waits until everything has booted and is quiet.
  void settle(rt::Duration time = std::chrono::seconds(1)) { world_->sim().run_for(time); }
  /// From now on frames are kept.
  void record() noexcept { recording_ = true; }
  /// Sends the master's heartbeat as the mark at the begin or end of a measured job, when the bus is free; returns
  /// after it is on the wire.
  void mark();
  /// Runs a task to its end; false if it takes longer than `limit` in the world: the task is then destroyed.
  bool run(rt::Task<void> task, rt::Duration limit);
  /// Runs until the bus was silent for `quiet`, at most for `limit`.
  void run_until_quiet(rt::Duration quiet, rt::Duration limit);

  [[nodiscard]] const trace::Trace& trace() const noexcept { return trace_; }
  /// Drops frames kept after the last boot-up message.
  void crop_after_boot_up();
  /// From the end of the first kept frame to the end of the last: the span that `berth trace --stats` prints.
  [[nodiscard]] rt::Duration span() const noexcept;
  /// When the last frame ended, kept or not.
  [[nodiscard]] rt::Time last_frame() const noexcept { return last_; }
  /// Devices with a node-ID in use that no other device has.
  [[nodiscard]] unsigned bound() const;

 private:
  void frame(const can::Frame& frame, rt::Time at, int sender) noexcept override;

  std::unique_ptr<plant::World> world_;
  sim::Bus* bus_;
  std::unique_ptr<sim::Controller> port_;
  can::Dispatcher dispatcher_;
  trace::Trace trace_;
  rt::Time last_{};
  bool recording_ = false;
};

}  // namespace berth::study
