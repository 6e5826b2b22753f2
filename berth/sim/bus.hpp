/// A simulated CAN bus: exactly the results of a bit-by-bit model, but computed per frame.
///
/// Time runs in bits of each node's bit rate. A frame begins when the bus is idle and a node has a frame to send; every
/// node that is ready before the sample point (7/8) of that start-of-frame bit contends. While nothing is wrong, a
/// frame costs one arbitration and one delivery. If frames of one identifier collide, no node acknowledges, a fault
/// occurs or bit rates differ, the segment is simulated bit by bit until it is quiet again (`bits.hpp`). Rules: Bosch
/// CAN 2.0; docs/protocols/can-frames.md. Where the rules leave a choice: a good frame sets a REC above 127 to 127; REC
/// counts up to 255; a bit error within an error flag starts a new flag; overload frames answer what they see without
/// limit in number (no node here requests one itself).
///
/// An FD bus carries both classic and FD frames; in arbitration their bits decide (RRS is dominant). An FD frame
/// without errors takes its exact time, its data phase at the data bit rate. It is not simulated bit by bit beyond FDF.
/// Where that would be needed, the WHOLE frame is destroyed at FDF, whatever the place: its senders signal an error
/// there and count it like a missing acknowledgement, receivers see a stuff error, no node receives it, and it is
/// repeated. `BusStatistics::fd_destroyed` counts these frames, so that they cannot influence a result unnoticed. The
/// cases are:
/// - a fault in the frame
/// - senders of one identifier with different FD frames
/// - no node to acknowledge
/// - its sender or the cable removed while it is on the wire
/// - nodes of several bit rates
/// - a start while other nodes still handle an error
///
/// If an FD and a classic frame have one identifier, the FD frame's sender has the bit error, at FDF, as in reality.
#pragma once

#include <cstdint>
#include <memory>
#include <span>
#include <string>
#include <vector>

#include "berth/can/port.hpp"
#include "berth/sim/controller.hpp"
#include "berth/sim/fault_plan.hpp"

namespace berth::sim {

class World;
class Segment;
struct Medium;

/// Counters since the bus was made or `reset_statistics`.
struct BusStatistics {
  std::uint64_t frames = 0;        ///< frames without error; merged ones count once
  std::uint64_t bits = 0;          ///< their bits, with three of intermission
  std::uint64_t starts = 0;        ///< frames begun
  std::uint64_t error_frames = 0;  ///< frames ended by an error
  std::uint64_t overload_frames = 0;
  std::uint64_t collisions = 0;    ///< starts of several senders with one identifier and different content
  std::uint64_t merged = 0;        ///< frames that several senders sent as one
  std::uint64_t bitwise = 0;       ///< frames simulated bit by bit
  std::uint64_t fd_destroyed = 0;  ///< how often a sender's FD frame ended at FDF (see above); also counted as errors
  rt::Duration busy{};             ///< time from start of frame to the end of intermission, errors included
};

class Bus {
 public:
  ~Bus();
  Bus(const Bus&) = delete;
  Bus& operator=(const Bus&) = delete;

  /// Adds a node to the bus. It takes part at once on an idle bus, else after 11 recessive bits. Null for a classic
  /// controller on an FD bus: it would destroy every FD frame.
  [[nodiscard]] std::unique_ptr<Controller> attach(const ControllerOptions& options = {});

  /// The tap receives every good frame of every segment, at its end, and every frame ended by an error. Remove a tap
  /// before destroying it.
  void add_tap(can::Tap& tap);
  void remove_tap(can::Tap& tap) noexcept;

  /// Cuts the cable: from this instant these nodes are a second segment. Later cuts move nodes from any segment to one
  /// new segment.
  void split(std::span<Controller* const> others);
  /// Repairs every cut: all nodes with their cable plugged in are on one segment again. Frames under way collide.
  void join();

  /// Plans a fault; the returned number is for `FaultPlan::cancel`.
  unsigned inject(Fault fault);
  /// The planned faults; random faults are set there too.
  [[nodiscard]] FaultPlan& faults() noexcept { return faults_; }

  [[nodiscard]] World& world() const noexcept { return *world_; }
  [[nodiscard]] rt::Executor& executor() const noexcept { return *executor_; }
  [[nodiscard]] const std::string& name() const noexcept { return name_; }
  [[nodiscard]] int number() const noexcept { return number_; }
  /// The bit rate of nodes that specify none; bit/s.
  [[nodiscard]] std::uint32_t bit_rate() const noexcept { return bit_rate_; }
  /// The bit rate of the data phase, bit/s; 0: no FD bus.
  [[nodiscard]] std::uint32_t data_bit_rate() const noexcept { return data_bit_rate_; }
  [[nodiscard]] bool fd() const noexcept { return data_bit_rate_ != 0; }
  /// Length of one bit at `data_bit_rate()`, which must not be 0.
  [[nodiscard]] rt::Duration data_bit_time() const noexcept;
  /// Length of one bit at `bit_rate()`, rounded to whole nanoseconds.
  [[nodiscard]] rt::Duration bit_time() const noexcept;
  /// The nodes attached now, by number.
  [[nodiscard]] const std::vector<Controller*>& controllers() const noexcept { return controllers_; }
  [[nodiscard]] const BusStatistics& statistics() const noexcept { return statistics_; }
  /// Busy share of the time since the bus was made or `reset_statistics`, 0..1.
  [[nodiscard]] double load() const noexcept;
  void reset_statistics() noexcept;

 private:
  friend class World;
  friend class Controller;
  friend struct Medium;
  friend std::vector<std::vector<const Controller*>> pieces(const Bus& bus);
  Bus(World& world, int number, std::string name, can::BitRate bit_rate);
  void detach(Controller& controller) noexcept;
  void move(Controller& controller, bool cable_in) noexcept;
  void good_frame(const can::Frame& frame, rt::Time at, int sender) noexcept;
  Segment& new_segment();
  void drop_empty_segments() noexcept;

  World* world_;
  rt::Executor* executor_;
  int number_;
  std::uint32_t bit_rate_;
  std::uint32_t data_bit_rate_;
  std::string name_;
  std::vector<Controller*> controllers_;
  std::vector<std::unique_ptr<Segment>> segments_;
  std::vector<can::Tap*> taps_;
  FaultPlan faults_;
  int next_number_ = 0;
  BusStatistics statistics_;
  rt::Time statistics_since_{};
};

/// The segments of the cable, one if it is not cut: the nodes on each, by number. Without unplugged nodes.
[[nodiscard]] std::vector<std::vector<const Controller*>> pieces(const Bus& bus);

}  // namespace berth::sim
